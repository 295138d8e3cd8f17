"""The pan-tilt unit: what it is asked to point at, its drive, and its encoders."""
