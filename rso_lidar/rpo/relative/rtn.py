"""The rotating rtn axes of an orbit: x radially outward, z along r x v, y = z x x (along-track)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rso_lidar import units
from rso_lidar.pose import cross, dot, rotate_vectors
from rso_lidar.records import BodyState

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

GM = units.EARTH_GM_M3_S2


def rtn_axes(
    position_m: np.ndarray, velocity_m_s: np.ndarray, rates: tuple[np.ndarray, np.ndarray] | None = None
) -> tuple[Rotation, np.ndarray]:
    """Return the rotation inertial_from_rtn of inertial states, and its angular velocity.

    For two-body motion the angular velocity is r x v / |r|^2, along z. An acceleration a out of the plane turns the
    plane about the radius by omega_x = |r| (a . z) / |r x v|. In low orbit J2 makes that up to 2e-6 rad/s, which moves
    the rtn axes by 2 mm/s a kilometre away.

    Parameters
    ----------
    position_m, velocity_m_s : (…, 3) inertial state [m], [m/s]
    rates : derivatives of position and velocity (…, 3) [m/s], [m/s2], see `orbit.trajectory.state_rates`; without them
        the orbital plane is fixed

    Returns
    -------
    inertial_from_rtn : Rotation
    angular_velocity : (…, 3) [rad/s] in rtn axes
    """
    from scipy.spatial.transform import Rotation

    matrix, omega = rtn_matrix(position_m, velocity_m_s, rates)
    return Rotation.from_matrix(matrix, assume_valid=True), omega


def rtn_matrix(
    position_m: np.ndarray, velocity_m_s: np.ndarray, rates: tuple[np.ndarray, np.ndarray] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return inertial_from_rtn as matrices, and its angular velocity, as `rtn_axes` does.

    Parameters
    ----------
    position_m, velocity_m_s : (…, 3) inertial state [m], [m/s]
    rates : derivatives of position and velocity (…, 3) [m/s], [m/s2]; without them the orbital plane is fixed

    Returns
    -------
    inertial_from_rtn : (…, 3, 3)
    angular_velocity : (…, 3) [rad/s] in rtn axes
    """
    r, v = np.asarray(position_m, dtype=float), np.asarray(velocity_m_s, dtype=float)
    h = cross(r, v)
    radius, momentum = np.sqrt(dot(r, r)), np.sqrt(dot(h, h))
    x, z = r / radius[..., None], h / momentum[..., None]
    y = cross(z, x)
    omega = np.zeros_like(r)
    if rates is None:
        omega[..., 2] = momentum / radius**2
    else:  # the velocity of a model need not be the derivative of its position, so every axis is differentiated
        change = cross(rates[0], v) + cross(r, rates[1])
        omega[..., 0] = -dot(y, change) / momentum
        omega[..., 1] = -dot(z, rates[0]) / radius
        omega[..., 2] = dot(y, rates[0]) / radius
    return np.stack([x, y, z], axis=-1), omega


def inertial_acceleration(
    chief: BodyState,
    inertial_from_rtn: np.ndarray,
    turning_rad_s: np.ndarray,
    relative: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> np.ndarray:
    """Return the inertial acceleration (time, 3) [m/s2] of a body from its motion in a chief's rotating rtn axes.

    It is the chief's acceleration plus rho'' + 2 omega x rho' + omega' x rho + omega x (omega x rho). That of the chief
    is the Earth's point-mass gravity and what turns its plane, omega_x |r x v| / |r| along z. In low orbit this leaves
    out 0.02 m/s2 of perturbation in the plane, and 4e-9 rad/s2 of a change of the plane's rate. For the plane of the
    body they are below 1e-9 rad/s for each kilometre between the two.

    Parameters
    ----------
    chief : its inertial states (time)
    inertial_from_rtn : (time, 3, 3) its axes
    turning_rad_s : (time, 3) their angular velocity omega, in those axes
    relative : rho [m], rho' [m/s] and rho'' [m/s2], each (time, 3), in those axes
    """
    rho, rho_rate, faster = relative
    r, v = chief.position_m, chief.velocity_m_s
    radius = np.sqrt(dot(r, r))
    momentum = dot(inertial_from_rtn[..., 2], cross(r, v))
    own = np.zeros_like(turning_rad_s)
    own[..., 0], own[..., 2] = -GM / radius**2, turning_rad_s[..., 0] * momentum / radius
    change = np.zeros_like(turning_rad_s)  # omega_z = |r x v| / r^2
    change[..., 2] = -2.0 * turning_rad_s[..., 2] * dot(r, v) / radius**2
    around = cross(turning_rad_s, cross(turning_rad_s, rho)) + 2.0 * cross(turning_rad_s, rho_rate)
    return rotate_vectors(inertial_from_rtn, own + faster + around + cross(change, rho))
