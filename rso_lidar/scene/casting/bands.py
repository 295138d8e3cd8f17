"""Limits of casting: the least range, and the rays that a thread casts in one call."""

# Accuracy of a range. A facet through the lidar's own position has no range, and its radiometry would diverge.
NEAREST_M = 1e-6
BAND_RAYS = 8_192  # about 0.5 ms of casting, long compared with starting work on another thread
