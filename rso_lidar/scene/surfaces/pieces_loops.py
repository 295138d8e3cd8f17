"""The loop of pieces: facets of a box laid in bins along each axis, and the cut that leaves the least area of boxes."""

import numpy as np

from rso_lidar.arithmetic import loop

BINS = 16  # places along each axis where a piece may be split


@loop
def divided(low: np.ndarray, high: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Return which of some facets lie beyond the cut, from the bounds (facet, xyz) of all, and half the area of both boxes.

    First that of the facets before the cut; where there is none, no facet lies beyond it.
    """
    n = len(facets)
    beyond = np.zeros(n, dtype=np.bool_)
    first, last = np.full(3, np.inf), np.full(3, -np.inf)
    for i in range(n):
        f = facets[i]
        for axis in range(3):
            middle = low[f, axis] + high[f, axis]
            first[axis], last[axis] = min(first[axis], middle), max(last[axis], middle)
    bounds = np.empty((3, BINS, 6))
    bounds[:, :, :3], bounds[:, :, 3:] = np.inf, -np.inf
    for i in range(n):
        f = facets[i]
        for axis in range(3):
            if last[axis] > first[axis]:
                box = bounds[axis, bin_of(low[f, axis] + high[f, axis], first[axis], last[axis])]
                for side in range(3):
                    box[side] = min(box[side], low[f, side])
                    box[3 + side] = max(box[3 + side], high[f, side])
    least, best, cut = np.inf, -1, 0
    area_before, area_behind = np.inf, np.inf
    behind, before = np.empty(BINS), np.empty(6)
    for axis in range(3):
        if not last[axis] > first[axis]:
            continue
        before[:3], before[3:] = np.inf, -np.inf
        for place in range(BINS - 1, 0, -1):
            joined(before, bounds[axis, place])
            behind[place] = half_area(before)
        before[:3], before[3:] = np.inf, -np.inf
        for place in range(BINS - 1):
            if bounds[axis, place, 0] > bounds[axis, place, 3]:
                continue  # an empty bin
            joined(before, bounds[axis, place])
            area = half_area(before)
            if area + behind[place + 1] < least:
                least, best, cut = area + behind[place + 1], axis, place
                area_before, area_behind = area, behind[place + 1]
    if best < 0:
        return beyond, area_before, area_behind
    for i in range(n):
        f = facets[i]
        beyond[i] = bin_of(low[f, best] + high[f, best], first[best], last[best]) > cut
    return beyond, area_before, area_behind


@loop
def bin_of(middle: float, first: float, last: float) -> int:
    """Return the bin of a middle between the first and the last."""
    return min(int(BINS * ((middle - first) / (last - first))), BINS - 1)


@loop
def joined(box: np.ndarray, other: np.ndarray) -> None:
    """Grow a box, low x, y, z, high x, y, z, until it holds another."""
    for side in range(3):
        box[side] = min(box[side], other[side])
        box[3 + side] = max(box[3 + side], other[3 + side])


@loop
def half_area(box: np.ndarray) -> float:
    """Return half the area of a box."""
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    area: float = x * y + y * z + z * x
    return area
