"""An error-state Kalman filter of the follower's orbit and attitude, and of a target relative to it, from sensor samples.

The error states are those of the sensors' own models: besides position, velocity, relative state and attitude, each
process of a sensor with a memory (bias, slow error) is a state. Scale factor and misalignment of the gyro are not states.
Apart from these, the filter has the error models of the simulation, so it is a best case to compare other filters with.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self, TypeVar

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import rtn_matrix
from rso_lidar.pose import matrix_from_vector, skew
from rso_lidar.rpo import CentroidWander, SensorBias, SlowErrors
from rso_lidar.track.navigation.navigation_estimate import NavigationEstimate, NavigationUpdate
from rso_lidar.track.navigation.two_orbits import STATES, predict_orbits

if TYPE_CHECKING:
    from rso_lidar.sensors import Gnss, Gyro, RelativeGnss, StarTracker


# Error states: both orbits in inertial axes [m], [m/s], the small rotation of the body in its axes [rad], the noise of two
# samples of the gyro [rad/s], then the processes of the sensors. CORE is the number of those in an estimate.
ORBIT, TURN, CORE = slice(0, 12), slice(12, 15), 15
_OWN, _OWN_RATE, _RELATIVE, _RELATIVE_RATE = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)
_BEFORE, _AFTER = slice(15, 18), slice(18, 21)  # of the instant, in the gyro's axes
_FIRST_PROCESS = 21

_Sensor = TypeVar("_Sensor")


class NavigationFilter:
    """Error-state Kalman filter; it is given samples in the order of their instants.

    Parameters
    ----------
    estimate : at the start, with its covariance
    gyro, star_tracker, gnss, relative_gnss : sensors whose samples will be given. Their models supply all noise

    Other Parameters
    ----------------
    own_acceleration_m_s2_sqrt_hz, target_acceleration_m_s2_sqrt_hz : roots of the spectral densities of white
        accelerations of the follower and of the target that are not modelled, each axis [m/s²/√Hz]
    oblate : whether the Earth's J2 acts on both
    has_gravity : False in a local world
    bias, centroid : slow errors of fixes, which are states too: bias of range and boresight, and wander of the centroid.
        Their axes are those of the line of sight and the target's orbit; in a local world z stands for the orbit normal
    """

    def __init__(
        self,
        estimate: NavigationEstimate,
        *,
        gyro: Gyro,
        star_tracker: StarTracker | None = None,
        gnss: Gnss | None = None,
        relative_gnss: RelativeGnss | None = None,
        own_acceleration_m_s2_sqrt_hz: float = 1e-4,
        target_acceleration_m_s2_sqrt_hz: float = 1e-5,
        oblate: bool = True,
        has_gravity: bool = True,
        bias: SensorBias | None = None,
        centroid: CentroidWander | None = None,
    ) -> None:
        self._orbits: dict[str, Any] = {
            "own_m_s2_sqrt_hz": own_acceleration_m_s2_sqrt_hz,
            "target_m_s2_sqrt_hz": target_acceleration_m_s2_sqrt_hz,
        }
        self._orbits |= {"oblate": oblate, "has_gravity": has_gravity}
        self._gyro, self._tracker, self._gnss, self._relative = gyro, star_tracker, gnss, relative_gnss
        self._processes: dict[str, SensorProcesses] = {}
        starts: list[np.ndarray] = []
        size = _FIRST_PROCESS
        for part in (gyro, star_tracker, gnss, relative_gnss):
            if part is not None:
                self._processes[part.name] = processes = SensorProcesses.of(part, size)
                starts.append(processes.start)
                size += len(processes.start)
        self._slow = SlowErrors([(bias, centroid, True)])
        self._processes["lidar"] = processes = SensorProcesses.of_slow_errors(self._slow, size)
        starts.append(processes.start)
        size += len(processes.start)
        self._states = np.concatenate(
            [
                estimate.position_m,
                estimate.velocity_m_s,
                estimate.relative_position_m,
                estimate.relative_velocity_m_s,
                np.zeros(size - STATES),
            ]
        )
        self._attitude = np.array(estimate.inertial_from_body)
        self._covariance = np.zeros((size, size))
        self._covariance[:CORE, :CORE] = estimate.covariance
        places = np.arange(_FIRST_PROCESS, size)
        self._covariance[places, places] = np.concatenate(starts)
        self._body_from_gyro = gyro.mount.rotation.as_matrix()
        self._gyro_variance = gyro.error_model.white**2
        self._covariance[_BEFORE, _BEFORE] = self._covariance[_AFTER, _AFTER] = np.diag(self._gyro_variance)
        self._gyro_spread = self._processes[gyro.name].spread(3, size)[:, places]
        self.time_s = self._orbit_time_s = estimate.time_s
        self._rates: list[tuple[float, np.ndarray]] = []  # the gyro's samples about the present
        self.updates: list[NavigationUpdate] = []

    def copy(self) -> Self:
        """Return an independent copy of the filter, for a prediction that is not kept."""
        other = copy.copy(self)
        other._states, other._attitude = self._states.copy(), self._attitude.copy()
        other._covariance, other._rates, other.updates = self._covariance.copy(), list(self._rates), []
        return other

    @property
    def last_rate_s(self) -> float:
        """Instant of the last sample of the gyro [s]; minus infinity before the first."""
        return self._rates[-1][0] if self._rates else -np.inf

    # ------------------------------------------------------------------------------------------------ prediction

    def add_rate(self, time_s: float, rate_rad_s: np.ndarray) -> None:
        """Take a sample of the gyro. Between two samples the rate is interpolated; after the last it is held.

        Parameters
        ----------
        time_s : instant of the sample [s]
        rate_rad_s : (xyz) in the gyro's axes [rad/s]
        """
        if self._rates and time_s <= self._rates[-1][0]:
            raise ScenarioError(f"navigation: a sample of the gyro at {time_s:g} s comes late; sort them by time")
        if len(self._rates) == 2:
            self.predict(self._rates[1][0])
            self._rates.pop(0)
            states, covariance = self._states, self._covariance
            states[_BEFORE], states[_AFTER] = states[_AFTER], 0.0
            covariance[_BEFORE, :] = covariance[_AFTER, :]
            covariance[:, _BEFORE] = covariance[:, _AFTER]
            covariance[_AFTER, :] = covariance[:, _AFTER] = 0.0
            covariance[_AFTER, _AFTER] = np.diag(self._gyro_variance)
        self._rates.append((time_s, np.asarray(rate_rad_s, dtype=float)))

    def predict(self, time_s: float) -> None:
        """Predict attitude and processes to an instant; orbits follow when they are measured or asked for.

        Parameters
        ----------
        time_s : instant [s], not before the present
        """
        step_s = time_s - self.time_s
        if step_s < 0.0:
            raise ScenarioError(f"navigation: cannot go back from {self.time_s:g} s to {time_s:g} s; sort by time")
        if step_s == 0.0:
            return
        states, covariance = self._states, self._covariance
        rate, before, after = np.zeros(3), 0.0, 0.0
        if self._rates:
            (first_s, first), (last_s, last) = self._rates[0], self._rates[-1]
            middle_s = 0.5 * (self.time_s + time_s)
            after = 0.0 if last_s == first_s else min(max((middle_s - first_s) / (last_s - first_s), 0.0), 1.0)
            before = 1.0 - after
            rate = before * (first - states[_BEFORE]) + after * (last - states[_AFTER])
        rate = self._body_from_gyro @ (rate - self._gyro_spread @ states[_FIRST_PROCESS:])
        turn = matrix_from_vector(step_s * rate)
        self._attitude = self._attitude @ turn
        shift = -step_s * self._body_from_gyro
        mixed = turn.T @ covariance[TURN] + shift @ (
            before * covariance[_BEFORE] + after * covariance[_AFTER] + self._gyro_spread @ covariance[_FIRST_PROCESS:]
        )
        covariance[TURN] = mixed
        covariance[:, TURN] = (
            covariance[:, TURN] @ turn
            + (
                before * covariance[:, _BEFORE]
                + after * covariance[:, _AFTER]
                + covariance[:, _FIRST_PROCESS:] @ self._gyro_spread.T
            )
            @ shift.T
        )
        for part in self._processes.values():
            decay = part.decay**step_s
            states[part.places] *= decay
            covariance[part.places] *= decay[:, None]
            covariance[:, part.places] *= decay
            covariance[part.places, part.places] += part.variance * (1.0 - decay**2) + part.growth * step_s
        self.time_s = time_s

    def _predict_orbits(self) -> None:
        step_s = self.time_s - self._orbit_time_s
        if step_s > 0.0:
            state, onward, noise = predict_orbits(self._states[ORBIT], step_s, **self._orbits)
            self._states[ORBIT] = state
            self._covariance[ORBIT] = onward @ self._covariance[ORBIT]
            self._covariance[:, ORBIT] = self._covariance[:, ORBIT] @ onward.T
            self._covariance[ORBIT, ORBIT] += noise
            self._orbit_time_s = self.time_s

    # ------------------------------------------------------------------------------------------------ measurements

    def update_attitude(self, time_s: float, inertial_from_body: np.ndarray) -> None:
        """Take an attitude of the star tracker.

        Parameters
        ----------
        time_s : instant [s]
        inertial_from_body : measured attitude, a matrix (3, 3)
        """
        from scipy.spatial.transform import Rotation

        part = _require(self._tracker, "star_tracker")
        self.predict(time_s)
        mount = part.mount.rotation.as_matrix()
        sensitivity = mount @ self._spread(part.name, 3)
        turn = Rotation.from_matrix(self._attitude.T @ inertial_from_body).as_rotvec()
        residual = turn - sensitivity @ self._states
        sensitivity[:, TURN] = np.eye(3)
        self._update(part.name, residual, sensitivity, mount @ np.diag(part.error_model.white**2) @ mount.T)

    def update_position(self, time_s: float, position_m: np.ndarray, velocity_m_s: np.ndarray) -> None:
        """Take a solution of GNSS.

        Parameters
        ----------
        time_s : instant [s]
        position_m, velocity_m_s : of the antenna (xyz) in inertial axes [m], [m/s]
        """
        part = _require(self._gnss, "gnss")
        self.predict(time_s)
        self._predict_orbits()
        place, turned = self._states[_OWN], self._attitude
        out = place / (np.linalg.norm(place) or 1.0)
        stretch = np.eye(3) + (part.vertical_ratio - 1.0) * np.outer(out, out)
        both = np.kron(np.eye(2), stretch)
        sensitivity = both @ self._spread(part.name, 6)
        arm = np.array(part.antenna_m)
        moving = np.cross(self._rate(), arm)
        known = np.concatenate([place + turned @ arm, self._states[_OWN_RATE] + turned @ moving])
        residual = np.concatenate([position_m, velocity_m_s]) - known - sensitivity @ self._states
        sensitivity[:3, _OWN] = sensitivity[3:, _OWN_RATE] = np.eye(3)
        sensitivity[:3, TURN], sensitivity[3:, TURN] = -turned @ skew(arm), -turned @ skew(moving)
        self._update(part.name, residual, sensitivity, both @ np.diag(part.error_model.white**2) @ both.T)

    def update_relative(self, time_s: float, position_m: np.ndarray, velocity_m_s: np.ndarray) -> None:
        """Take a solution of relative GNSS.

        Parameters
        ----------
        time_s : instant [s]
        position_m, velocity_m_s : of the follower relative to the target, in the axes of the sensor [m], [m/s]
        """
        part = _require(self._relative, "relative_gnss")
        self.predict(time_s)
        self._predict_orbits()
        states = self._states
        axes, rate = part.find_axes(states[_OWN] + states[_RELATIVE], states[_OWN_RATE] + states[_RELATIVE_RATE])
        turned = np.zeros((6, STATES))
        turned[:3, _RELATIVE] = turned[3:, _RELATIVE_RATE] = -axes.T
        turned[3:, _RELATIVE] = skew(rate) @ axes.T
        sensitivity = self._spread(part.name, 6)
        residual = np.concatenate([position_m, velocity_m_s]) - turned @ states[ORBIT] - sensitivity @ states
        sensitivity[:, ORBIT] = turned
        self._update(part.name, residual, sensitivity, np.diag(part.error_model.white**2))

    def update_fix(
        self,
        time_s: float,
        position_m: np.ndarray,
        covariance_m2: np.ndarray,
        body_from_lidar: np.ndarray,
        origin_m: np.ndarray,
    ) -> None:
        """Take a position of the target from the lidar: line of sight and range.

        Parameters
        ----------
        time_s : instant [s]
        position_m : of the target's origin (xyz) in lidar axes [m]
        covariance_m2 : of it (3, 3) [m²]
        body_from_lidar : rotation (3, 3) of the lidar on the follower
        origin_m : position of the lidar (xyz) in body axes [m]
        """
        self.predict(time_s)
        self._predict_orbits()
        seen = self._attitude.T @ self._states[_RELATIVE]
        sensitivity = np.zeros((3, len(self._states)))
        sensitivity[:, _RELATIVE] = body_from_lidar.T @ self._attitude.T
        sensitivity[:, TURN] = body_from_lidar.T @ skew(seen)
        residual = position_m - body_from_lidar.T @ (seen - origin_m)
        if len(self._slow):
            line_m = self._attitude @ (seen - origin_m)
            axes = np.eye(3)
            if self._orbits["has_gravity"]:
                target = self._states[:6] + self._states[6:12]
                axes = rtn_matrix(target[None, :3], target[None, 3:])[0][0]
            shifts = self._slow.find_shifts(self._slow.find_places(0), -line_m[:, None], axes)[..., 0]
            places = self._processes["lidar"].places
            sensitivity[:, places] = body_from_lidar.T @ self._attitude.T @ shifts
            residual = residual - sensitivity[:, places] @ self._states[places]
        self._update("lidar", residual, sensitivity, covariance_m2)

    @property
    def slow(self) -> dict[str, tuple[float, float]]:
        """Estimates of bias and centroid and their standard deviations, by name with its unit [m], [rad]."""
        places = self._processes["lidar"].places
        sigma = np.sqrt(self._covariance[places, places])
        pairs = zip(self._states[places].tolist(), sigma.tolist(), strict=True)
        return {error.name: pair for error, pair in zip(self._slow.errors, pairs, strict=True)}

    def estimate(self, time_s: float) -> NavigationEstimate:
        """Return the estimate at an instant, to which the filter is predicted.

        Parameters
        ----------
        time_s : instant [s], not before the present
        """
        self.predict(time_s)
        self._predict_orbits()
        places = (_OWN, _OWN_RATE, _RELATIVE, _RELATIVE_RATE)
        position, velocity, relative, moving = (self._states[place].copy() for place in places)
        covariance = self._covariance[:CORE, :CORE].copy()
        return NavigationEstimate(time_s, position, velocity, relative, moving, self._attitude.copy(), covariance)

    def _rate(self) -> np.ndarray:
        """Return the estimated angular velocity (xyz) in body axes [rad/s]; zero before the first sample of the gyro."""
        if not self._rates:
            return np.zeros(3)
        rate_rad_s = self._rates[-1][1] - self._gyro_spread @ self._states[_FIRST_PROCESS:]
        return np.asarray(self._body_from_gyro @ rate_rad_s)

    def _spread(self, name: str, count: int) -> np.ndarray:
        return self._processes[name].spread(count, len(self._states))

    def _update(self, source: str, innovation: np.ndarray, sensitivity: np.ndarray, noise: np.ndarray) -> None:
        """Correct all states with a measurement.

        Parameters
        ----------
        innovation : measured minus predicted (row)
        sensitivity : its derivatives by the error states (row, state)
        noise : covariance of the measurement (row, row)
        """
        crossed = self._covariance @ sensitivity.T
        spread = sensitivity @ crossed + noise
        gain = np.linalg.solve(spread, crossed.T).T
        correction = gain @ innovation
        self.updates.append(
            NavigationUpdate(self.time_s, source, innovation, float(innovation @ np.linalg.solve(spread, innovation)))
        )
        kept = np.eye(len(self._states)) - gain @ sensitivity
        self._covariance = kept @ self._covariance @ kept.T + gain @ noise @ gain.T  # Joseph's form stays positive
        self._attitude = self._attitude @ matrix_from_vector(correction[TURN])
        correction[TURN] = 0.0
        self._states += correction


def _require(part: _Sensor | None, name: str) -> _Sensor:
    """Return a sensor, or raise an error if the filter was made without it."""
    if part is None:
        raise ScenarioError(f"navigation: the filter has no {name}; give the part when the filter is made")
    return part


@dataclass(frozen=True, eq=False)
class SensorProcesses:
    """The processes of one sensor among the error states, in the units of its channels."""

    places: np.ndarray  # (process) indices of the states
    channels: np.ndarray  # (process) to which each is added
    start: np.ndarray  # (process) variance at the start
    decay: np.ndarray  # (process) over one second; 1 for random walks and constants
    variance: np.ndarray  # (process) stationary, where the decay is below 1
    growth: np.ndarray  # (process) of the variance in one second, where it is not

    @staticmethod
    def of(part: Any, first: int) -> SensorProcesses:
        """Return the processes of a sensor whose values `measure` adds to its channels, as states from `first` on."""
        model = part.error_model
        kept = np.flatnonzero(model.channel >= 0)  # -1: not added, such as a scale factor
        decay, drive, start = model.process[kept].T
        steady = decay < 1.0
        return SensorProcesses(
            first + np.arange(len(kept)),
            model.channel[kept],
            start**2,
            decay**part.rate_hz,
            np.where(steady, start**2, 0.0),
            np.where(steady, 0.0, drive**2 * part.rate_hz),
        )

    @staticmethod
    def of_slow_errors(slow: SlowErrors, first: int) -> SensorProcesses:
        """Return the processes of slow errors of fixes, as states from `first` on; `channels` do not apply to them."""
        decay, _ = slow.find_step(1.0)
        places, nothing = first + np.arange(len(slow)), np.zeros(len(slow))
        variance = slow.sigma**2
        return SensorProcesses(places, places, variance, decay, np.where(decay < 1.0, variance, 0.0), nothing)

    def spread(self, count: int, size: int) -> np.ndarray:
        """Return the matrix (channel, state) that adds the processes to the channels of their sensor."""
        matrix = np.zeros((count, size))
        matrix[self.channels, self.places] = 1.0
        return matrix
