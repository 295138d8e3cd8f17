"""The rtn axes at a body's origin, from its inertial state or its motion relative to a chief, and where they jump."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from rso_lidar.motion.bodies.body import Body
from rso_lidar.motion.motions.motion import get_chief_name
from rso_lidar.motion.motions.placement import Place
from rso_lidar.orbit import (
    CentralBody,
    Epochs,
    Trajectory,
    find_breaks_s,
    find_center,
    find_center_states,
    moon_position_m,
    state_rates,
    subtract_center,
    two_body_rates,
)
from rso_lidar.pose import Link, cross, dot, rotate_vectors
from rso_lidar.records import BodyState
from rso_lidar.rpo import RtnMotion, rtn_matrix


def link_orbit(motion: Any, epochs: Epochs, place: Place, center: BodyState | None, *, turns: bool) -> Link:
    """Return the link from the root to the rtn axes of a body about a centre; None for the Earth, the origin."""
    state = BodyState(place.position_m, place.velocity_m_s)
    if center is not None:  # two-body motion about the Moon: the derivatives are exact
        about = subtract_center(state, center)
        rates = two_body_rates(about, find_center(motion).gm_m3_s2)
        matrix, turning = rtn_matrix(about.position_m, about.velocity_m_s, rates)
        return Link((state.position_m, matrix), state.velocity_m_s, turning)
    rates = place.rates or (state_rates(motion, epochs, state) if turns else two_body_rates(state))
    matrix, turning = rtn_matrix(state.position_m, state.velocity_m_s, rates)
    return Link((state.position_m, matrix), rates[0], turning)


def find_turning_rad_s(
    state: BodyState, place: Place, there: Link, chief: BodyState, center: BodyState | None, central_body: CentralBody
) -> np.ndarray:
    """Return the angular velocity (time, 3) [rad/s] of the rtn axes of a body whose relative acceleration is known.

    Parameters
    ----------
    place : motion in the chief's rtn axes, with its rates
    there : link from the root to these axes
    center, central_body : state of that centre, None for the Earth, and the body itself
    """
    assert place.rates is not None
    rho, (moved_m_s, faster) = place.position_m, place.rates
    around = there.angular_velocity_rad_s
    acceleration = _inertial_acceleration(chief, there.matrix, around, (rho, moved_m_s, faster), central_body.gm_m3_s2)
    change = there.velocity_m_s + rotate_vectors(there.matrix, moved_m_s + cross(around, rho))
    if center is not None:
        change = change - center.velocity_m_s
    turning: np.ndarray = rtn_matrix(state.position_m, state.velocity_m_s, (change, acceleration))[1]
    return turning


def _inertial_acceleration(
    chief: BodyState,
    inertial_from_rtn: np.ndarray,
    turning_rad_s: np.ndarray,
    relative: tuple[np.ndarray, np.ndarray, np.ndarray],
    gm_m3_s2: float,
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
    gm_m3_s2 : gravitational parameter of that body [m3/s2]
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


def list_breaks_s(
    bodies: Sequence[Body], epochs: Epochs, make_chief: Callable[[Sequence[Body], str], Trajectory]
) -> np.ndarray:
    """Return the instants [s] at which the states of some bodies in orbit have a jump or a corner."""
    breaks = [np.empty(0)]
    for motion in (body.motion for body in bodies):
        if isinstance(motion, RtnMotion):
            breaks.append(motion.breaks_s(epochs, make_chief(bodies, str(get_chief_name(motion)))))
        else:
            breaks.append(find_breaks_s(motion, epochs))
    return np.concatenate(breaks)


def find_moon_m(bodies: Sequence[Body], epochs: Epochs) -> np.ndarray:
    """Return the position (time, 3) [m] of the Moon in root axes.

    It is that of the kernel by which bodies orbit about the Moon, and else the built-in series, which is up to 32 km off.

    Parameters
    ----------
    bodies : all bodies
    epochs : instants
    """
    for body in bodies:
        if (center := find_center_states(body.motion, epochs)) is not None:
            return center.position_m
    return moon_position_m(epochs)
