"""Detectors on the bench: trials of single pixels, and what is solved or predicted by them."""
