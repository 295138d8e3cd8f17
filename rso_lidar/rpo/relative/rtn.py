"""The acceleration of a body that moves in the rotating rtn axes of a chief."""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.orbit import rtn_axes, rtn_matrix
from rso_lidar.pose import cross, dot, rotate_vectors
from rso_lidar.records import BodyState

__all__ = ["inertial_acceleration", "rtn_axes", "rtn_matrix"]


def inertial_acceleration(
    chief: BodyState,
    inertial_from_rtn: np.ndarray,
    turning_rad_s: np.ndarray,
    relative: tuple[np.ndarray, np.ndarray, np.ndarray],
    gm_m3_s2: float = units.EARTH_GM_M3_S2,
) -> np.ndarray:
    """Return the inertial acceleration (time, 3) [m/s2] of a body from its motion in a chief's rotating rtn axes.

    It is the chief's acceleration plus rho'' + 2 omega x rho' + omega' x rho + omega x (omega x rho). That of the chief
    is its central body's point-mass gravity and what turns its plane, omega_x |r x v| / |r| along z. In low orbit this
    leaves out 0.02 m/s2 of perturbation in the plane, and 4e-9 rad/s2 of a change of the plane's rate. For the plane of the
    body they are below 1e-9 rad/s for each kilometre between the two.

    Parameters
    ----------
    chief : its inertial states (time) about its central body
    inertial_from_rtn : (time, 3, 3) its axes
    turning_rad_s : (time, 3) their angular velocity omega, in those axes
    relative : rho [m], rho' [m/s] and rho'' [m/s2], each (time, 3), in those axes
    gm_m3_s2 : gravitational parameter of that body [m3/s2], by default the Earth's
    """
    rho, rho_rate, faster = relative
    r, v = chief.position_m, chief.velocity_m_s
    radius = np.sqrt(dot(r, r))
    momentum = dot(inertial_from_rtn[..., 2], cross(r, v))
    own = np.zeros_like(turning_rad_s)
    own[..., 0], own[..., 2] = -gm_m3_s2 / radius**2, turning_rad_s[..., 0] * momentum / radius
    change = np.zeros_like(turning_rad_s)  # omega_z = |r x v| / r^2
    change[..., 2] = -2.0 * turning_rad_s[..., 2] * dot(r, v) / radius**2
    around = cross(turning_rad_s, cross(turning_rad_s, rho)) + 2.0 * cross(turning_rad_s, rho_rate)
    return rotate_vectors(inertial_from_rtn, own + faster + around + cross(change, rho))
