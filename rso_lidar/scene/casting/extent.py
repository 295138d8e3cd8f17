"""Extent: where targets can be seen from the lidar."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.records import Extent, Truth
from rso_lidar.scene.surfaces.pieces import find_pieces
from rso_lidar.scene.surfaces.surface import Surface

_Outlines = tuple[np.ndarray, ...]


def extent(surfaces: Sequence[Surface], truth: Truth) -> Extent:
    """Project each target's bounds, and the convex outlines of its pieces, into the tangent plane z = 1 of the lidar axes.

    A target that reaches behind the lidar's plane has infinite bounds. One that is entirely behind has empty bounds.

    Parameters
    ----------
    surfaces : surfaces of all targets
    truth : where they are at one epoch

    Returns
    -------
    bounds and outlines of each surface, in the tangent plane.
    """
    outlines: list[_Outlines | None] = [None] * len(surfaces)
    bounds = np.empty((len(surfaces), 4))
    for number, surface in enumerate(surfaces):
        whole = find_pieces(surface)
        translation, matrix = truth.poses.place("lidar", surface.name)
        some, every, bounds[number], corners, ends = project_outlines(
            whole.points, whole.starts, packed(translation), packed(matrix)
        )
        if every:
            outlines[number] = tuple(corners[a:b] for a, b in pairwise(ends.tolist()))
        elif some:
            bounds[number] = -np.inf, -np.inf, np.inf, np.inf
    return Extent(bounds[:, :2], bounds[:, 2:], tuple(outlines))


@kernel
def project_outlines(
    points: np.ndarray, starts: np.ndarray, translation: np.ndarray, matrix: np.ndarray
) -> tuple[bool, bool, np.ndarray, np.ndarray, np.ndarray]:
    """Project the points of a surface into the tangent plane, and find the convex outline of each piece.

    Parameters
    ----------
    points : (point, xyz) f8, corners of the hulls of all pieces, in body axes [m]
    starts : (piece + 1), the points of piece p are those from ``starts[p]`` to ``starts[p + 1]``

    Returns
    -------
    Whether any point, and whether every point, is in front of the lidar. The bounds low x, low y, high x, high y. The
    corners of all outlines (corner, right_down), with x rising along the lower side and falling along the upper. Where
    the outline of each piece ends among the corners (piece + 1), 0 first.
    """
    n = len(points)
    x, y, z = np.empty(n), np.empty(n), np.empty(n)
    farthest = 0.0
    for i in range(n):
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        x[i] = matrix[0, 0] * px + matrix[0, 1] * py + matrix[0, 2] * pz + translation[0]
        y[i] = matrix[1, 0] * px + matrix[1, 1] * py + matrix[1, 2] * pz + translation[1]
        z[i] = matrix[2, 0] * px + matrix[2, 1] * py + matrix[2, 2] * pz + translation[2]
        farthest = max(farthest, abs(x[i]), abs(y[i]), abs(z[i]))
    some, every = False, True
    for i in range(n):
        if z[i] > 1e-6 * (1.0 + farthest):
            some = True
        else:
            every = False
    bounds = np.array([np.inf, np.inf, -np.inf, -np.inf])
    ends = np.zeros(len(starts), dtype=np.int64)
    corners = np.empty((2 * n, 2))
    if not every:
        return some, every, bounds, corners[:0], ends
    for i in range(n):
        x[i] /= z[i]
        y[i] /= z[i]
        bounds[0], bounds[1] = min(bounds[0], x[i]), min(bounds[1], y[i])
        bounds[2], bounds[3] = max(bounds[2], x[i]), max(bounds[3], y[i])
    n_corners = 0
    for piece in range(len(starts) - 1):
        first, last = starts[piece], starts[piece + 1]
        sort_points(x, y, first, last)
        n_corners = append_side(x, y, first, last, 1, corners, n_corners)
        n_corners = append_side(x, y, first, last, -1, corners, n_corners)
        ends[piece + 1] = n_corners
    return some, every, bounds, corners[:n_corners], ends


@kernel
def sort_points(x: np.ndarray, y: np.ndarray, first: int, last: int) -> None:
    """Sort the points from `first` to `last` by x, then y, in place (shellsort).

    Parameters
    ----------
    x, y : (point), changed in place
    """
    gap = 1
    while 3 * gap < last - first:
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(first + gap, last):
            px, py, j = x[i], y[i], i - gap
            while j >= first and (x[j] > px or (x[j] == px and y[j] > py)):
                x[j + gap], y[j + gap] = x[j], y[j]
                j -= gap
            x[j + gap], y[j + gap] = px, py
        gap //= 3


@kernel
def append_side(
    x: np.ndarray, y: np.ndarray, first: int, last: int, way: int, corners: np.ndarray, n_corners: int
) -> int:
    """Append one side of the convex outline of sorted points, without its last point (Andrew's monotone chain).

    It returns the number of corners.

    Parameters
    ----------
    x, y : (point), the points; those from `first` to `last` are sorted
    way : 1 along the side of small y, -1 back along the other
    corners : (corner, 2), to which the side is written behind the first `n_corners`
    """
    begin = n_corners
    for step in range(last - first):
        i = first + step if way > 0 else last - 1 - step
        while n_corners - begin >= 2:
            ax, ay = (
                corners[n_corners - 1, 0] - corners[n_corners - 2, 0],
                corners[n_corners - 1, 1] - corners[n_corners - 2, 1],
            )
            if ax * (y[i] - corners[n_corners - 2, 1]) > ay * (x[i] - corners[n_corners - 2, 0]):
                break
            n_corners -= 1
        corners[n_corners, 0], corners[n_corners, 1] = x[i], y[i]
        n_corners += 1
    return n_corners - 1
