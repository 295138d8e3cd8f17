"""The cut between two pieces in NumPy: the oracle of `rso_lidar.scene.surfaces.pieces`."""

import numpy as np

BINS = 16  # as in scene.surfaces.pieces


def find_cut(low: np.ndarray, high: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Return what `scene.surfaces.pieces.find_cut` does: the plane across an axis that leaves the least area of boxes."""
    least, best, areas = np.inf, np.zeros(len(facets), bool), (np.inf, np.inf)
    low, high = low[facets], high[facets]
    for axis in range(3):
        middle = low[:, axis] + high[:, axis]
        first, last = middle.min(), middle.max()
        if not last > first:
            continue
        place = np.minimum(BINS * ((middle - first) / (last - first)), BINS - 1).astype(np.int8)
        order = np.argsort(place, kind="stable")
        bins, at = np.unique(place[order], return_index=True)
        low_of, high_of = np.minimum.reduceat(low[order], at), np.maximum.reduceat(high[order], at)
        before = _box_area(np.minimum.accumulate(low_of), np.maximum.accumulate(high_of))[:-1]
        behind = _box_area(np.minimum.accumulate(low_of[::-1]), np.maximum.accumulate(high_of[::-1]))[-2::-1]
        cut = int(np.argmin(before + behind))
        if before[cut] + behind[cut] < least:
            least, best = before[cut] + behind[cut], place > bins[cut]
            areas = float(before[cut]), float(behind[cut])
    return best, *areas


def _box_area(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return half the area of boxes (…, xyz)."""
    x, y, z = np.moveaxis(high - low, -1, 0)
    area: np.ndarray = x * y + y * z + z * x
    return area
