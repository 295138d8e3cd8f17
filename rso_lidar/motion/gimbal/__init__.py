"""The pan-tilt unit: its demanded pointing, its drive, and its encoders."""
