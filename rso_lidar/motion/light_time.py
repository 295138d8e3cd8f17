"""Light time: where and how turned targets are when the light of a flash meets them, as the lidar sees them.

Light moves at c in the root axes. It leaves the lidar at t, meets a target at t + τ₁ and returns to the lidar at
t + τ₁ + τ₂. Origins move at constant velocity and axes turn at constant rate meanwhile. Each body is taken as a whole, at
the τ₁ of its origin. Vectors of positions in root axes, with relative velocity v and lidar velocity V:

    |p + (v + V) τ₁| = c τ₁        outward, to the target
    |p + v τ₁ - V τ₂| = c τ₂       back, to the lidar

Range is half of both paths. The line of sight is the direction of p + v τ₁, in the axes of the lidar at the return. It
contains the aberration by the lidar's own velocity.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.pose import ROOT, Link, PoseTree, cross, dot, length, matrix_from_vector, rotate_vectors
from rso_lidar.records import Truth


def apply_light_time(truth: Truth, names: Iterable[str]) -> Truth:
    """Return the truth of a flash in which each of the named axes stands where the lidar sees it by its own light.

    The named axes become children of the lidar's. Time, states and all other axes stay as they are at emission.

    Parameters
    ----------
    truth : at emission, with the lidar and all rates; one epoch or a batch
    names : of the axes that light meets, such as those of all surfaces

    Raises
    ------
    ScenarioError
        If a body moves at the speed of light or faster
    """
    carrier = truth.poses.link(ROOT, "lidar")
    velocity_m_s = rotate_vectors(np.swapaxes(carrier.matrix, -1, -2), carrier.velocity_m_s)
    poses = truth.poses
    for name in names:
        link = _see(truth.poses, name, velocity_m_s, carrier.angular_velocity_rad_s)
        poses = poses.with_node(name, "lidar", link)
    return replace(truth, poses=poses)


def _see(poses: PoseTree, name: str, lidar_m_s: np.ndarray, lidar_rad_s: np.ndarray) -> Link:
    """Return the pose of axes in those of the lidar as the lidar sees them.

    Parameters
    ----------
    lidar_m_s, lidar_rad_s : (…, 3) velocity and angular velocity of the lidar relative to the root, in lidar axes
    """
    here = poses.link("lidar", name)
    place_m = here.translation_m
    moving_m_s = here.velocity_m_s + cross(lidar_rad_s, place_m)  # in axes that do not turn with the lidar
    turning_rad_s = here.angular_velocity_rad_s + rotate_vectors(np.swapaxes(here.matrix, -1, -2), lidar_rad_s)
    fastest_m_s = float(np.max([np.max(length(lidar_m_s)), np.max(length(moving_m_s + lidar_m_s))]))
    if not fastest_m_s < units.SPEED_OF_LIGHT_M_S:
        raise ScenarioError(
            f"world.light_time: '{name}' or the lidar moves at {fastest_m_s:.3g} m/s, not below the speed of light; correct "
            "its motion, or leave light_time out"
        )
    outward_s = flight_time_s(place_m, moving_m_s + lidar_m_s)
    met_m = place_m + moving_m_s * outward_s[..., None]
    back_s = flight_time_s(met_m, -lidar_m_s)
    distance_m = length(met_m)
    path_m = 0.5 * units.SPEED_OF_LIGHT_M_S * (outward_s + back_s)
    seen_m = met_m * np.where(distance_m > 0.0, path_m / np.where(distance_m > 0.0, distance_m, 1.0), 1.0)[..., None]
    turned_back = matrix_from_vector(-lidar_rad_s * (outward_s + back_s)[..., None])
    matrix = np.matmul(turned_back, np.matmul(here.matrix, matrix_from_vector(turning_rad_s * outward_s[..., None])))
    return Link((rotate_vectors(turned_back, seen_m), matrix), here.velocity_m_s, here.angular_velocity_rad_s)


def flight_time_s(place_m: np.ndarray, velocity_m_s: np.ndarray) -> np.ndarray:
    """Return the time (…) [s] that light takes to a point in uniform motion: the positive root of |p + v τ| = c τ.

    >>> flight_time_s(np.array([0.0, 0.0, 299_792_458.0]), np.array([0.0, 0.0, -299_792_458.0 / 3.0])).round(12).item()
    0.75

    Parameters
    ----------
    place_m : (…, 3) where the point is as the light leaves, from there [m]
    velocity_m_s : (…, 3) of the point, slower than light [m/s]
    """
    along = dot(place_m, velocity_m_s)
    slower = units.SPEED_OF_LIGHT_M_S**2 - dot(velocity_m_s, velocity_m_s)
    time_s: np.ndarray = (along + np.sqrt(along * along + slower * dot(place_m, place_m))) / slower
    return time_s
