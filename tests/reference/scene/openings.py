"""The side of a facet that a ray meets, in NumPy: the oracle of `rso_lidar.scene.bounces.bounce.mark_open`."""

import numpy as np


def mark_open(direction, facet, turn, planes, openings):
    """Return whether anything lies in front of the side of its facet that each ray (xyz, hit) meets (hit)."""
    toward = np.einsum("xh,xy,yh->h", planes[:3, facet], turn, direction)
    return np.where(toward > 0.0, openings[1, facet], openings[0, facet])
