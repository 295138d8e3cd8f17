"""Recordings read back from HDF5 and Zarr, frame by frame or array by array."""
