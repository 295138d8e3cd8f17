"""Craters on airless bodies: their size distribution, and the shape of the ground that they leave."""

import math

import numpy as np

EQUILIBRIUM = 0.079  # craters larger than 1 m per square metre, 10^-1.1: Trask 1966; Gault 1970, Radio Science 5
DEPTH, RIM = (
    0.196,
    0.036,
)  # of the diameter, fresh: Pike 1977, Impact and Explosion Cratering, simple craters of the Moon
_DECAY = 3  # ejecta thin with the third power of the distance: McGetchin et al. 1973, Earth Planet. Sci. Lett. 20
_REACH = 3.0  # radii at which the blanket of ejecta is cut off


def crater_diameters(
    area_m2: float, smallest_m: float, largest_m: float, fraction: float, rng: np.random.Generator
) -> np.ndarray:
    """Draw the diameters [m] of the craters on an area, the largest first.

    In equilibrium, new craters replace eroded ones, and N(> D) = 0.079 D^-2 per square metre whatever the production
    rate.

    Parameters
    ----------
    area_m2 : of the ground [m2]
    smallest_m, largest_m : limits of the diameters [m]
    fraction : share of the density in equilibrium
    """
    per_m2 = fraction * EQUILIBRIUM * (smallest_m**-2 - largest_m**-2)
    number = rng.poisson(per_m2 * area_m2)
    share = rng.random(number)
    diameters = (smallest_m**-2 - share * (smallest_m**-2 - largest_m**-2)) ** -0.5
    return np.sort(diameters)[::-1]


def crater_heights(distance: np.ndarray) -> np.ndarray:
    """Return the height of a fresh crater above the old ground.

    The height is in diameters, the distance from the middle in radii.

    It is a paraboloid from the floor to the crest of the rim; the depth is from crest to floor. Outside lies a blanket
    of ejecta that thins with the third power of the distance.
    """
    inside = RIM - DEPTH + DEPTH * distance**2
    end = _REACH**-_DECAY
    blanket = RIM * (np.maximum(distance, 1.0) ** -_DECAY - end) / (1.0 - end)
    heights: np.ndarray = np.where(distance < 1.0, inside, np.maximum(blanket, 0.0))
    return heights


def add_craters(
    x_m: np.ndarray,
    y_m: np.ndarray,
    smallest_m: float,
    largest_m: float,
    fraction: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """Generate the heights [m] of cratered ground on a grid (row, col).

    Craters lie at random, also outside the grid as far as their ejecta reach into it. Each is eroded to a share of its
    fresh height that is uniformly distributed, as in equilibrium. Heights of overlapping craters add.

    Parameters
    ----------
    x_m, y_m : evenly spaced coordinates of the columns and of the rows [m]
    smallest_m, largest_m : limits of the diameters [m]
    fraction : share of the density in equilibrium
    """
    heights = np.zeros((len(y_m), len(x_m)))
    margin = 0.5 * _REACH * largest_m
    (west, east), (south, north) = ((axis.min() - margin, axis.max() + margin) for axis in (x_m, y_m))
    area_m2 = (east - west) * (north - south)
    diameters = crater_diameters(area_m2, smallest_m, largest_m, fraction, rng)
    places = rng.random((len(diameters), 3))
    middles_x, middles_y = west + places[:, 0] * (east - west), south + places[:, 1] * (north - south)
    for diameter, x, y, fresh in zip(diameters, middles_x, middles_y, places[:, 2], strict=True):
        radius = 0.5 * diameter
        cols, rows = (_within(axis, at, _REACH * radius) for axis, at in ((x_m, x), (y_m, y)))
        if rows.start >= rows.stop or cols.start >= cols.stop:
            continue
        distance = np.hypot((y_m[rows] - y)[:, None], x_m[cols] - x) / radius
        heights[rows, cols] += fresh * diameter * crater_heights(distance)
    return heights


def _within(axis: np.ndarray, middle: float, reach: float) -> slice:
    """Return the slice of an evenly spaced axis, rising or falling, that lies within a distance of a point."""
    step = float(axis[1] - axis[0])
    ends = sorted(((middle - reach - axis[0]) / step, (middle + reach - axis[0]) / step))
    return slice(max(0, math.ceil(ends[0])), min(len(axis), math.floor(ends[1]) + 1))
