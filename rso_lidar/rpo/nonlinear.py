"""Relative motion without approximation: two orbits under the same forces, and their difference in turning rtn axes."""

from __future__ import annotations

from typing import Literal

import numpy as np

from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.forces import Forces
from rso_lidar.orbit.kepler import propagate
from rso_lidar.orbit.numerical import solution
from rso_lidar.orbit.trajectory import Trajectory
from rso_lidar.records import BodyState
from rso_lidar.rpo.hill import flattening, state_at_start
from rso_lidar.rpo.relative import RelativeState


class Nonlinear(RelativeState):
    """The difference of two orbits: the chief's, from its osculating state at `start_utc`, and the body's beside it.

    Both are propagated under the same `forces`, or as two bodies without them, and differenced in the rtn axes of the chief
    so propagated, not of its own model (a TLE); that difference then stands in the chief's real axes. Exact for any
    separation and eccentricity but for what the forces leave out: both feel the same drag and light pressure per mass.
    """

    type: Literal["nonlinear"] = "nonlinear"
    forces: Forces | None = None

    def relative(self, epochs: Epochs, chief: Trajectory) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (time, 3) in the chief's rtn axes, the velocity as those axes see it."""
        start = BodyState(*state_at_start(chief, epochs.start_utc))
        body = beside(start, np.array(self.position_m), np.array(self.velocity_m_s))
        return rtn_difference(*(self._flown(state, epochs) for state in (start, body)))

    def _flown(self, start: BodyState, epochs: Epochs) -> BodyState:
        if self.forces is None:
            return BodyState(*propagate(start.position_m, start.velocity_m_s, epochs.time_s))
        rows = solution(start.position_m, start.velocity_m_s, epochs.start_utc, self.forces)(epochs.time_s)
        return BodyState(rows[:, :3], rows[:, 3:6])

    def validity(self, epochs: Epochs, chief: Trajectory) -> list[str]:
        """Return one sentence for each way in which the model is stretched at these epochs, naming the better one."""
        if self.forces is not None:
            return []
        return flattening("nonlinear", epochs, *state_at_start(chief, epochs.start_utc), better="give it forces")


def rtn_difference(chief: BodyState, body: BodyState) -> tuple[np.ndarray, np.ndarray]:
    """Return position [m] and velocity [m/s] (…, 3) of a body in a chief's rtn axes, the velocity as those axes see it.

    What the axes' turning takes off, omega x rho, is in it; differences of inertial coordinates are good to 1e-8 m.
    """
    axes, omega = _rtn(chief)
    apart, drift = body.position_m - chief.position_m, body.velocity_m_s - chief.velocity_m_s
    position = np.stack([_dot(apart, axis) for axis in axes], axis=-1)
    velocity = np.stack([_dot(drift, axis) for axis in axes], axis=-1)
    velocity[..., 0] += omega * position[..., 1]
    velocity[..., 1] -= omega * position[..., 0]
    return position, velocity


def beside(chief: BodyState, position_m: np.ndarray, velocity_m_s: np.ndarray) -> BodyState:
    """Return the inertial state of a body at a position and with a velocity (…, 3) in a chief's rtn axes."""
    axes, omega = _rtn(chief)
    x, y, _ = (position_m[..., k] for k in range(3))
    seen = np.stack([velocity_m_s[..., 0] - omega * y, velocity_m_s[..., 1] + omega * x, velocity_m_s[..., 2]], axis=-1)
    apart, drift = (sum(vector[..., k, None] * axes[k] for k in range(3)) for vector in (position_m, seen))
    return BodyState(chief.position_m + apart, chief.velocity_m_s + drift)


def _rtn(chief: BodyState) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
    """Return the rtn axes of states (…, 3) as unit vectors, and the rate [rad/s] at which they turn about the third."""
    r, momentum = chief.position_m, np.cross(chief.position_m, chief.velocity_m_s)
    radius, length = np.sqrt(_dot(r, r)), np.sqrt(_dot(momentum, momentum))
    x, z = r / radius[..., None], momentum / length[..., None]
    return (x, np.cross(z, x), z), length / radius**2


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a . b (…), term by term: library sums give an epoch other bits alone than among many."""
    product: np.ndarray = np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])
    return product
