"""The nearest hits in Python: the oracle of `rso_lidar.optics.returns.bounced.find_near_hits`."""

import numpy as np


def find_near_hits(pixel, direction, begins, ray, along):
    """Return the hit (path) of each pixel whose ray is nearest to a direction (xyz, path), -1 without a hit."""
    found = []
    for number, toward in zip(pixel, direction.T, strict=True):
        of = np.arange(begins[number], begins[number + 1]) if number >= 0 else []
        apart = [np.linalg.norm(along[:, ray[hit]] - toward) for hit in of]
        found.append(of[int(np.argmin(apart))] if len(of) else -1)
    return np.array(found)
