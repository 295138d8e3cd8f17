"""Attitudes of a body on the boresight by the side of it that faces the lidar."""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from rso_lidar import units

_MOST_ALIGNED_DEG = 10.0  # an axis closer than this to a direction is described as pointing there


def list_facing_attitudes() -> np.ndarray:
    """Return the attitudes (attitude, 3, 3) in which a face, an edge or a corner of the body's box faces the lidar."""
    directions = [np.array(signs, dtype=float) for signs in product((-1, 0, 1), repeat=3) if any(signs)]
    return np.array([face_direction(direction / np.linalg.norm(direction)) for direction in directions])


def face_direction(toward: np.ndarray) -> np.ndarray:
    """Return lidar_from_body, a matrix (3, 3), of a body on the boresight with one direction toward the lidar.

    Parameters
    ----------
    toward : (xyz) unit vector in body axes
    """
    across = np.cross(toward, np.eye(3)[np.abs(toward).argmin()])
    across /= np.linalg.norm(across)
    return np.array([across, np.cross(-toward, across), -toward])


def describe_facing(lidar_from_body: np.ndarray) -> str:
    """Describe which body axis faces the lidar, for a body on the boresight.

    Parameters
    ----------
    lidar_from_body : rotation matrix (3, 3)

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
