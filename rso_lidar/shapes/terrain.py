"""Ground made by seed: craters, and boulders that stand among them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar.errors import MeshError
from rso_lidar.shapes.boulders import boulder, rock_diameters
from rso_lidar.shapes.craters import add_craters
from rso_lidar.shapes.solids import Solid, join

_MOST_BOULDERS = 50_000
_CRATERS, _ROCKS = 0, 1  # streams of chance, so that other rocks leave the craters as they are


@dataclass(frozen=True)
class Abundance:
    """Sizes from `smallest_m` to `largest_m`, and how many: `fraction` of equilibrium (craters) or of the area (rocks)."""

    smallest_m: float
    largest_m: float
    fraction: float


@dataclass(frozen=True, eq=False)
class Ground:
    """Heights [m] about their mean (row, col), row 0 in the north; and what stands on them, None without any."""

    heights_m: np.ndarray
    boulders: Solid | None


def made_ground(seed: int, size_m: float, cell_m: float, craters: Abundance, rocks: Abundance) -> Ground:
    """Return the ground that a seed makes: a square about the origin, x east, y north; the same each time."""
    n = round(size_m / cell_m) + 1
    at = (np.arange(n) - 0.5 * (n - 1)) * cell_m
    rng = np.random.default_rng([seed, _CRATERS])
    heights = add_craters(at, -at, craters.smallest_m, craters.largest_m, craters.fraction, rng)
    heights -= heights.mean()
    return Ground(heights, _boulders(heights, cell_m, rocks, np.random.default_rng([seed, _ROCKS])))


def _boulders(heights: np.ndarray, cell_m: float, rocks: Abundance, rng: np.random.Generator) -> Solid | None:
    side = (len(heights) - 1) * cell_m
    diameters = rock_diameters(side**2, rocks.smallest_m, rocks.largest_m, rocks.fraction, rng)
    if len(diameters) > _MOST_BOULDERS:
        raise MeshError(
            f"terrain: {len(diameters):,} boulders of {rocks.smallest_m:g} m and more are over {_MOST_BOULDERS:,}; "
            "raise boulder_min_m, or lower rock_fraction"
        )
    if not len(diameters):
        return None
    x, y = ((rng.random(len(diameters)) - 0.5) * side for _ in range(2))
    places = np.column_stack([x, y, height_at(heights, cell_m, x, y)]).tolist()
    return join(
        *(boulder(diameter, rng).move(*place) for diameter, place in zip(diameters.tolist(), places, strict=True))
    )


def height_at(heights_m: np.ndarray, cell_m: float, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
    """Return heights [m] between those of a grid (row, col) about the origin, row 0 in the north: linear in x and in y."""
    rows, cols = heights_m.shape
    col = np.clip(x_m / cell_m + 0.5 * (cols - 1), 0.0, cols - 1.0)
    row = np.clip(0.5 * (rows - 1) - y_m / cell_m, 0.0, rows - 1.0)
    left, top = np.minimum(col.astype(int), cols - 2), np.minimum(row.astype(int), rows - 2)
    s, t = col - left, row - top
    upper = heights_m[top, left] * (1.0 - s) + heights_m[top, left + 1] * s
    lower = heights_m[top + 1, left] * (1.0 - s) + heights_m[top + 1, left + 1] * s
    between: np.ndarray = upper * (1.0 - t) + lower * t
    return between
