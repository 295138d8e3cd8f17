"""Datasets read: random frames and whole columns as NumPy arrays."""
