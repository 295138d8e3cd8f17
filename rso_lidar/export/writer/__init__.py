"""Recordings written to HDF5 and Zarr, frame by frame, so that a killed run loses nothing."""
