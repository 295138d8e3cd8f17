"""Relative motion without approximation: the difference of two orbits under the same forces, in rotating rtn axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import Field

from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.propagation.forces import Forces
from rso_lidar.orbit.propagation.numerical import integrate_orbit
from rso_lidar.orbit.trajectory import Trajectory, state_rates
from rso_lidar.orbit.two_body.kepler import propagate_two_body
from rso_lidar.pose import cross, rotate_vectors
from rso_lidar.records import BodyState
from rso_lidar.rpo.relative.hill import describe_flattening, find_start_state
from rso_lidar.rpo.relative.relative_motion import RelativeState
from rso_lidar.rpo.relative.rtn import rtn_matrix


class Nonlinear(RelativeState):
    """The difference of two orbits: the chief's, from its osculating state at `start_utc`, and the body's beside it.

    Both are propagated under the same `forces`, or by two-body motion without them. Their difference is taken in the
    rtn axes of the chief thus propagated, not of its model (a TLE). It is then applied in the chief's actual axes. It
    is exact for any separation and eccentricity, except for forces left out. Both bodies have the same drag and light
    pressure per mass.
    """

    type: Literal["nonlinear"] = "nonlinear"
    forces: Forces | None = Field(
        default=None, description="Forces on both bodies, equal per mass. If omitted, two-body motion."
    )

    def relative(self, epochs: Epochs, chief: Trajectory) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (time, 3) in the chief's rotating rtn axes.

        Parameters
        ----------
        epochs : instants
        chief : trajectory of the chief
        """
        start = BodyState(*find_start_state(chief, epochs.start_utc))
        first = Epochs(epochs.start_utc, np.zeros(1))
        rates = self._rates(start, BodyState(start.position_m[None], start.velocity_m_s[None]), first)
        at_start = None if rates is None else (rates[0][0], rates[1][0])
        body = add_relative_state(start, np.array(self.position_m), np.array(self.velocity_m_s), at_start)
        flown = self._flown(start, epochs)
        return find_relative_state(flown, self._flown(body, epochs), self._rates(start, flown, epochs))

    def _rates(self, start: BodyState, flown: BodyState, epochs: Epochs) -> tuple[np.ndarray, np.ndarray] | None:
        """Return the derivatives of the chief's states under the forces; None if its orbital plane is fixed.

        Parameters
        ----------
        start : state of the chief at the start
        flown : states of the chief at the epochs (time, 3)
        epochs : instants

        Returns
        -------
        derivatives [m/s], [m/s2], each (time, 3)
        """
        if self.forces is None:
            return None
        return flown.velocity_m_s, state_rates(_PropagatedChief(self, start), epochs, flown)[1]

    def _flown(self, start: BodyState, epochs: Epochs) -> BodyState:
        if self.forces is None:
            return BodyState(*propagate_two_body(start.position_m, start.velocity_m_s, epochs.time_s))
        rows = integrate_orbit(start.position_m, start.velocity_m_s, epochs.start_utc, self.forces)(epochs.time_s)
        return BodyState(rows[:, :3], rows[:, 3:6])

    def validity(self, epochs: Epochs, chief: Trajectory) -> list[str]:
        """Return one sentence for each limit of the model that these epochs exceed, with a better choice.

        Parameters
        ----------
        epochs : instants
        chief : trajectory of the chief
        """
        if self.forces is not None:
            return []
        return describe_flattening(
            "nonlinear", epochs, *find_start_state(chief, epochs.start_utc), better="give it forces"
        )


@dataclass(frozen=True)
class _PropagatedChief:
    """The trajectory of a state at the start under the forces of a relative motion."""

    motion: Nonlinear
    start: BodyState

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes."""
        return self.motion._flown(self.start, epochs)


def find_relative_state(
    chief: BodyState, body: BodyState, rates: tuple[np.ndarray, np.ndarray] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the state of a body in a chief's rotating rtn axes.

    The velocity contains the transport term, -omega x rho. Differences of inertial coordinates are good to 1e-8 m.

    Parameters
    ----------
    chief, body : inertial states (…, 3)
    rates : derivatives of the chief's state, see `rtn_axes`; without them its orbital plane is fixed

    Returns
    -------
    position_m, velocity_m_s : (…, 3) [m], [m/s]
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
    """Return the inertial state of a body at a state in a chief's rotating rtn axes; the inverse of `find_relative_state`.

    Parameters
    ----------
    chief : inertial state (…, 3)
    position_m, velocity_m_s : (…, 3) in the chief's rtn axes [m], [m/s]
    rates : derivatives of the chief's state, see `rtn_axes`; without them its orbital plane is fixed
    """
    axes, omega = rtn_matrix(chief.position_m, chief.velocity_m_s, rates)
    return BodyState(
        chief.position_m + rotate_vectors(axes, position_m),
        chief.velocity_m_s + rotate_vectors(axes, velocity_m_s + cross(omega, position_m)),
    )
