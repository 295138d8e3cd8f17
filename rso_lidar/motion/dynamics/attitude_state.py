"""Attitudes as entries of a state: a quaternion, or Euler angles with their singularities."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import AfterValidator

from rso_lidar import units
from rso_lidar.errors import PropagationError, warn
from rso_lidar.part import UNIT_NORM_WITHIN, Text
from rso_lidar.pose import matrix_from_quaternion

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


QUATERNION = "quaternion_xyzw"
NEAR_RAD = 1.0 * units.DEG  # within this of the singularity, the rates of two angles exceed 57 times the body rate
SINGULAR_RAD = 1e-6


def _check_attitude_state(text: str) -> str:
    """Check the name of an attitude representation and return it."""
    match = re.fullmatch(r"euler_([xyz])([xyz])([xyz])_(?:rad|deg)", text)
    if text != QUATERNION and not (match and match[1] != match[2] != match[3]):
        raise ValueError(
            f"'{text}' names no attitude; write {QUATERNION}, or Euler angles with their order and unit such as "
            "euler_zyx_rad (intrinsic: about z, the new y, the new x)"
        )
    return text


AttitudeState = Annotated[Text, AfterValidator(_check_attitude_state)]


def count_entries(attitude_state: str) -> int:
    """Count the numbers that represent the attitude."""
    return 4 if attitude_state == QUATERNION else 3


def attitude_from_state(
    state: np.ndarray, attitude_state: str, label: str, time_s: np.ndarray
) -> tuple[Rotation, np.ndarray]:
    """Read attitudes and body rates from states.

    Parameters
    ----------
    state : rows (time, n) that begin with an attitude and the body rates
    time_s : instants (time) of the rows [s], for messages

    Returns
    -------
    axes_from_body (time), and the body rates (time, 3) [rad/s]

    Raises
    ------
    PropagationError
        If Euler angles are singular. Near a singularity there is a warning.
    """
    from scipy.spatial.transform import Rotation

    width = count_entries(attitude_state)
    numbers, rates = state[:, :width], state[:, width : width + 3]
    if attitude_state == QUATERNION:
        return Rotation.from_quat(numbers), rates
    order, angles = _read_angles(numbers, attitude_state)
    away = _distance_from_singular_rad(angles, order)
    near = int(np.argmin(away)) if len(away) else 0
    where = "a middle angle of +-90 deg" if len(set(order)) == 3 else "a middle angle of 0 or 180 deg"
    if (away < SINGULAR_RAD).any():
        raise PropagationError(
            f"{label}: its Euler angles are singular ({order}: {where}) at time_s = {time_s[near]:g}; use another order, or "
            f"attitude_state = {QUATERNION}",
            away < SINGULAR_RAD,
        )
    if (away < NEAR_RAD).any():
        warn(
            f"{label}: its Euler angles come within {away[near] / units.DEG:.2g} deg of their singularity "
            f"({order}: {where}) at time_s = {time_s[near]:g}, where they change fast; use another order, or "
            f"attitude_state = {QUATERNION}"
        )
    return Rotation.from_euler(order.upper(), angles), rates


def matrix_from_state(
    state: np.ndarray, attitude_state: str, label: str, time_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Read attitudes as matrices, and body rates, from states.

    Returns
    -------
    axes_from_body (time, 3, 3), and the body rates (time, 3) [rad/s]
    """
    if attitude_state == QUATERNION:
        return matrix_from_quaternion(state[:, :4]), state[:, 4:7]
    rotation, rates = attitude_from_state(state, attitude_state, label, time_s)
    return rotation.as_matrix(), rates


def _read_angles(numbers: np.ndarray, attitude_state: str) -> tuple[str, np.ndarray]:
    """Return the order of Euler angles, in lower case, and the angles (…, 3) [rad]."""
    _, order, unit = attitude_state.split("_")
    return order, numbers * (units.DEG if unit == "deg" else 1.0)


def _distance_from_singular_rad(angles: np.ndarray, order: str) -> np.ndarray:
    """Compute the distance (…) [rad] of the middle Euler angle from its singular value, for angles (…, 3) [rad]."""
    across = np.cos(angles[..., 1]) if len(set(order)) == 3 else np.sin(angles[..., 1])
    away: np.ndarray = np.abs(np.arcsin(np.clip(across, -1.0, 1.0)))
    return away


def check_attitude(state: tuple[float, ...], attitude_state: str) -> None:
    """Check that an initial state begins with a valid attitude."""
    numbers = state[: count_entries(attitude_state)]
    if attitude_state == QUATERNION:
        norm = float(np.linalg.norm(numbers))
        if abs(norm - 1.0) > UNIT_NORM_WITHIN:
            raise ValueError(f"initial_state: its quaternion x, y, z, w has the norm {norm:.6g}, not 1; divide by it")
        return
    order, angles = _read_angles(np.array(numbers), attitude_state)
    if _distance_from_singular_rad(angles, order) < SINGULAR_RAD:
        raise ValueError(
            f"initial_state: its Euler angles {order} begin where they are singular; use another order, or {QUATERNION}"
        )
