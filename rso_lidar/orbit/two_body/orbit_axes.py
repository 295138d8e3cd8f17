"""The rotating axes of an orbit: rtn, and those that other conventions make of it.

- `rtn`: x radially outward, z along r x v, y = z x x (along-track).
- `lvlh_ccsds`: z to nadir, y along -(r x v), x = y x z.
- `vnc`: x along the velocity, y along r x v, z = x x y (outward on a circle).
- `ntw`: y along the velocity, z along r x v, x = y x z (outward on a circle).
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Literal

import numpy as np

from rso_lidar.pose import cross, dot

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

OrbitAxes = Literal["rtn", "lvlh_ccsds", "vnc", "ntw"]


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
    return np.stack([cross(forward, normal), forward, normal], axis=-1)
