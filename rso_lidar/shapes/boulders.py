"""Boulders on the ground: their size distribution, and their solids."""

import numpy as np

from rso_lidar.shapes.solids import Solid

_HEIGHT = 0.5  # over the diameter; 0.25 to 0.75 at landing sites (Golombek et al. 2003, J. Geophys. Res. 108)
_OVAL = 0.2  # greatest difference of the axes of a boulder, share of the mean diameter
_ROUGH = 0.1  # greatest displacement of a corner, share of the radius
_SUNK = 0.15  # depth of its skirt below the ground, share of the diameter
_SIDES, _RINGS = 12, 3
_GRID = 2000


def rock_decay_per_m(covered: float) -> float:
    """Return the decay q [1/m] of the share of ground k exp(-q D) that is under rocks larger than D; k is `covered`.

    q = 1.79 + 0.152 / k was fitted to the landing sites of Mars (Golombek and Rapp 1997, J. Geophys. Res. 102, 4117).
    Rocks near Chang'E-3 on the Moon have the same exponential form (Di et al. 2016, Planet. Space Sci. 120).
    """
    return 1.79 + 0.152 / covered


def rock_diameters(
    area_m2: float, smallest_m: float, largest_m: float, covered: float, rng: np.random.Generator
) -> np.ndarray:
    """Draw the diameters [m] of the rocks on an area, the largest first.

    Parameters
    ----------
    area_m2 : of the ground [m2]
    smallest_m, largest_m : limits of the diameters [m]
    covered : share of the area under rocks of all sizes
    """
    if covered <= 0.0:
        return np.empty(0)
    q = rock_decay_per_m(covered)
    edges = np.geomspace(smallest_m, largest_m, _GRID)
    cover = covered * np.exp(-q * edges)
    middle = np.sqrt(edges[1:] * edges[:-1])
    number = area_m2 * (cover[:-1] - cover[1:]) / (0.25 * np.pi * middle**2)  # in each bin; a rock covers a disc
    below = np.concatenate([[0.0], np.cumsum(number)])
    chosen = rng.random(rng.poisson(below[-1])) * below[-1]
    return np.sort(np.interp(chosen, below, edges))[::-1]


def boulder(diameter_m: float, rng: np.random.Generator) -> Solid:
    """Make a boulder on the ground at the origin: the rough upper half of an ellipsoid, +z up, on a skirt below the ground.

    It is closed underneath.
    """
    radius, height = 0.5 * diameter_m, _HEIGHT * diameter_m * rng.uniform(0.7, 1.3)
    oval, turn = 1.0 + _OVAL * rng.uniform(-0.5, 0.5), rng.uniform(0.0, 2.0 * np.pi)
    rise = np.arange(_RINGS) * (0.5 * np.pi / _RINGS)
    angle = np.arange(_SIDES) * (2.0 * np.pi / _SIDES)
    rough = 1.0 + _ROUGH * rng.uniform(-1.0, 1.0, (_RINGS, _SIDES))
    x = radius * oval * rough * np.cos(rise)[:, None] * np.cos(angle)
    y = radius / oval * rough * np.cos(rise)[:, None] * np.sin(angle)
    z = height * np.broadcast_to(np.sin(rise)[:, None], x.shape)
    x, y, z = (np.concatenate([ring[:1], ring]) for ring in (x, y, z))
    z[0] = -_SUNK * diameter_m
    x, y = x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)
    rings = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    vertices = np.concatenate([rings, [[0.0, 0.0, height], [0.0, 0.0, -_SUNK * diameter_m]]])
    return Solid(vertices, _facets())


def _facets() -> np.ndarray:
    here = np.arange(_SIDES)
    after = (here + 1) % _SIDES
    walls = []
    for low in range(0, _RINGS * _SIDES, _SIDES):
        high = low + _SIDES
        walls += [np.stack([low + here, low + after, high + after], axis=1)]
        walls += [np.stack([low + here, high + after, high + here], axis=1)]
    last = _RINGS * _SIDES
    top, under = last + _SIDES, last + _SIDES + 1
    cap = np.stack([last + here, last + after, np.full(_SIDES, top)], axis=1)
    floor = np.stack([after, here, np.full(_SIDES, under)], axis=1)
    return np.concatenate([*walls, cap, floor])
