"""Angles and distances among spacecraft, Sun and Earth.

Vectors are (time, 3) [m] in root axes from the Earth's centre, unless a function states otherwise. The Earth is a sphere of
its equatorial radius, without air. Against the ellipsoid its limb is up to 21 km too high: 0.5 degree seen from 400 km over
a pole, 0.03 degree from GEO.
"""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.records import BodyState


def angle_rad(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the angle (…) [rad] between vectors, accurate to rounding near 0 and pi too.

    Parameters
    ----------
    a, b : (…, 3) vectors of any length in common axes
    """
    across = np.cross(a, b)
    angle: np.ndarray = np.arctan2(np.sqrt(np.sum(across * across, axis=-1)), np.sum(a * b, axis=-1))
    return angle


def beta_angle_rad(state: BodyState, sun_m: np.ndarray) -> np.ndarray:
    """Return the beta angle (time,) [rad]: the Sun's elevation above the osculating orbit's plane, positive toward r x v.

    Parameters
    ----------
    state : states (time, 3)
    sun_m : (time, 3) position of the Sun [m]
    """
    normal = np.cross(state.position_m, state.velocity_m_s)
    beta: np.ndarray = 0.5 * np.pi - angle_rad(normal, sun_m)
    return beta


def phase_angle_rad(target_m: np.ndarray, observer_m: np.ndarray, sun_m: np.ndarray) -> np.ndarray:
    """Return the phase angle (time,) [rad] at a target, between the Sun and an observer: 0 with the Sun behind the observer.

    Parameters
    ----------
    target_m, observer_m, sun_m : (time, 3) positions in common axes [m]
    """
    return angle_rad(sun_m - target_m, observer_m - target_m)


def earth_angular_radius_rad(position_m: np.ndarray, radius_m: float = units.EARTH_RADIUS_M) -> np.ndarray:
    """Return the angular radius (time,) [rad] of the Earth's disk, or of another sphere.

    It is pi / 2 on the surface, and NaN below it.

    Parameters
    ----------
    position_m : (time, 3) position of the observer from the centre [m]
    radius_m : of the sphere, by default the Earth's [m]
    """
    distance = np.sqrt(np.sum(position_m * position_m, axis=-1))
    with np.errstate(divide="ignore", invalid="ignore"):
        radius: np.ndarray = np.arcsin(radius_m / distance)
    return radius


def earth_limb_angle_rad(boresight: np.ndarray, position_m: np.ndarray) -> np.ndarray:
    """Return the angle (time,) [rad] from a boresight to the Earth's limb, negative where the disk covers the boresight.

    Parameters
    ----------
    boresight : (time, 3) direction in root axes, of any length
    position_m : (time, 3) position of the observer [m]
    """
    angle: np.ndarray = angle_rad(boresight, -position_m) - earth_angular_radius_rad(position_m)
    return angle


def line_altitude_m(a_m: np.ndarray, b_m: np.ndarray, radius_m: float = units.EARTH_RADIUS_M) -> np.ndarray:
    """Return the lowest altitude (time,) [m] of the line from a to b over the Earth or another sphere; negative if blocked.

    Parameters
    ----------
    a_m, b_m : (time, 3) positions from the centre [m]
    radius_m : of the sphere, by default the Earth's [m]
    """
    line = b_m - a_m
    length2 = np.sum(line * line, axis=-1)
    share = np.clip(-np.sum(a_m * line, axis=-1) / np.where(length2 > 0.0, length2, 1.0), 0.0, 1.0)
    lowest = a_m + share[..., None] * line
    height: np.ndarray = np.sqrt(np.sum(lowest * lowest, axis=-1)) - radius_m
    return height
