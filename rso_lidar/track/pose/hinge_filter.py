"""Angles and rates of hinges from cloud to cloud: a Kalman filter of each hinge."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rso_lidar.track.pose.icp import UNKNOWN_ANGLE_RAD

# An array that follows the Sun turns once in an orbit: in the 90 minutes of a low one, by 0.067 deg/s.
_RATE_RAD_S = 2.0 * np.pi / 5400.0
# Root of the spectral density of white angular acceleration: over a quarter of that orbit, 1 sigma of the change of the rate
# equals the rate. Assumed.
_ACCELERATION_RAD_S2_SQRT_HZ = _RATE_RAD_S / np.sqrt(5400.0 / 4.0)


@dataclass(eq=False)
class HingeFilter:
    """Angle [rad] and rate [rad/s] of each hinge by name, with their covariances (2, 2), at an instant [s].

    The rate of a hinge is at first zero, with the standard deviation of an array that follows the Sun from a low orbit. A
    hinge that no point shows is predicted at its rate, with a growing covariance.
    """

    time_s: float
    states: dict[str, np.ndarray]
    covariances: dict[str, np.ndarray]

    @classmethod
    def start(cls, time_s: float, angles_rad: Mapping[str, float], sigmas_rad: Mapping[str, float]) -> HingeFilter:
        """Start at measured angles, and at rest.

        Parameters
        ----------
        time_s : instant [s]
        angles_rad, sigmas_rad : of the hinges by name, with their standard deviations
        """
        return cls(
            time_s,
            {name: np.array([angle_rad, 0.0]) for name, angle_rad in angles_rad.items()},
            {name: np.diag([sigmas_rad[name] ** 2, _RATE_RAD_S**2]) for name in angles_rad},
        )

    def predict(self, time_s: float) -> HingeFilter:
        """Return the prediction for an instant [s]; nothing moves back in time."""
        step_s = max(time_s - self.time_s, 0.0)
        move = np.array([[1.0, step_s], [0.0, 1.0]])
        # White acceleration in continuous time, integrated over the step (Bar-Shalom, Li and Kirubarajan, 2001, sec. 6.2.2).
        noise = np.array([[step_s**3 / 3.0, step_s**2 / 2.0], [step_s**2 / 2.0, step_s]])
        noise *= _ACCELERATION_RAD_S2_SQRT_HZ**2
        return HingeFilter(
            time_s,
            {name: move @ state for name, state in self.states.items()},
            {name: move @ covariance @ move.T + noise for name, covariance in self.covariances.items()},
        )

    def update(self, angles_rad: Mapping[str, float], sigmas_rad: Mapping[str, float], *, is_predicted: bool) -> None:
        """Update with angles that were estimated from a cloud.

        Parameters
        ----------
        angles_rad, sigmas_rad : of the hinges by name, with their standard deviations, which include the prediction's
        is_predicted : whether the prediction was the guess of these angles; if not, the filter starts again
        """
        if not is_predicted:
            again = HingeFilter.start(self.time_s, angles_rad, sigmas_rad)
            self.states, self.covariances = again.states, again.covariances
            return
        for name, angle_rad in angles_rad.items():
            state, covariance = self.states[name], self.covariances[name]
            gain = covariance[:, 0] / covariance[0, 0]
            self.states[name] = state + gain * (angle_rad - state[0])
            # The posterior variance replaces the predicted one; what depends on the angle follows it.
            self.covariances[name] = covariance + np.outer(gain, gain) * (sigmas_rad[name] ** 2 - covariance[0, 0])

    @property
    def angles_rad(self) -> dict[str, float]:
        """Angles by name [rad]."""
        return {name: float(state[0]) for name, state in self.states.items()}

    @property
    def sigmas_rad(self) -> dict[str, float]:
        """Standard deviations of the angles by name [rad], at most that of an unknown angle."""
        return {
            name: float(min(np.sqrt(covariance[0, 0]), UNKNOWN_ANGLE_RAD))
            for name, covariance in self.covariances.items()
        }
