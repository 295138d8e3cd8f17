"""Attitudes spread evenly over all rotations, and places in the pixel grid, in one deterministic sequence."""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from rso_lidar import units

_ROOT = 1.134_724_138_401_519_5  # x⁶ = x + 1: the ratio of the additive sequence in five dimensions (Roberts 2018)
_MOST_ALIGNED_DEG = 10.0  # an axis closer than this to a direction is described as pointing there


def spread_attitudes(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return attitudes spread evenly over all rotations, each with a place in the pixel.

    The additive recurrence of Roberts (2018, "The unreasonable effectiveness of quasirandom sequences") gives points of low
    discrepancy in five dimensions. Three of them become a rotation, uniform over SO(3) (Shoemake 1992, Graphics Gems III,
    p. 124). Two are the place.

    Parameters
    ----------
    n : number of attitudes.

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


def list_facing_attitudes() -> np.ndarray:
    """Return the attitudes (attitude, 3, 3) in which a face, an edge or a corner of the body's box faces the lidar."""
    directions = [np.array(one, dtype=float) for one in product((-1, 0, 1), repeat=3) if any(one)]
    return np.array([face_direction(one / np.linalg.norm(one)) for one in directions])


def face_direction(toward: np.ndarray) -> np.ndarray:
    """Return lidar_from_body, a matrix (3, 3), of a body on the boresight with one direction toward the lidar.

    Parameters
    ----------
    toward : (xyz) unit vector in body axes.
    """
    across = np.cross(toward, np.eye(3)[np.abs(toward).argmin()])
    across /= np.linalg.norm(across)
    return np.array([across, np.cross(-toward, across), -toward])


def describe_facing(lidar_from_body: np.ndarray) -> str:
    """Describe which body axis faces the lidar, for a body on the boresight.

    Parameters
    ----------
    lidar_from_body : rotation matrix (3, 3).

    >>> describe_facing(face_direction(np.array([0.0, 0.0, 1.0])))
    '+z faces the lidar'
    """
    toward = -lidar_from_body[2]  # the lidar is at −z of its own axes, seen from the body
    order = np.argsort(-np.abs(toward), kind="stable")
    first, second = (f"{'+' if toward[k] > 0.0 else '−'}{'xyz'[k]}" for k in order[:2])
    off_deg = math.acos(min(abs(float(toward[order[0]])), 1.0)) / units.DEG
    if off_deg < 0.5:
        return f"{first} faces the lidar"
    if off_deg < _MOST_ALIGNED_DEG:
        return f"{first} faces the lidar within {off_deg:.0f}°"
    return f"{first} faces the lidar, tilted by {off_deg:.0f}° toward {second}"
