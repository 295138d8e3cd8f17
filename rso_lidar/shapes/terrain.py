"""Ground generated from a random seed: craters, and boulders among them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar.errors import MeshError
from rso_lidar.shapes.boulders import boulder, rock_diameters
from rso_lidar.shapes.craters import add_craters
from rso_lidar.shapes.solids import Solid, join

_MOST_BOULDERS = 50_000
_CRATERS, _ROCKS = 0, 1  # random streams, so that the craters do not depend on the rocks


@dataclass(frozen=True)
class Abundance:
    """Range of sizes [m] and abundance of craters or rocks.

    `fraction` is the share of the equilibrium density (craters) or of the covered area (rocks).
    """

    smallest_m: float
    largest_m: float
    fraction: float


@dataclass(frozen=True, eq=False)
class Ground:
    """Heights [m] about their mean (row, col), row 0 in the north, and the boulders on them, if any."""

    heights_m: np.ndarray
    boulders: Solid | None


def build_ground(seed: int, size_m: float, cell_m: float, craters: Abundance, rocks: Abundance) -> Ground:
    """Generate ground from a random seed: a square about the origin, x east, y north.

    Parameters
    ----------
    seed : random seed; a seed always gives the same ground
    size_m : side of the square [m]
    cell_m : spacing of the heights [m]
    craters : sizes of the craters, and share of their equilibrium density
    rocks : sizes of the boulders, and share of the area that they cover

    Returns
    -------
    Ground
        Heights about their mean, and the boulders, if any.

    Raises
    ------
    MeshError
        If there are more than 50,000 boulders.
    """
    n = round(size_m / cell_m) + 1
    at = (np.arange(n) - 0.5 * (n - 1)) * cell_m
    rng = np.random.default_rng([seed, _CRATERS])
    heights = add_craters(at, -at, craters.smallest_m, craters.largest_m, craters.fraction, rng)
    heights -= heights.mean()
    return Ground(heights, _boulders(heights, cell_m, rocks, np.random.default_rng([seed, _ROCKS])))


def _boulders(heights: np.ndarray, cell_m: float, rocks: Abundance, rng: np.random.Generator) -> Solid | None:
    """Draw boulders on the ground; None without any.

    Parameters
    ----------
    heights, cell_m : (row, col) heights [m], and their spacing [m]
    """
    side = (len(heights) - 1) * cell_m
    diameters = rock_diameters(side**2, rocks.smallest_m, rocks.largest_m, rocks.fraction, rng)
    if len(diameters) > _MOST_BOULDERS:
        raise MeshError(
            f"terrain: {len(diameters):,} boulders of {rocks.smallest_m:g} m or more exceed the limit of "
            f"{_MOST_BOULDERS:,}; raise boulder_min_m, or lower rock_fraction"
        )
    if not len(diameters):
        return None
    x, y = ((rng.random(len(diameters)) - 0.5) * side for _ in range(2))
    places = np.column_stack([x, y, height_at(heights, cell_m, x, y)]).tolist()
    return join(
        *(boulder(diameter, rng).move(*place) for diameter, place in zip(diameters.tolist(), places, strict=True))
    )


def height_at(heights_m: np.ndarray, cell_m: float, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
    """Interpolate heights bilinearly in a grid about the origin; return heights [m], in the shape of the points.

    Parameters
    ----------
    heights_m : (row, col) heights [m], row 0 in the north
    cell_m : spacing of the grid [m]
    x_m, y_m : points, east and north of the origin [m]; those outside take the height of the edge
    """
    rows, cols = heights_m.shape
    col = np.clip(x_m / cell_m + 0.5 * (cols - 1), 0.0, cols - 1.0)
    row = np.clip(0.5 * (rows - 1) - y_m / cell_m, 0.0, rows - 1.0)
    left, top = np.minimum(col.astype(int), cols - 2), np.minimum(row.astype(int), rows - 2)
    s, t = col - left, row - top
    upper = heights_m[top, left] * (1.0 - s) + heights_m[top, left + 1] * s
    lower = heights_m[top + 1, left] * (1.0 - s) + heights_m[top + 1, left + 1] * s
    between: np.ndarray = upper * (1.0 - t) + lower * t
    return between
