"""Lens effects: distortion and point spread functions."""
