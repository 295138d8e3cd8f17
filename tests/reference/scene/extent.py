"""Outlines of pieces in NumPy, by Qhull: the oracle of `rso_lidar.scene.casting.extent`."""

from itertools import pairwise

import numpy as np
from scipy.spatial import ConvexHull, QhullError


def project_outlines(
    points: np.ndarray, starts: np.ndarray, translation: np.ndarray, matrix: np.ndarray
) -> tuple[bool, bool, np.ndarray, np.ndarray, np.ndarray]:
    """Return what `scene.casting.extent.project_outlines` does; an outline starts at any of its corners."""
    x, y, z = (row[0] * points[:, 0] + row[1] * points[:, 1] + row[2] * points[:, 2] for row in matrix)
    x, y, z = x + translation[0], y + translation[1], z + translation[2]
    ahead = z > 1e-6 * (1.0 + max(float(np.abs(axis).max()) for axis in (x, y, z)))
    if not ahead.all():
        none = np.array([np.inf, np.inf, -np.inf, -np.inf])
        return bool(ahead.any()), False, none, np.empty((0, 2)), np.zeros(len(starts), np.int64)
    seen = np.stack([x / z, y / z], axis=1)
    corners = [_outline(seen[a:b]) for a, b in pairwise(starts)]
    ends = np.cumsum([0] + [len(outline) for outline in corners])
    return True, True, np.concatenate([seen.min(axis=0), seen.max(axis=0)]), np.concatenate(corners), ends


def _outline(points: np.ndarray) -> np.ndarray:
    """Return the corners of the convex outline of points in a plane, in order; the ends where they lie on a line."""
    try:
        corners: np.ndarray = points[ConvexHull(points).vertices]
    except (QhullError, ValueError):
        order = np.lexsort(points.T[::-1])
        corners = points[order[[0, -1]]]
    return corners
