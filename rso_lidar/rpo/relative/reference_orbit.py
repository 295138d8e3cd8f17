"""The orbit about which a relative motion is integrated: the chief's, from its state at the start under forces."""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from typing import Self

import numpy as np

from rso_lidar.errors import PropagationError
from rso_lidar.orbit import (
    EARTH,
    Burn,
    Epochs,
    Forces,
    Impulse,
    IntegratedOrbit,
    Trajectory,
    find_center,
    integrate_orbit,
    propagate_two_body,
    rtn_matrix,
    state_rates,
)
from rso_lidar.pose import cross, rotate_vectors
from rso_lidar.records import BodyState
from rso_lidar.rpo.relative.hill import find_start_state

Vector3 = tuple[float, float, float]
_STEP_S = 2.0  # of differences of velocity


@dataclass(frozen=True)
class ReferenceOrbit:
    """The chief's orbit, propagated under forces from a state.

    Parameters
    ----------
    start_utc : start of the run
    position_m, velocity_m_s : (3,) state of the chief about its central body at `begin_s`, in GCRS axes [m], [m/s]
    forces : forces on it; None for two-body motion
    maneuvers : impulses and burns of the chief itself
    begin_s : time of the state, since `start_utc` [s]
    gm_m3_s2 : gravitational parameter of the central body [m3/s2]; with forces, the Earth's
    """

    start_utc: datetime.datetime
    position_m: Vector3
    velocity_m_s: Vector3
    forces: Forces | None
    maneuvers: tuple[Impulse | Burn, ...] = ()
    begin_s: float = 0.0
    gm_m3_s2: float = EARTH.gm_m3_s2

    @classmethod
    def from_chief(
        cls,
        chief: Trajectory,
        start_utc: datetime.datetime,
        forces: Forces | None,
        maneuvers: tuple[Impulse | Burn, ...] = (),
    ) -> Self:
        """Return the orbit from the osculating state of a chief at the start.

        Parameters
        ----------
        chief : trajectory of the chief
        start_utc : start of the run
        forces : forces on it; None for two-body motion
        maneuvers : its impulses and burns
        """
        position, velocity = (tuple(vector.tolist()) for vector in find_start_state(chief, start_utc))
        return cls(start_utc, position, velocity, forces, maneuvers, gm_m3_s2=find_center(chief).gm_m3_s2)

    @property
    def orbit(self) -> IntegratedOrbit:
        """Integrated orbit; there must be forces."""
        assert self.forces is not None
        place = np.array(self.position_m), np.array(self.velocity_m_s)
        return integrate_orbit(*place, self.start_utc, self.forces, self.maneuvers, begin_s=self.begin_s)

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes."""
        if self.forces is None:
            start = np.array(self.position_m), np.array(self.velocity_m_s)
            return BodyState(*propagate_two_body(*start, epochs.time_s - self.begin_s, self.gm_m3_s2))
        rows = self.orbit(epochs.time_s)
        return BodyState(rows[:, :3], rows[:, 3:])

    def breaks_s(self, epochs: Epochs) -> np.ndarray:
        """Return the times (break,) since `start_utc` [s] at which the chief's own maneuvers begin, end or change.

        Parameters
        ----------
        epochs : not used
        """
        return np.array([edge_s for maneuver in self.maneuvers for edge_s in maneuver.edges_s])

    def express(self, body: BodyState, epochs: Epochs) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (time, 3) of a body in the rotating rtn axes of this orbit.

        Parameters
        ----------
        body : inertial states (time, 3)
        epochs : instants
        """
        chief = self.states(epochs)
        return find_relative_state(chief, body, self._rates(epochs, chief))

    def place(self, position_m: np.ndarray, velocity_m_s: np.ndarray, at_s: float = 0.0) -> BodyState:
        """Return the inertial state (3,) of a body from a relative state.

        Parameters
        ----------
        position_m, velocity_m_s : (3,) in the rotating rtn axes of this orbit [m], [m/s]
        at_s : instant since the start of the run [s]
        """
        at = Epochs(self.start_utc, np.array([at_s]))
        chief = self.states(at)
        placed = add_relative_state(chief, np.asarray(position_m), np.asarray(velocity_m_s), self._rates(at, chief))
        return BodyState(placed.position_m[0], placed.velocity_m_s[0])

    def _rates(self, epochs: Epochs, chief: BodyState) -> tuple[np.ndarray, np.ndarray] | None:
        """Return the derivatives of the chief's states [m/s], [m/s2] (time, 3); None if its orbital plane is fixed.

        Differences of fourth order: those of second order would be off by 1e-5 of the rotation of the plane, which grows
        to some millimetres in two revolutions, 10 km away.
        """
        if self.forces is None:
            return None
        times, breaks = epochs.time_s, self.breaks_s(epochs)
        smooth = np.all(np.abs(np.subtract.outer(times, breaks)) > 2.0 * _STEP_S, axis=1)
        acceleration = np.empty((len(times), 3))
        try:
            around = np.add.outer(_STEP_S * np.array([-2.0, -1.0, 1.0, 2.0]), times[smooth])
            v = self.orbit(around.ravel())[:, 3:].reshape(4, -1, 3)
            acceleration[smooth] = (v[0] - 8.0 * v[1] + 8.0 * v[2] - v[3]) / (12.0 * _STEP_S)
        except PropagationError:  # it falls just after an epoch
            smooth[:] = False
        if not smooth.all():
            rest = BodyState(chief.position_m[~smooth], chief.velocity_m_s[~smooth])
            acceleration[~smooth] = state_rates(self, Epochs(self.start_utc, times[~smooth]), rest)[1]
        return chief.velocity_m_s, acceleration


def find_relative_state(
    chief: BodyState, body: BodyState, rates: tuple[np.ndarray, np.ndarray] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return position [m] and velocity [m/s] (…, 3) of a body in a chief's rotating rtn axes.

    The velocity contains the transport term, -omega x rho. Differences of inertial coordinates are good to 1e-8 m.

    Parameters
    ----------
    chief, body : inertial states (…, 3)
    rates : derivatives of the chief's state, see `rtn_axes`; without them its orbital plane is fixed
    """
    axes, omega = rtn_matrix(chief.position_m, chief.velocity_m_s, rates)
    back = np.swapaxes(axes, -1, -2)
    position = rotate_vectors(back, body.position_m - chief.position_m)
    return position, rotate_vectors(back, body.velocity_m_s - chief.velocity_m_s) - cross(omega, position)


def add_relative_state(
    chief: BodyState,
    position_m: np.ndarray,
    velocity_m_s: np.ndarray,
    rates: tuple[np.ndarray, np.ndarray] | None = None,
) -> BodyState:
    """Return the inertial state of a body from one in a chief's rotating rtn axes; the inverse of `find_relative_state`."""
    axes, omega = rtn_matrix(chief.position_m, chief.velocity_m_s, rates)
    return BodyState(
        chief.position_m + rotate_vectors(axes, position_m),
        chief.velocity_m_s + rotate_vectors(axes, velocity_m_s + cross(omega, position_m)),
    )
