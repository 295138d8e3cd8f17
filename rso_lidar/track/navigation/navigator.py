"""Navigation from observations: samples in the order of their instants, a filter, and an estimate of the present."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.motion import Mount, Ptu, lidar_from_ptu, make_ptu_link
from rso_lidar.pose import matrix_from_quaternion
from rso_lidar.records import (
    GnssSamples,
    GyroSamples,
    Observation,
    RelativeGnssSamples,
    SensorSamples,
    StarTrackerSamples,
)
from rso_lidar.track.centroid import Fix
from rso_lidar.track.navigation.navigation_estimate import NavigationEstimate, NavigationUpdate
from rso_lidar.track.navigation.navigation_filter import NavigationFilter
from rso_lidar.track.navigation.two_orbits import predict_orbits

if TYPE_CHECKING:
    from rso_lidar.sensors import Gnss, Gyro, RelativeGnss, StarTracker

_CENTROID_M = 0.3  # assumed, for a body of some metres
# Standard deviations at the start of position, velocity, relative position, relative velocity and attitude, in SI. Assumed:
# so much larger than those of the sensors that the first measurements replace the start.
_WIDE = np.repeat([1e4, 1e2, 1e4, 30.0, 0.3], 3)


class Navigator:
    """Reference tracker of the follower's orbit and attitude and of the target, from what observations hold.

    It starts at the first attitude of the star tracker after a solution of GNSS, and of relative GNSS if there is one,
    else a fix. Samples arrive late, each kind by its own latency. The filter stays behind the present by the longest
    latency, where all samples are there in order, and each call predicts from it with those that have arrived.

    Parameters
    ----------
    gyro, star_tracker, gnss : sensors of the scenario
    relative_gnss : of the scenario (None: the lidar alone measures the relative state)
    ptu : pan-tilt unit of the scenario (None: the lidar is fixed to the follower)
    mount : of the lidar, as in the scenario's [lidar]

    Other Parameters
    ----------------
    centroid_m : distance of the visible centroid from the target's origin, 1 sigma of each axis [m], added to the covariance
        of a fix (None: 0.3, or 0 where `centroid` is given)
    pointing_rad : error of the boresight, 1 sigma of each axis [rad], such as that of the PTU's encoders
    **settings : further settings of `NavigationFilter`, such as `target_acceleration_m_s2_sqrt_hz`, or `bias` and `centroid`
        of fixes, which are then states

    >>> navigate = Navigator(gyro=gyro, star_tracker=tracker, gnss=gnss)   # doctest: +SKIP
    """

    def __init__(
        self,
        *,
        gyro: Gyro,
        star_tracker: StarTracker,
        gnss: Gnss,
        relative_gnss: RelativeGnss | None = None,
        ptu: Ptu | None = None,
        mount: Mount | None = None,
        centroid_m: float | None = None,
        pointing_rad: float = 0.0,
        **settings: Any,
    ) -> None:
        self._sensors: dict[str, Any] = {"gyro": gyro, "star_tracker": star_tracker, "gnss": gnss}
        self._sensors["relative_gnss"] = self._relative = relative_gnss
        parts = [part for part in self._sensors.values() if part is not None]
        self._names = [part.name for part in parts]
        self._latency_s = max(part.latency_s for part in parts)
        self._ptu, self._mount = ptu, mount or Mount()
        if centroid_m is None:
            centroid_m = 0.0 if settings.get("centroid") is not None else _CENTROID_M
        self._centroid_m, self._pointing_rad, self._settings = centroid_m, pointing_rad, settings
        self._rates: list[tuple[float, np.ndarray]] = []
        self._waiting: list[tuple[float, str, tuple[np.ndarray, ...]]] = []
        self._filter: NavigationFilter | None = None

    @property
    def updates(self) -> list[NavigationUpdate]:
        """Measurements in the filter so far, with their innovations and NIS."""
        return [] if self._filter is None else self._filter.updates

    def __call__(self, observation: Observation, fix: Fix | None = None) -> NavigationEstimate | None:
        """Take an observation, and return the estimate at its instant; None before there is one.

        Parameters
        ----------
        observation : of a flash, with the samples of other sensors
        fix : position of the target in lidar axes, such as `locate_centroid` finds it
        """
        for name in self._names:
            if name not in observation.sensors:
                known = ", ".join(observation.sensors) or "none"
                raise ScenarioError(f"Navigator: the observation has no sensor '{name}' (known: {known}); name another")
            self._take(observation.sensors[name])
        if fix is not None:
            self._waiting.append((observation.time_s, "fix", self._place(observation, fix)))
        self._waiting.sort(key=lambda event: event[0])
        if self._filter is None:
            self._filter = self._begin()
        if self._filter is None:
            return None
        known_s = min(observation.time_s - self._latency_s, self._rates[-1][0] if self._rates else -np.inf)
        self._rates, self._waiting = _advance(self._filter, self._rates, self._waiting, known_s)
        present = self._filter.copy()
        _advance(present, self._rates, self._waiting, np.inf)
        return present.estimate(max(observation.time_s, present.time_s))

    def _take(self, samples: SensorSamples) -> None:
        """Sort the valid samples of a sensor among those that wait."""
        for k in np.flatnonzero(samples.valid):
            time_s = float(samples.time_s[k])
            match samples:
                case GyroSamples():
                    self._rates.append((time_s, samples.angular_velocity_rad_s[k]))
                case StarTrackerSamples():
                    attitude = matrix_from_quaternion(samples.quaternion_xyzw[k])
                    self._waiting.append((time_s, "star_tracker", (attitude,)))
                case GnssSamples():
                    self._waiting.append((time_s, "gnss", (samples.position_m[k], samples.velocity_m_s[k])))
                case RelativeGnssSamples():
                    both = samples.relative_position_m[k], samples.relative_velocity_m_s[k]
                    self._waiting.append((time_s, "relative_gnss", both))

    def _place(self, observation: Observation, fix: Fix) -> tuple[np.ndarray, ...]:
        """Return position and covariance of a fix, and rotation and origin of the lidar in body axes.

        Parameters
        ----------
        fix : in lidar axes
        """
        turned, origin = (self._mount.rotation * lidar_from_ptu().inv()).as_matrix(), np.array(self._mount.position_m)
        if self._ptu is not None:
            if observation.pan_tilt_rad is None:
                raise ScenarioError("Navigator: the observation has no pan and tilt; leave out ptu")
            link = make_ptu_link(self._ptu.mount, *observation.pan_tilt_rad.tolist())
            turned, origin = link.matrix @ turned, link.translation_m + link.matrix @ origin
        across = np.eye(3) * float(fix.position_m @ fix.position_m) - np.outer(fix.position_m, fix.position_m)
        spread = fix.covariance_m2 + self._centroid_m**2 * np.eye(3) + self._pointing_rad**2 * across
        return fix.position_m, spread, turned, origin

    def _begin(self) -> NavigationFilter | None:
        """Return the filter at the first attitude that follows all other first measurements; None as long as one lacks."""
        relative = "fix" if self._relative is None else "relative_gnss"
        first = {kind: event for event in reversed(self._waiting) if (kind := event[1])}
        if not {"gnss", relative} <= set(first) or not self._rates:
            return None
        from_s = max(first["gnss"][0], first[relative][0], self._rates[0][0])
        start = next((event for event in self._waiting if event[1] == "star_tracker" and event[0] >= from_s), None)
        if start is None:
            return None
        start_s, _, (attitude,) = start
        before = {event[1]: event for event in self._waiting if event[0] <= start_s}
        own_s, _, (position, velocity) = before["gnss"]
        seen = before[relative][2]
        states = np.concatenate([position, velocity, np.zeros(6)])
        world = {"oblate": self._settings.get("oblate", True), "has_gravity": self._settings.get("has_gravity", True)}
        states, *_ = predict_orbits(states, start_s - own_s, own_m_s2_sqrt_hz=0.0, target_m_s2_sqrt_hz=0.0, **world)
        if relative == "fix":
            states[6:9] = attitude @ (seen[2] @ seen[0] + seen[3])
        else:
            states[6:] = self._turn_relative(states, *seen)
        estimate = NavigationEstimate(
            start_s, states[:3], states[3:6], states[6:9], states[9:], attitude, np.diag(_WIDE**2)
        )
        last = max((k for k, (time_s, _) in enumerate(self._rates) if time_s <= start_s), default=0)
        self._rates = self._rates[last:]
        self._waiting = [event for event in self._waiting if event[0] >= start_s]
        return NavigationFilter(estimate, **self._sensors, **self._settings)

    def _turn_relative(self, states: np.ndarray, position_m: np.ndarray, velocity_m_s: np.ndarray) -> np.ndarray:
        """Return the state (6) of the target relative to the follower in inertial axes, from a solution of relative GNSS.

        Parameters
        ----------
        states : (12) with the state of the follower
        position_m, velocity_m_s : of the follower relative to the target, in the axes of the sensor
        """
        assert self._relative is not None
        relative = np.zeros(6)
        for _ in range(3):  # its axes are those of the target; each pass gains the ratio of distance to orbit radius
            axes, rate = self._relative.find_axes(states[:3] + relative[:3], states[3:6] + relative[3:])
            relative = -np.concatenate([axes @ position_m, axes @ (velocity_m_s + np.cross(rate, position_m))])
        return relative


def _advance(
    navigation: NavigationFilter,
    rates: list[tuple[float, np.ndarray]],
    waiting: list[tuple[float, str, tuple[np.ndarray, ...]]],
    until_s: float,
) -> tuple[list[tuple[float, np.ndarray]], list[tuple[float, str, tuple[np.ndarray, ...]]]]:
    """Give a filter what was measured up to an instant, and return the samples of the gyro and the rest that are left.

    Parameters
    ----------
    rates : instants and samples of the gyro that it has not been given
    """
    updates: dict[str, Any] = {
        "star_tracker": navigation.update_attitude,
        "gnss": navigation.update_position,
        "relative_gnss": navigation.update_relative,
        "fix": navigation.update_fix,
    }
    used, given = 0, 0
    for time_s, kind, measured in waiting:
        if time_s > until_s:
            break
        while used < len(rates) and navigation.last_rate_s < time_s:
            navigation.add_rate(*rates[used])
            used += 1
        updates[kind](time_s, *measured)
        given += 1
    return rates[used:], waiting[given:]
