"""Kernels of NAIF's SPICE toolkit (SPK, CK, FK, SCLK): read as motion and attitude, and written."""
