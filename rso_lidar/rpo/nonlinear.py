"""Relative motion without approximation: two orbits under the same forces, and their difference in turning rtn axes."""

from __future__ import annotations

from typing import Literal

import numpy as np

from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.forces import Forces
from rso_lidar.orbit.kepler import propagate
from rso_lidar.orbit.numerical import solution
from rso_lidar.orbit.trajectory import Trajectory
from rso_lidar.pose import cross, turned
from rso_lidar.records import BodyState
from rso_lidar.rpo.hill import flattening, rtn_matrix, state_at_start
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
    axes, omega = rtn_matrix(chief.position_m, chief.velocity_m_s)
    back = np.swapaxes(axes, -1, -2)
    position = turned(back, body.position_m - chief.position_m)
    return position, turned(back, body.velocity_m_s - chief.velocity_m_s) - cross(omega, position)


def beside(chief: BodyState, position_m: np.ndarray, velocity_m_s: np.ndarray) -> BodyState:
    """Return the inertial state of a body at a position and with a velocity (…, 3) in a chief's rtn axes."""
    axes, omega = rtn_matrix(chief.position_m, chief.velocity_m_s)
    return BodyState(
        chief.position_m + turned(axes, position_m),
        chief.velocity_m_s + turned(axes, velocity_m_s + cross(omega, position_m)),
    )
