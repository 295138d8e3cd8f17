"""Attitudes spread evenly over all rotations, and places in the pixel grid, in one deterministic sequence."""

from __future__ import annotations

import math

import numpy as np

_ROOT = 1.134_724_138_401_519_5  # x⁶ = x + 1: the ratio of the additive sequence in five dimensions (Roberts 2018)


def spread_attitudes(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return attitudes spread evenly over all rotations, each with a place in the pixel.

    The additive recurrence of Roberts (2018, "The unreasonable effectiveness of quasirandom sequences") gives points of low
    discrepancy in five dimensions. Three of them become a rotation, uniform over SO(3) (Shoemake 1992, Graphics Gems III,
    p. 124). Two are the place.

    Parameters
    ----------
    n : number of attitudes

    Returns
    -------
    matrix : (attitude, 3, 3) rotations.
    phase : (attitude, 2) places right and down of the middle [pixels], from −0.5 to 0.5.
    """
    steps = _ROOT ** -np.arange(1.0, 6.0)
    points = np.modf(0.5 + np.outer(np.arange(1, n + 1), steps))[0]
    u, v, w = points[:, 0], 2.0 * math.pi * points[:, 1], 2.0 * math.pi * points[:, 2]
    low, high = np.sqrt(1.0 - u), np.sqrt(u)
    x, y, z, s = low * np.sin(v), low * np.cos(v), high * np.sin(w), high * np.cos(w)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * s), 2 * (x * z + y * s)],
        [2 * (x * y + z * s), 1 - 2 * (x * x + z * z), 2 * (y * z - x * s)],
        [2 * (x * z - y * s), 2 * (y * z + x * s), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0), points[:, 3:] - 0.5
