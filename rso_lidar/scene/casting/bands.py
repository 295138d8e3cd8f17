"""Limits of casting: the least range, and the rays that a thread casts in one call."""

# What ranges are good to: a facet through the lidar's own place has no range, and would return light without end.
NEAREST_M = 1e-6
BAND_RAYS = 8_192  # half a millisecond of casting in packets: long against the hand-over to a thread
