"""The axes of an orbit, rtn and those that other conventions make of it, and states in them.

A velocity is relative to the inertial axes and only given along those of the orbit, or relative to the rotating ones: then
inertial v = R (v' + omega x r'). The matrices (6, 6) here are the derivatives of one by the other, as covariances need them.

- `rtn`: x radially outward, z along r x v, y = z x x (along-track).
- `lvlh_ccsds`: z to nadir, y along -(r x v), x = y x z.
- `vnc`: x along the velocity, y along r x v, z = x x y (outward on a circle).
- `ntw`: y along the velocity, z along r x v, x = y x z (outward on a circle).
- `tnw`: x along the velocity, z along r x v, y = z x x (inward on a circle; CCSDS 502.0-B-3, 3.2.4.11).
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.pose import cross, dot, skew

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

OrbitAxes = Literal["rtn", "lvlh_ccsds", "vnc", "ntw", "tnw"]
ORBIT_AXES: tuple[OrbitAxes, ...] = get_args(OrbitAxes)


_LEAST_SINE = 1e-9  # of the angle between position and velocity; below it, rounding decides on the plane


def has_plane(position_m: np.ndarray, velocity_m_s: np.ndarray) -> np.ndarray:
    """Return whether a velocity has a part across the position (…), so that the orbit has a plane and axes.

    Parameters
    ----------
    position_m, velocity_m_s : (…, 3) inertial state [m, m/s]

    Returns
    -------
    numpy.ndarray
        (…) bool.
    """
    across, place, speed = (
        np.linalg.norm(rows, axis=-1) for rows in (np.cross(position_m, velocity_m_s), position_m, velocity_m_s)
    )
    planar: np.ndarray = across > _LEAST_SINE * place * speed
    return planar


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


@cache
def rtn_from_lvlh_ccsds() -> Rotation:
    """Return the rotation from `lvlh_ccsds` axes to rtn: z (nadir) is rtn -x, y is rtn -z, and x is rtn +y."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def orbit_axes_matrix(axes: OrbitAxes, position_m: np.ndarray, velocity_m_s: np.ndarray) -> np.ndarray:
    """Return inertial_from_axes (…, 3, 3) of orbital axes, from inertial states (…, 3)."""
    check_axes(axes, ORBIT_AXES)
    inertial_from_rtn, _ = rtn_matrix(position_m, velocity_m_s)
    radial, along, normal = np.moveaxis(inertial_from_rtn, -1, 0)
    if axes == "rtn":
        return inertial_from_rtn
    if axes == "lvlh_ccsds":
        return np.stack([along, -normal, -radial], axis=-1)
    velocity = np.asarray(velocity_m_s, dtype=float)
    forward = velocity / np.sqrt(dot(velocity, velocity))[..., None]
    if axes == "vnc":
        return np.stack([forward, normal, cross(forward, normal)], axis=-1)
    outward = cross(forward, normal)
    return np.stack([forward, -outward, normal] if axes == "tnw" else [outward, forward, normal], axis=-1)


def orbit_axes_rate(axes: OrbitAxes, position_m: np.ndarray, velocity_m_s: np.ndarray) -> np.ndarray:
    """Return the angular velocity (…, 3) [rad/s] of orbital axes by two-body motion, in those axes.

    The plane does not turn. The radius turns by |r x v| / |r|^2, and the velocity by |v x a| / |v|^2 with a = -GM r / |r|^3.
    """
    r, v = np.asarray(position_m, dtype=float), np.asarray(velocity_m_s, dtype=float)
    h = cross(r, v)
    momentum, square = np.sqrt(dot(h, h)), dot(r, r)
    along_radius = axes == "rtn" or axes == "lvlh_ccsds"
    rate = momentum / square if along_radius else units.EARTH_GM_M3_S2 * momentum / (square**1.5 * dot(v, v))
    omega = np.zeros_like(r)
    if axes == "lvlh_ccsds":  # y is against r x v
        omega[..., 1] = -rate
    else:
        omega[..., 1 if axes == "vnc" else 2] = rate
    return omega


def state_matrix(inertial_from_axes: np.ndarray, turn_rad_s: np.ndarray | None = None) -> np.ndarray:
    """Return the matrix that takes positions and velocities in axes to those in inertial axes.

    Parameters
    ----------
    inertial_from_axes : (…, 3, 3) rotation
    turn_rad_s : (…, 3) angular velocity of the axes, in those axes, to which velocities are relative [rad/s]; None for
        velocities relative to inertial axes, given along these

    Returns
    -------
    (…, 6, 6)
        a covariance turns as M P M^T
    """
    matrix = np.zeros((*inertial_from_axes.shape[:-2], 6, 6))
    matrix[..., :3, :3] = matrix[..., 3:, 3:] = inertial_from_axes
    if turn_rad_s is not None:
        matrix[..., 3:, :3] = inertial_from_axes @ skew(turn_rad_s)
    return matrix


def invert_state_matrix(matrix: np.ndarray) -> np.ndarray:
    """Return the inverse of matrices (…, 6, 6) of `state_matrix`, which take inertial states to those in axes.

    Parameters
    ----------
    matrix : (…, 6, 6)

    Returns
    -------
    (…, 6, 6)
    """
    back = np.swapaxes(matrix[..., :3, :3], -1, -2)
    inverse = state_matrix(back)
    inverse[..., 3:, :3] = -back @ matrix[..., 3:, :3] @ back
    return inverse


def orbit_state_matrix(
    axes: OrbitAxes, position_m: np.ndarray, velocity_m_s: np.ndarray, *, rotating: bool = False
) -> np.ndarray:
    """Return the matrix that takes positions and velocities along orbital axes to those in inertial axes.

    Parameters
    ----------
    axes : "rtn", "lvlh_ccsds", "vnc", "ntw" or "tnw"
    position_m, velocity_m_s : (…, 3) inertial state of the orbit [m], [m/s]
    rotating : whether velocities are relative to the axes as they turn by two-body motion, rather than to inertial axes

    Returns
    -------
    (…, 6, 6)

    Raises
    ------
    ScenarioError
        if the name is unknown
    """
    turn = orbit_axes_rate(axes, position_m, velocity_m_s) if rotating else None
    return state_matrix(orbit_axes_matrix(axes, position_m, velocity_m_s), turn)


def check_axes(axes: str, known: tuple[str, ...]) -> None:
    """Check that axes have a known name, and raise `ScenarioError` if not."""
    if axes in known:
        return
    if axes in ("lvlh", "LVLH"):
        raise ScenarioError("axes: 'lvlh' means two things; write 'rtn' (x outward) or 'lvlh_ccsds' (z to nadir)")
    raise ScenarioError(f"axes: '{axes}' are unknown{did_you_mean(str(axes), known)} (known: {', '.join(known)})")
