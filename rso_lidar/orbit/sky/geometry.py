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
    """Return the angle (…) [rad] between vectors (…, 3) of any length, accurate to rounding near 0 and pi too."""
    across = np.cross(a, b)
    angle: np.ndarray = np.arctan2(np.sqrt(np.sum(across * across, axis=-1)), np.sum(a * b, axis=-1))
    return angle


def beta_angle_rad(state: BodyState, sun_m: np.ndarray) -> np.ndarray:
    """Return the beta angle: the Sun's elevation above the plane of the osculating orbit.

    Parameters
    ----------
    state : states (time, 3)
    sun_m : (time, 3) position of the Sun [m]

    Returns
    -------
    (time,) [rad], positive on the side of r x v
    """
    normal = np.cross(state.position_m, state.velocity_m_s)
    beta: np.ndarray = 0.5 * np.pi - angle_rad(normal, sun_m)
    return beta


def phase_angle_rad(target_m: np.ndarray, observer_m: np.ndarray, sun_m: np.ndarray) -> np.ndarray:
    """Return the phase angle at a target, between the Sun and an observer.

    Parameters
    ----------
    target_m, observer_m, sun_m : (time, 3) positions in common axes [m]

    Returns
    -------
    (time,) [rad], 0 where the Sun is behind the observer
    """
    return angle_rad(sun_m - target_m, observer_m - target_m)


def earth_angular_radius_rad(position_m: np.ndarray, radius_m: float = units.EARTH_RADIUS_M) -> np.ndarray:
    """Return the angular radius of the Earth's disk, or of another sphere.

    Parameters
    ----------
    position_m : (time, 3) position of the observer from the centre [m]
    radius_m : of the sphere, by default the Earth's [m]

    Returns
    -------
    (time,) [rad], pi / 2 on the surface, NaN below it
    """
    distance = np.sqrt(np.sum(position_m * position_m, axis=-1))
    with np.errstate(divide="ignore", invalid="ignore"):
        radius: np.ndarray = np.arcsin(radius_m / distance)
    return radius


def earth_limb_angle_rad(boresight: np.ndarray, position_m: np.ndarray) -> np.ndarray:
    """Return the angle from a boresight to the Earth's limb.

    Parameters
    ----------
    boresight : (time, 3) direction in root axes, of any length
    position_m : (time, 3) position of the observer [m]

    Returns
    -------
    (time,) [rad], negative where the disk covers the boresight
    """
    angle: np.ndarray = angle_rad(boresight, -position_m) - earth_angular_radius_rad(position_m)
    return angle


def is_earth_lit(boresight: np.ndarray, position_m: np.ndarray, sun_m: np.ndarray) -> np.ndarray:
    """Determine whether the Earth is in daylight where a boresight meets it.

    Parameters
    ----------
    boresight : (time, 3) direction in root axes, of any length
    position_m : (time, 3) position of the observer [m]
    sun_m : (time, 3) position of the Sun [m]

    Returns
    -------
    (time,) bool; where the boresight misses the Earth, the point of the limb nearest to it is judged
    """
    ahead = boresight / np.sqrt(np.sum(boresight**2, axis=-1, keepdims=True))
    distance = np.sqrt(np.sum(position_m**2, axis=-1))
    along = -np.sum(position_m * ahead, axis=-1)
    inside = (
        along**2 - distance**2 + units.EARTH_RADIUS_M**2
    )  # discriminant of the ray's first intersection with the sphere
    met = position_m + (along - np.sqrt(np.maximum(inside, 0.0)))[..., None] * ahead
    # limb point in the plane of boresight and Earth's centre, at the central angle acos(R / r) from the nadir point
    up = position_m / distance[..., None]
    aside = ahead - np.sum(ahead * up, axis=-1)[..., None] * up
    aside = aside / np.maximum(np.sqrt(np.sum(aside**2, axis=-1)), 1e-300)[..., None]
    cosine = np.minimum(units.EARTH_RADIUS_M / distance, 1.0)
    limb = cosine[..., None] * up + np.sqrt(1.0 - cosine**2)[..., None] * aside
    place = np.where(((inside > 0.0) & (along > 0.0))[..., None], met, limb)
    lit: np.ndarray = np.sum(place * sun_m, axis=-1) > 0.0
    return lit


def line_altitude_m(a_m: np.ndarray, b_m: np.ndarray, radius_m: float = units.EARTH_RADIUS_M) -> np.ndarray:
    """Return the lowest altitude of the straight line from a to b over the Earth, or over another sphere.

    Parameters
    ----------
    a_m, b_m : (time, 3) positions from the centre [m]
    radius_m : of the sphere, by default the Earth's [m]

    Returns
    -------
    (time,) [m], negative where the sphere blocks the line
    """
    line = b_m - a_m
    length2 = np.sum(line * line, axis=-1)
    share = np.clip(-np.sum(a_m * line, axis=-1) / np.where(length2 > 0.0, length2, 1.0), 0.0, 1.0)
    lowest = a_m + share[..., None] * line
    height: np.ndarray = np.sqrt(np.sum(lowest * lowest, axis=-1)) - radius_m
    return height


def angle_outside_field_rad(direction: np.ndarray, half_field: np.ndarray) -> np.ndarray:
    """Return the angle from a rectangular field of view to directions outside it.

    A disk of angular radius q about the direction overlaps the field where this angle is at most q.

    Parameters
    ----------
    direction : (time, 3) in lidar axes, +z the boresight, of any length
    half_field : (time, 2) or (2,) tangents of the half angles to the right and down

    Returns
    -------
    (time,) [rad], 0 inside the field
    """
    unit = direction / np.maximum(np.sqrt(np.sum(direction**2, axis=-1, keepdims=True)), 1e-300)
    # the field is symmetric: fold the direction into the quadrant with x and y positive
    x, y, z = np.abs(unit[..., 0]), np.abs(unit[..., 1]), unit[..., 2]
    right, down = np.broadcast_to(half_field[..., 0], x.shape), np.broadcast_to(half_field[..., 1], x.shape)
    over_x, over_y = x - right * z, y - down * z
    inside = (over_x <= 0.0) & (over_y <= 0.0) & (z > 0.0)
    corner = angle_rad(np.stack([x, y, z], axis=-1), np.stack([right, down, np.ones_like(x)], axis=-1))
    best = corner
    for over, across, along, edge, reach in ((over_x, x, y, right, down), (over_y, y, x, down, right)):
        norm = np.sqrt(1.0 + edge**2)
        foot = (
            z + edge * across
        ) / norm  # projection of the direction onto the plane of the edge, along the middle of the edge
        on_edge = (over > 0.0) & (foot > 0.0) & (along * norm <= reach * foot)
        best = np.where(on_edge, np.arcsin(np.clip(over / norm, -1.0, 1.0)), best)
    angle: np.ndarray = np.where(inside, 0.0, best)
    return angle


def angle_off_axis_rad(position_m: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Return the angle (time,) [rad] at a cone's apex between its axis and a position, both in the axes of the apex."""
    return angle_rad(position_m, np.broadcast_to(axis, position_m.shape))
