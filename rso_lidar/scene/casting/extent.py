"""Where targets can be seen from the lidar."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from rso_lidar.arithmetic import compiled, packed
from rso_lidar.records import Extent, Truth
from rso_lidar.scene.surfaces.pieces import pieces
from rso_lidar.scene.surfaces.surface import Surface

_Outlines = tuple[np.ndarray, ...]


def extent(surfaces: Sequence[Surface], truth: Truth) -> Extent:
    """Return the bounds of each target, and the convex outlines of its pieces, in the tangent plane z = 1 of the lidar axes.

    A target that reaches behind the lidar's plane has no finite bounds; one that is wholly behind has none at all.
    """
    if compiled():
        from rso_lidar.scene.casting.extent_loops import outlined
    else:
        outlined = _outlined
    outlines: list[_Outlines | None] = [None] * len(surfaces)
    bounds = np.empty((len(surfaces), 4))
    for number, surface in enumerate(surfaces):
        whole = pieces(surface)
        translation, matrix = truth.poses.place("lidar", surface.name)
        some, every, bounds[number], corners, ends = outlined(
            whole.points, whole.starts, packed(translation), packed(matrix)
        )
        if every:
            outlines[number] = tuple(corners[a:b] for a, b in pairwise(ends.tolist()))
        elif some:
            bounds[number] = -np.inf, -np.inf, np.inf, np.inf
    return Extent(bounds[:, :2], bounds[:, 2:], tuple(outlines))


def _outlined(
    points: np.ndarray, starts: np.ndarray, translation: np.ndarray, matrix: np.ndarray
) -> tuple[bool, bool, np.ndarray, np.ndarray, np.ndarray]:
    """Return what `extent_loops.outlined` does; an outline starts at any of its corners."""
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
    from scipy.spatial import ConvexHull, QhullError

    try:
        corners: np.ndarray = points[ConvexHull(points).vertices]
    except (QhullError, ValueError):
        order = np.lexsort(points.T[::-1])
        corners = points[order[[0, -1]]]
    return corners
