"""Recordings read back from HDF5 and Zarr: frames one by one, and arrays of which only what is asked for is read."""
