"""Relative motion near a circular orbit, by Clohessy and Wiltshire's closed form, and the rotating rtn axes it lives in.

rtn: x radially out, z along r x v, y = z x x (along-track); V-bar is +y, R-bar is -x. Equations: Clohessy & Wiltshire
(1960), as in Vallado 4th ed. alg. 48.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.part import Name, Part, Vector

FAR_M = 10_000.0
ECCENTRIC = 0.005


class Hill(Part):
    """Motion relative to the body `relative_to`: position and velocity in its rotating rtn axes, held at `start_utc`."""

    type: Literal["hill"] = "hill"
    relative_to: Name
    position_m: Vector
    velocity_m_s: Vector

    def relative(self, time_s: np.ndarray, mean_motion_rad_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (time, 3) in rtn axes, the velocity as those turning axes see it.

        `mean_motion_rad_s` is that of the body's osculating orbit at `start_utc`.

        >>> rest = Hill(relative_to="tdrs", position_m=(0.0, -3000.0, 0.0), velocity_m_s=(0.0, 0.0, 0.0))
        >>> rest.relative(np.array([3600.0]), 7.292e-5)[0].tolist()
        [[0.0, -3000.0, 0.0]]
        """
        return _clohessy_wiltshire(
            np.asarray(self.position_m),
            np.asarray(self.velocity_m_s),
            np.asarray(time_s, dtype=float),
            mean_motion_rad_s,
        )


def _clohessy_wiltshire(
    position_m: np.ndarray, velocity_m_s: np.ndarray, time_s: np.ndarray, mean_motion_rad_s: float
) -> tuple[np.ndarray, np.ndarray]:
    x0, y0, z0 = position_m
    u0, v0, w0 = velocity_m_s
    n, nt = mean_motion_rad_s, mean_motion_rad_s * time_s
    s, c = np.sin(nt), np.cos(nt)
    k = 2.0 * np.sin(0.5 * nt) ** 2  # 1 - c, without the cancellation
    position = (
        (1.0 + 3.0 * k) * x0 + (s * u0 + 2.0 * k * v0) / n,
        y0 + 6.0 * (s - nt) * x0 + ((4.0 * s - 3.0 * nt) * v0 - 2.0 * k * u0) / n,
        c * z0 + s * w0 / n,
    )
    velocity = (
        3.0 * n * s * x0 + c * u0 + 2.0 * s * v0,
        -6.0 * n * k * x0 - 2.0 * s * u0 + (1.0 - 4.0 * k) * v0,
        c * w0 - n * s * z0,
    )
    return np.stack(position, axis=-1), np.stack(velocity, axis=-1)


def two_impulse_hop(
    from_m: np.ndarray | Vector, to_m: np.ndarray | Vector, duration_s: float, mean_motion_rad_s: float
) -> np.ndarray:
    """Return the departure velocity (3) [m/s] that flies from one position [m] to another in `duration_s`, all rtn."""
    still, start = np.zeros(3), np.asarray(from_m, dtype=float)
    time_s = np.asarray(duration_s, dtype=float)
    coast, _ = _clohessy_wiltshire(start, still, time_s, mean_motion_rad_s)
    per_velocity_s = np.stack(
        [_clohessy_wiltshire(still, unit, time_s, mean_motion_rad_s)[0] for unit in np.eye(3)], axis=1
    )
    if duration_s <= 0.0 or np.linalg.cond(per_velocity_s) > 1e9:
        raise ScenarioError(
            f"hop: no departure velocity reaches the aim in {duration_s:g} s (zero, or whole half revolutions of the "
            "chief): change the duration"
        )
    velocity: np.ndarray = np.linalg.solve(per_velocity_s, np.asarray(to_m, dtype=float) - coast)
    return velocity


def validity(position_m: np.ndarray, chief_eccentricity: float) -> list[str]:
    """Return warnings where Clohessy-Wiltshire is stretched: rtn positions (…, 3) [m] far out, or a chief not circular."""
    farthest_m = float(np.linalg.norm(np.atleast_2d(position_m), axis=1).max(initial=0.0))
    sentences = []
    if farthest_m > FAR_M:
        sentences.append(
            f"hill: the separation reaches {farthest_m / units.KM:.1f} km; beyond {FAR_M / units.KM:g} km the error of "
            "Clohessy-Wiltshire, separation squared over orbit radius, matters: use two-body motions"
        )
    if chief_eccentricity > ECCENTRIC:
        sentences.append(
            f"hill: the chief's eccentricity is {chief_eccentricity:.4f}; above {ECCENTRIC:g} Clohessy-Wiltshire, which "
            "takes it as circular, is off by about separation times eccentricity: use two-body motions"
        )
    return sentences


def rtn_axes(position_m: np.ndarray, velocity_m_s: np.ndarray) -> tuple[Rotation, np.ndarray]:
    """Return inertial_from_rtn, and its angular velocity (…, 3) [rad/s] in rtn axes, of inertial states (…, 3).

    omega = r x v / |r|^2, which leaves out the slow turn of a perturbed orbit's plane.
    """
    r, v = np.asarray(position_m, dtype=float), np.asarray(velocity_m_s, dtype=float)
    h = np.cross(r, v)
    radius, momentum = np.linalg.norm(r, axis=-1), np.linalg.norm(h, axis=-1)
    x, z = r / radius[..., None], h / momentum[..., None]
    omega = np.zeros_like(r)
    omega[..., 2] = momentum / radius**2
    return Rotation.from_matrix(np.stack([x, np.cross(z, x), z], axis=-1)), omega
