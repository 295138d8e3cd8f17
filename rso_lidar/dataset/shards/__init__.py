"""The files of a dataset: shards of labelled frames in HDF5, the sensor file and the manifest."""
