"""An orbit that is known from an estimate: a state with its covariance, and the forces that propagate it."""

from __future__ import annotations

import datetime
from dataclasses import dataclass

import numpy as np

from rso_lidar.orbit import CovarianceHistory, Epochs, Forces, integrate_orbit, propagate_two_body
from rso_lidar.records import BodyState

# Steps of central differences [m], [m/s]. Curvature of a low orbit changes a derivative by (step / radius)^2, 1e-11.
STEPS = np.repeat([20.0, 0.02], 3)


@dataclass(frozen=True, eq=False)
class EstimatedOrbit:
    """State of a body at an epoch in GCRS axes, its covariance, and its forces. It is a trajectory.

    Parameters
    ----------
    start_utc : start of the run
    epoch_s : instant of the state, since `start_utc` [s]
    position_m, velocity_m_s : (3,) in GCRS axes [m], [m/s]
    covariance : (6, 6) of position and velocity [m²], [m²/s], [m²/s²]
    forces : on the body besides the central attraction; None for two-body motion
    """

    start_utc: datetime.datetime
    epoch_s: float
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    covariance: np.ndarray
    forces: Forces | None

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes."""
        later_s = float(Epochs(epochs.start_utc, np.zeros(1)).since(self.start_utc)[0])
        return propagate_state(self.vector, epochs.time_s + later_s, self.epoch_s, self.start_utc, self.forces)

    @property
    def vector(self) -> np.ndarray:
        """Position and velocity (6) [m], [m/s]."""
        return np.concatenate([self.position_m, self.velocity_m_s])

    def move_epoch(self, epoch_s: float) -> EstimatedOrbit:
        """Return the same orbit with its state and covariance at another instant.

        Parameters
        ----------
        epoch_s : instant since `start_utc` [s]
        """
        if epoch_s == self.epoch_s:
            return self
        there = propagate_state(self.vector, np.array([epoch_s]), self.epoch_s, self.start_utc, self.forces)
        onward = find_transition(self.vector, np.array([epoch_s - self.epoch_s]))[0]
        return EstimatedOrbit(
            self.start_utc,
            epoch_s,
            there.position_m[0],
            there.velocity_m_s[0],
            onward @ self.covariance @ onward.T,
            self.forces,
        )

    def covariances(self, epochs: Epochs | None = None, label: str = "follower") -> CovarianceHistory:
        """Return the covariance as a history, for `rl.orbit.write_oem` and searches of encounters.

        Away from the epoch of the estimate it is propagated by two-body motion, without process noise.

        Parameters
        ----------
        epochs : increasing instants (None: the epoch of the estimate)
        label : name of the body

        Returns
        -------
        CovarianceHistory
            about this orbit

        Raises
        ------
        ScenarioError
            if the epochs do not increase, or the covariance is not positive semidefinite
        """
        at = Epochs(self.start_utc, np.array([self.epoch_s]))
        known = CovarianceHistory(label, "fit", self, at, self.covariance[None])
        if epochs is None:
            return known
        return CovarianceHistory(label, "fit", self, epochs, known.at(epochs, beyond="two_body"))


def propagate_state(
    vector: np.ndarray, time_s: np.ndarray, epoch_s: float, start_utc: datetime.datetime, forces: Forces | None
) -> BodyState:
    """Propagate a state to instants (time), in GCRS axes.

    Parameters
    ----------
    vector : (6) position [m] and velocity [m/s] at `epoch_s` in GCRS axes
    time_s : (time) instants since `start_utc` [s]
    forces : besides the central attraction; None for two-body motion
    """
    if forces is None:
        return BodyState(*propagate_two_body(vector[:3], vector[3:], time_s - epoch_s))
    rows = integrate_orbit(vector[:3], vector[3:], start_utc, forces, begin_s=epoch_s)(time_s)
    return BodyState(rows[:, :3], rows[:, 3:])


def find_transition(vector: np.ndarray, since_s: np.ndarray) -> np.ndarray:
    """Return the transition matrices (time, 6, 6) of two-body motion; J2 changes them by a thousandth.

    Parameters
    ----------
    vector : (6) state at the epoch
    since_s : (time) time since then [s]
    """
    columns = []
    for k, step in enumerate(STEPS):
        shift = np.zeros(6)
        shift[k] = step
        ahead, behind = (
            np.concatenate(propagate_two_body(there[:3], there[3:], since_s), axis=1)
            for there in (vector + shift, vector - shift)
        )
        columns.append((ahead - behind) / (2.0 * step))
    return np.stack(columns, axis=-1)
