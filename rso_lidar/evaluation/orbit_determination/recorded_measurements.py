"""Measurements of a recording for orbit determination: samples of other sensors, and fixes of the target from the frames."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from rso_lidar.errors import RecordingError, did_you_mean
from rso_lidar.evaluation.orbit_determination.attitude_history import (
    AttitudeHistory,
    read_star_tracker,
    take_known_attitude,
)
from rso_lidar.evaluation.track_quality.own_knowledge import find_measured_mount, find_pointing_error_rad
from rso_lidar.pose import skew
from rso_lidar.records import Frame, GnssSamples, Observation, SensorSamples, StarTrackerSamples, join_samples
from rso_lidar.scenario import Scenario
from rso_lidar.sensors import Gnss, StarTracker
from rso_lidar.track import GnssErrors, locate_centroid, select_target_points

_Sensor = TypeVar("_Sensor", bound=Any)


@dataclass(frozen=True, eq=False)
class TargetFixes:
    """Positions (frame, 3) of a target minus the follower's origin in inertial axes [m], NaN without one.

    `covariance_m2` (frame, 3, 3) is of each, and `inertial_from_body` (frame, 3, 3) the attitude of the follower. Of the
    pixels of the target, `pixel_count` (frame) returned, with `intensity_counts` (frame) in all and `peak_counts` (frame) in
    the brightest; these are 0 without a measurement.
    """

    time_s: np.ndarray
    position_m: np.ndarray
    covariance_m2: np.ndarray
    inertial_from_body: np.ndarray
    pixel_count: np.ndarray
    intensity_counts: np.ndarray
    peak_counts: np.ndarray


def find_sensor(scenario: Scenario, kind: type[_Sensor], name: str | None) -> _Sensor | None:
    """Find a sensor of a scenario by its kind and name (None: the first of its kind); None where there is none."""
    known = {part.name: part for part in scenario.sensor if isinstance(part, kind)}
    if name is not None and name not in known:
        listed = ", ".join(known) or "none"
        word = kind.model_fields["type"].default
        raise RecordingError(f"fit: no {word} sensor '{name}'{did_you_mean(name, known)} (known: {listed})")
    return known[name] if name is not None else next(iter(known.values()), None)


def join_observed(observations: Sequence[Observation], name: str) -> SensorSamples:
    """Join the samples of a sensor over observations."""
    if any(name not in observation.sensors for observation in observations):
        raise RecordingError(f"fit: frames without samples of sensor '{name}'; record them again with it")
    return join_samples([{name: observation.sensors[name]} for observation in observations])[name]


def find_attitude(scenario: Scenario, frames: Sequence[Frame], *, known_attitude: bool) -> AttitudeHistory | None:
    """Return the attitude of the follower from the first star tracker; None where there is none.

    Parameters
    ----------
    known_attitude : whether the recorded attitude counts as known instead
    """
    if known_attitude:
        return take_known_attitude(frames)
    part = find_sensor(scenario, StarTracker, None)
    if part is None:
        return None
    samples = join_observed([frame.observation for frame in frames], part.name)
    assert isinstance(samples, StarTrackerSamples)
    return read_star_tracker(samples, part)


def read_gnss_errors(part: Gnss) -> GnssErrors:
    """Return the errors that a GNSS receiver states."""
    return GnssErrors(
        part.position_noise_m,
        part.velocity_noise_m_s,
        part.slow_position_m,
        part.slow_velocity_m_s,
        part.correlation_s,
        part.vertical_ratio,
    )


def read_gnss(
    samples: GnssSamples, part: Gnss, attitude: AttitudeHistory | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return instants (sample) [s], positions and velocities (sample, 3) of the follower's origin from valid solutions.

    Raises
    ------
    RecordingError
        For an antenna beside the origin without an attitude.
    """
    good = np.asarray(samples.valid, dtype=bool)
    time_s, position, velocity = samples.time_s[good], samples.position_m[good], samples.velocity_m_s[good]
    arm = np.array(part.antenna_m)
    if not arm.any():
        return time_s, position, velocity
    if attitude is None:
        raise RecordingError(
            f"fit: sensor '{part.name}' has its antenna_m beside the origin, and the recording no star tracker; add one, or "
            "take the attitude as known"
        )
    turned, rate, _ = attitude.find(time_s)
    position = position - np.einsum("nij,j->ni", turned, arm)
    velocity = velocity - np.einsum("nij,nj->ni", turned, np.cross(rate, arm))
    return time_s, position, velocity


def measure_target(
    scenario: Scenario,
    frames: Iterable[Frame],
    attitude: AttitudeHistory,
    *,
    size_m: float,
    range_noise_m: float,
    wander_m: tuple[float, float],
) -> TargetFixes:
    """Measure a target in each frame by the centroid of its points: range and line of sight.

    A target that the edge of the field cuts has another centroid, so such a frame is no measurement.

    Parameters
    ----------
    size_m : greatest extent of the target [m]
    range_noise_m : standard deviation of one range [m]
    wander_m : changes of the centroid on the target from frame to frame, along the line of sight and across it, 1 sigma [m]
    """
    time_s, lines, spreads, signals = [], [], [], []
    pointing_rad = find_pointing_error_rad(scenario)
    for frame in frames:
        observation = frame.observation
        pixel_rad = scenario.lidar.receiver.pixel_pitch_m / observation.settings["focal_length_m"]
        fix = locate_centroid(observation.points_m, pixel_rad=pixel_rad, range_noise_m=range_noise_m, gate_m=size_m)
        time_s.append(observation.time_s)
        if fix is None or _is_cut(observation.points_m, size_m):
            lines.append(np.full(3, np.nan))
            spreads.append(np.full((3, 3), np.nan))
            signals.append((0.0, 0.0, 0.0))
            continue
        counts = observation.reading.intensity_counts[select_target_points(observation.points_m, size_m)].astype(float)
        signals.append((float(counts.size), float(counts.sum()), float(counts.max(initial=0.0))))
        toward = fix.position_m / fix.range_m
        ahead = np.outer(toward, toward)
        across_m2 = wander_m[1] ** 2 + (pointing_rad * fix.range_m) ** 2
        spread = fix.covariance_m2 + wander_m[0] ** 2 * ahead + across_m2 * (np.eye(3) - ahead)
        seat = find_measured_mount(scenario, observation)
        turn = seat.rotation.as_matrix()
        line = seat.apply(fix.position_m)
        lines.append(line)
        spreads.append(turn @ spread @ turn.T)
    at_s = np.array(time_s)
    turned, _, factor = attitude.find(at_s)
    line, spread = np.array(lines).reshape(-1, 3), np.array(spreads).reshape(-1, 3, 3)
    arms = np.array([skew(direction) for direction in line]).reshape(-1, 3, 3)
    spread = spread + factor[:, None, None] * (arms @ attitude.white_rad2 @ np.swapaxes(arms, -1, -2))
    return TargetFixes(
        at_s,
        np.einsum("nij,nj->ni", turned, line),
        turned @ spread @ np.swapaxes(turned, -1, -2),
        turned,
        *np.array(signals).reshape(-1, 3).T,
    )


def _is_cut(cloud: np.ndarray, size_m: float) -> bool:
    """Return whether points of a target are in the outermost pixels of a cloud (row, col, 3)."""
    taken = select_target_points(cloud, size_m)
    return bool(taken[[0, -1]].any() or taken[:, [0, -1]].any())
