"""Where targets can be seen from the lidar."""

from collections.abc import Sequence

import numpy as np

from rso_lidar.records import Extent, Truth
from rso_lidar.scene.surface import Surface


def extent(surfaces: Sequence[Surface], truth: Truth) -> Extent:
    """Return the bounds and convex outline of each target in the tangent plane z = 1 of the lidar axes.

    A target that reaches behind the lidar's plane has no finite bounds; one that is wholly behind has none at all.
    """
    outlines: list[np.ndarray | None] = [None] * len(surfaces)
    low = np.full((len(surfaces), 2), np.inf)
    high = np.full((len(surfaces), 2), -np.inf)
    for number, surface in enumerate(surfaces):
        points = truth.pose("lidar", surface.name).apply(surface.outline)
        ahead = points[:, 2] > 1e-6 * (1.0 + np.abs(points).max())
        if ahead.all():
            seen = points[:, :2] / points[:, 2:]
            low[number], high[number] = seen.min(axis=0), seen.max(axis=0)
            outlines[number] = _outline(seen)
        elif ahead.any():
            low[number], high[number] = -np.inf, np.inf
    return Extent(low, high, tuple(outlines))


def _outline(points: np.ndarray) -> np.ndarray | None:
    """Return the corners of the convex outline of points in a plane, in order; None where they lie on a line."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        corners: np.ndarray = points[ConvexHull(points).vertices]
    except QhullError:
        return None
    return corners
