"""Geiger mode: pixels that count single photons, and time them, over the pulses of a frame."""
