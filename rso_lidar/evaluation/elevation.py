"""Elevation maps built from frames, their agreement with the true ground, and landing hazards."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rso_lidar import units
from rso_lidar.records import Frame
from rso_lidar.scene import Surface, find_top_heights

Pose = tuple[np.ndarray, np.ndarray]  # site_from_lidar: position (xyz) [m] and rotation matrix (3, 3)

SAFE, HAZARD, UNKNOWN = 0, 1, -1
_COARSE_M = 8.0  # side of the squares in which a point is compared with its neighbours
_APART_M = 8.0  # distance from their median beyond which a point is noise
_ENOUGH = 5  # known neighbours that fill a hole
_SUB = 3  # points along each side of a cell for the mean of true heights
_ROWS = 64  # of a map in one batch


@dataclass(frozen=True, eq=False)
class ElevationMap:
    """Heights on a regular grid about a site's origin, row 0 in the north.

    `height_m` (row, col) [m] is the mean over each cell, NaN where unknown. `points` (row, col) is the number of lidar
    points in each cell.
    """

    cell_m: float
    height_m: np.ndarray
    points: np.ndarray

    @property
    def east_m(self) -> np.ndarray:
        """East coordinate of the middle of each column [m]."""
        cols = self.height_m.shape[1]
        east: np.ndarray = (np.arange(cols) - 0.5 * (cols - 1)) * self.cell_m
        return east

    @property
    def north_m(self) -> np.ndarray:
        """North coordinate of the middle of each row [m]."""
        rows = self.height_m.shape[0]
        north: np.ndarray = (0.5 * (rows - 1) - np.arange(rows)) * self.cell_m
        return north

    @property
    def coverage(self) -> float:
        """Share of cells with a known height."""
        return float(np.isfinite(self.height_m).mean())

    @property
    def slope_deg(self) -> np.ndarray:
        """Slope (row, col) [deg] between the neighbours of each cell, two cells apart."""
        down, right = np.gradient(self.height_m, self.cell_m)
        slope: np.ndarray = np.arctan(np.hypot(down, right)) / units.DEG
        return slope

    def fill_holes(self) -> ElevationMap:
        """Return the map with holes filled by the mean of their neighbours, where at least five of eight are known."""
        wide = np.pad(self.height_m, 1, constant_values=np.nan)
        about = np.lib.stride_tricks.sliding_window_view(wide, (3, 3)).reshape(*self.height_m.shape, 9)
        known = np.isfinite(about)
        number = known.sum(axis=-1)
        mean = np.where(known, about, 0.0).sum(axis=-1) / np.maximum(number, 1)
        filled = np.where(np.isnan(self.height_m) & (number >= _ENOUGH), mean, self.height_m)
        return ElevationMap(self.cell_m, filled, self.points)


def build_elevation_map(
    frames: Iterable[Frame],
    site: str,
    size_m: float,
    cell_m: float,
    navigated: Callable[[Frame, Pose], Pose] | None = None,
) -> ElevationMap:
    """Build a map of heights of a square site from frames, in the site's axes.

    The weight of a point is the inverse square of its range, because the width of its pixel on the ground grows with
    range. Points more than 8 m from the median of the 8 m about them are rejected as false triggers.

    Parameters
    ----------
    frames : a recording
    site : name of the axes
    size_m : side of the site [m]
    cell_m : side of a cell [m]
    navigated : function that returns the pose as navigated, from a frame and the true pose (None: the true pose)

    Returns
    -------
    The map; cells without a point are NaN.

    Raises
    ------
    ValueError
        For a cell larger than the site.
    """
    n = round(size_m / cell_m)
    if n < 1:
        raise ValueError(f"build_elevation_map: no cell of {cell_m:g} m in {size_m:g} m; make cell_m smaller")
    samples: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for frame in frames:
        pose = frame.truth.poses.place(site, "lidar")
        place, turn = navigated(frame, pose) if navigated else pose
        points = frame.points_m[frame.valid]
        x, y, z = (turn[k, 0] * points[:, 0] + turn[k, 1] * points[:, 1] + turn[k, 2] * points[:, 2] for k in range(3))
        col = np.floor((x + place[0]) / cell_m + 0.5 * n)
        row = np.floor(0.5 * n - (y + place[1]) / cell_m)
        inside = (col >= 0) & (col < n) & (row >= 0) & (row < n)
        cell = (row[inside] * n + col[inside]).astype(np.int64)
        weight = 1.0 / np.sum(points[inside] ** 2, axis=1)
        samples.append((cell, z[inside] + place[2], weight))
    if not samples:
        return ElevationMap(cell_m, np.full((n, n), np.nan), np.zeros((n, n), np.int32))
    cell, height, weight = (np.concatenate(column) for column in zip(*samples, strict=True))
    kept = _reject_outliers(cell, height, n, max(1, round(_COARSE_M / cell_m)))
    cell, height, weight = cell[kept], height[kept], weight[kept]
    total = np.bincount(cell, weight, n * n)
    with np.errstate(invalid="ignore"):
        mean = np.bincount(cell, weight * height, n * n) / total
    return ElevationMap(cell_m, mean.reshape(n, n), np.bincount(cell, minlength=n * n).astype(np.int32).reshape(n, n))


def _reject_outliers(cell: np.ndarray, height: np.ndarray, n: int, coarse: int) -> np.ndarray:
    """Return a mask of points whose height [m] is near the median of their coarse square."""
    square = (cell // n) // coarse * n + (cell % n) // coarse
    order = np.lexsort((height, square))
    starts = np.flatnonzero(np.diff(square[order], prepend=-1))
    sizes = np.diff(starts, append=len(order))
    median = np.repeat(height[order][starts + sizes // 2], sizes)
    kept = np.empty(len(order), dtype=bool)
    kept[order] = np.abs(height[order] - median) <= _APART_M
    return kept


def build_true_elevation(surface: Surface, like: ElevationMap) -> ElevationMap:
    """Build the true map of a surface's topmost facets, averaged over the cells of another map.

    Parameters
    ----------
    surface : the ground
    like : the map that gives the grid

    Returns
    -------
    The map; its `points` count the heights that were averaged in each cell.
    """
    part = ((np.arange(_SUB) + 0.5) / _SUB - 0.5) * like.cell_m
    east = (like.east_m[:, None] + part).ravel()
    north = (like.north_m[:, None] - part).ravel()
    tops = find_top_heights(surface, east[None, :], north[:, None])
    rows, cols = like.height_m.shape
    mean = tops.reshape(rows, _SUB, cols, _SUB).mean(axis=(1, 3))
    return ElevationMap(like.cell_m, mean, np.full((rows, cols), _SUB**2, np.int32))


@dataclass(frozen=True)
class MapAgreement:
    """Agreement of a map with the truth where the slope of the ground is `from_deg` to `to_deg`.

    `coverage` is the share of those cells with a known height. `bias_m` and `rms_m` are those of map minus truth. `worst_m`
    is the 95 % quantile of the absolute error.
    """

    from_deg: float
    to_deg: float
    cells: int
    coverage: float
    bias_m: float
    rms_m: float
    worst_m: float


def compare_maps(
    found: ElevationMap, truth: ElevationMap, slopes_deg: tuple[float, ...] = (0, 5, 10, 15, 20, 90)
) -> list[MapAgreement]:
    """Compare a map with the truth, over all slopes first, then in classes of slope.

    Parameters
    ----------
    found : the map
    truth : the true map on the same grid
    slopes_deg : limits of the classes [deg]

    Returns
    -------
    One row for all slopes, then one for each class.
    """
    slope, apart = truth.slope_deg, found.height_m - truth.height_m
    known = np.isfinite(slope)
    spans = [(slopes_deg[0], slopes_deg[-1]), *pairwise(slopes_deg)]
    rows = []
    for low, high in spans:
        of = known & (slope >= low) & (slope < high)
        errors = apart[of & np.isfinite(apart)]
        figures = (np.nan, np.nan, np.nan)
        if len(errors):
            figures = float(errors.mean()), float(np.sqrt((errors**2).mean())), float(np.quantile(np.abs(errors), 0.95))
        cells = int(of.sum())
        rows.append(MapAgreement(low, high, cells, len(errors) / cells if cells else 0.0, *figures))
    return rows


def find_hazards(ground: ElevationMap, footprint_m: float, slope_deg: float, roughness_m: float) -> np.ndarray:
    """Classify each cell (row, col) as a landing site: SAFE, HAZARD or UNKNOWN.

    A plane is fitted by least squares to the cells of the lander's footprint. A slope or a distance of a cell from the
    plane above its limit is a hazard. The class is unknown where a cell has no height, and beyond the map's edge.

    Parameters
    ----------
    ground : the map
    footprint_m : side of the lander's footprint [m]
    slope_deg : greatest safe slope [deg]
    roughness_m : greatest safe distance of a cell from the plane [m]

    Returns
    -------
    (row, col) i1: `SAFE`, `HAZARD` or `UNKNOWN`.
    """
    width = max(3, 2 * round(0.5 * (footprint_m / ground.cell_m - 1.0)) + 1)
    state = np.full(ground.height_m.shape, UNKNOWN, dtype=np.int8)
    rows, cols = (size - width + 1 for size in ground.height_m.shape)
    if rows < 1 or cols < 1:
        return state
    offset = (np.arange(width) - 0.5 * (width - 1)) * ground.cell_m
    square = width * float((offset**2).sum())
    windows = np.lib.stride_tricks.sliding_window_view(ground.height_m, (width, width))
    half = width // 2
    for first in range(0, rows, _ROWS):
        some = windows[first : first + _ROWS]
        mean = some.mean(axis=(2, 3), keepdims=True)
        east = (some * offset).sum(axis=(2, 3), keepdims=True) / square
        south = (some * offset[:, None]).sum(axis=(2, 3), keepdims=True) / square
        rough = np.abs(some - mean - east * offset - south * offset[:, None]).max(axis=(2, 3))
        slope = np.arctan(np.hypot(east, south)[..., 0, 0]) / units.DEG
        judged = np.where((slope > slope_deg) | (rough > roughness_m), HAZARD, SAFE)
        judged = np.where(np.isfinite(slope), judged, UNKNOWN)
        state[half + first : half + first + len(judged), half : half + cols] = judged
    return state
