"""Orbits from a recording by batch least squares: the follower's own from GNSS, and its orbit relative to a target.

Only observations are used, never the truth of the target. Where a recording has no GNSS or no star tracker, the follower's
own orbit or attitude can be taken as known, as `tracking` does.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.evaluation.orbit_determination.attitude_history import AttitudeHistory
from rso_lidar.evaluation.orbit_determination.recorded_measurements import (
    find_attitude,
    find_sensor,
    join_observed,
    measure_target,
    read_gnss,
    read_gnss_errors,
)
from rso_lidar.evaluation.recorded_runs.flown_scenario import (
    find_recorded_target,
    load_scenario,
    load_surfaces,
    sample_target,
)
from rso_lidar.evaluation.track_quality.own_knowledge import list_known_burns
from rso_lidar.evaluation.track_quality.range_noise import estimate_range_noise_m
from rso_lidar.orbit import Forces
from rso_lidar.records import Frame, GnssSamples
from rso_lidar.scenario import Scenario, list_lunar_bodies
from rso_lidar.sensors import Gnss
from rso_lidar.track import (
    MEASUREMENT_GATE,
    EstimatedOrbit,
    OwnOrbitFit,
    RelativeModel,
    RelativeOrbitFit,
    SightBias,
    fit_own_state,
    fit_relative_state,
    measure_visible_centroid,
)

_J2 = Forces()


@dataclass(frozen=True, eq=False)
class RelativeNavigation:
    """Relative orbit estimated from a recording, and what it rests on.

    Parameters
    ----------
    title : of the recording
    target : name of the target
    fit : relative state with covariance, residuals and outliers
    own : fit of the follower's own orbit to GNSS; None where the orbit was given or taken as known
    attitude : where the follower's attitude is from, in words
    range_noise_m : standard deviation of one range that was assumed [m]
    wander_m : changes of the centroid on the target, along the line of sight and across it, that count as noise [m]
    n_frames : number of frames; those without a fix or an attitude are no measurements
    """

    title: str
    target: str
    fit: RelativeOrbitFit
    own: OwnOrbitFit | None
    attitude: str
    range_noise_m: float
    wander_m: tuple[float, float]
    n_frames: int

    def describe(self) -> str:
        """Describe the fits: states, standard deviations, biases and chi-square."""
        lines = [f"{self.title}: {len(self.fit.statistics.used):,} of {self.n_frames:,} frames measure {self.target}"]
        lines.append(self.fit.describe(self.target))
        noise = f"attitude: {self.attitude}; range noise {self.range_noise_m:.3g} m"
        if any(self.wander_m):
            along_m, across_m = self.wander_m
            noise += f"; noise of the shape {along_m:.3g} m along the line of sight, {across_m:.3g} m across it"
        lines.append(noise)
        lines.append("own orbit: taken as known" if self.own is None else self.own.describe())
        return "\n".join(lines)


def fit_own_orbit(
    frames: Sequence[Frame],
    *,
    sensor: str | None = None,
    epoch_s: float | None = None,
    forces: Forces | None = _J2,
    known_attitude: bool = False,
    gate: float = MEASUREMENT_GATE,
    folder: Path | None = None,
) -> OwnOrbitFit:
    """Fit the follower's own orbit to the GNSS solutions of a recording.

    Parameters
    ----------
    frames : a recording, or frames of one scenario in the order of time. The follower must not burn among them
    sensor : name of the GNSS receiver (None: the first)
    epoch_s : instant of the estimated state, since start_utc [s] (None: the first solution)
    forces : on the follower besides the central attraction; None for two-body motion

    Other Parameters
    ----------------
    known_attitude : whether the recorded attitude counts as known, for an antenna beside the origin; otherwise it is that
        of the first star tracker
    gate : probability that a solution without fault is kept
    folder : folder of the mesh files that the scenario names (None: the working folder)

    Returns
    -------
    OwnOrbitFit

    Raises
    ------
    RecordingError
        For a recording without frames or GNSS, in a local world, or with burns.
    """
    scenario = _check_frames(frames, folder)
    part = find_sensor(scenario, Gnss, sensor)
    if part is None:
        raise RecordingError('fit: the recording has no GNSS; record it with a [[sensor]] of type "gnss"')
    attitude = None
    if any(part.antenna_m):
        attitude = find_attitude(scenario, frames, known_attitude=known_attitude)
    return _fit_gnss(scenario, frames, part, attitude, epoch_s, forces, gate)


def fit_relative_orbit(
    frames: Sequence[Frame],
    target: str | None = None,
    *,
    epoch_s: float | None = None,
    motion: RelativeModel = "nonlinear",
    forces: Forces | None = _J2,
    own: EstimatedOrbit | None = None,
    known_orbit: bool = False,
    known_attitude: bool = False,
    range_noise_m: float | None = None,
    shape: bool = True,
    misalignment_rad: float = 0.0,
    gate: float = MEASUREMENT_GATE,
    folder: Path | None = None,
    each: Iterable[Frame] | None = None,
) -> RelativeNavigation:
    """Fit the follower's orbit relative to a target to ranges and lines of sight of a recording.

    Each frame in which the target is whole in the field gives the centroid of its returns. The offset of the centroid from
    the target's origin is an estimated constant. Its prior has the mean and the standard deviations of the mesh over all
    directions. Its changes between frames are noise of the same standard deviations. So the covariance holds for a target
    that keeps one side to the lidar, and for one that tumbles.

    Parameters
    ----------
    frames : a recording, or frames of one scenario in the order of time. The follower must not burn among them
    target : name of the target (None: the first)
    epoch_s : instant of the estimated state, since start_utc [s] (None: the first frame with a measurement)
    motion : "nonlinear" integrates both orbits; "yamanaka_ankersen" and "hill" are linear models
    forces : on both bodies besides the central attraction; None for two-body motion
    own : the follower's orbit (None: fitted to the recording's GNSS)
    known_orbit : whether the recorded state of the follower at the first frame counts as known without error; `forces`
        propagate it
    known_attitude : whether the recorded attitude of the follower counts as known without error

    Other Parameters
    ----------------
    range_noise_m : standard deviation of one range [m] (None: from the recorded returns, simulated again on the detector)
    shape : whether the offset of the centroid is estimated; otherwise the state is that of the visible centroid
    misalignment_rad : constant misalignment of the boresight about each body axis, 1 sigma [rad]
    gate : probability that a measurement without fault is kept
    folder : folder of the mesh files that the scenario names (None: the working folder)
    each : iterator over the same frames that reports progress (None: `frames`)

    Returns
    -------
    RelativeNavigation

    Raises
    ------
    RecordingError
        For a recording without frames, target, GNSS or star tracker, in a local world, with burns, or with another mesh
        than the recorded one.
    ScenarioError
        For measurements that do not determine a state.
    """
    scenario = _check_frames(frames, folder)
    source = frames[0].source
    number = find_recorded_target(source, target, "fit")
    name = source.targets[number].name
    attitude = find_attitude(scenario, frames, known_attitude=known_attitude)
    if attitude is None:
        raise RecordingError(
            'fit: the recording has no star tracker; record it with a [[sensor]] of type "star_tracker", or take the '
            "attitude as known (--known-attitude)"
        )
    part = None
    if own is None and not known_orbit:
        part = find_sensor(scenario, Gnss, None)
        if part is None:
            raise RecordingError(
                'fit: the recording has no GNSS; record it with a [[sensor]] of type "gnss", or take the follower\'s orbit '
                "as known (--known-orbit)"
            )
    load_surfaces(scenario, source, number, "fit")  # raises where the mesh is not the recorded one
    model = sample_target(scenario, number)
    noise_m = estimate_range_noise_m(scenario.instrument, frames) if range_noise_m is None else range_noise_m
    before_m, along_m, across_m = measure_visible_centroid(model) if shape else (0.0, 0.0, 0.0)
    fixes = measure_target(
        scenario,
        frames if each is None else each,
        attitude,
        size_m=2.0 * model.radius_m,
        range_noise_m=noise_m,
        wander_m=(along_m, across_m),
    )
    measured = np.flatnonzero(np.isfinite(fixes.position_m).all(axis=1))
    if not len(measured):
        raise RecordingError(f"fit: no frame measures '{name}' whole in the field and with an attitude; give others")
    at_s = float(fixes.time_s[measured[0]]) if epoch_s is None else float(epoch_s)
    own_fit = None if part is None else _fit_gnss(scenario, frames, part, attitude, at_s, forces, gate)
    flown = (
        own if own is not None else _take_known_orbit(scenario, frames[0], forces) if own_fit is None else own_fit.orbit
    )
    turn = tuple(np.hypot(attitude.slow_rad, misalignment_rad).tolist())
    bias = SightBias((before_m, 0.0, 0.0), (along_m, across_m, across_m), turn)
    fit = fit_relative_state(
        fixes.time_s,
        fixes.position_m,
        fixes.covariance_m2,
        flown,
        epoch_s=at_s,
        motion=motion,
        bias=bias,
        inertial_from_body=fixes.inertial_from_body,
        gate=gate,
    )
    return RelativeNavigation(
        source.title, name, fit, own_fit, attitude.source, noise_m, (along_m, across_m), len(frames)
    )


def find_true_relative_state(
    frames: Sequence[Frame], target: str, epoch_s: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the true position [m] and velocity [m/s] (3) of the follower in a target's rtn axes, to judge a fit.

    Parameters
    ----------
    frames : a recording, or frames in the order of time
    target : name of the target
    epoch_s : instant of a frame [s]; None is returned where no frame has it
    """
    for frame in frames:
        if frame.time_s == epoch_s:
            link = frame.truth.poses.link(f"{target}.rtn", "follower")
            return link.translation_m, link.velocity_m_s
    return None


def _check_frames(frames: Sequence[Frame], folder: Path | None) -> Scenario:
    """Return the scenario of frames, after checking that the follower coasts in an orbit."""
    if not len(frames):
        raise RecordingError("fit: the recording has no frames; record some")
    scenario = load_scenario(frames[0].source, folder)
    if scenario.is_local:
        raise RecordingError("fit: the scenario is in a local world, without orbits; record one in orbit")
    if lunar := list_lunar_bodies(scenario.located_bodies):
        raise RecordingError(
            f"fit: '{lunar[0]}' orbits about the Moon, but fits have the Earth's gravity; record bodies about the Earth"
        )
    ends = np.array([frames[0].time_s, frames[-1].time_s])
    burns = list_known_burns(scenario, ends) if ends[1] > ends[0] else []
    if burns:
        raise RecordingError(
            f"fit: the follower burns at {burns[0][0].time_s:g} s, between the frames; give frames of one coast "
            "(--frames A:B)"
        )
    return scenario


def _fit_gnss(
    scenario: Scenario,
    frames: Sequence[Frame],
    part: Gnss,
    attitude: AttitudeHistory | None,
    epoch_s: float | None,
    forces: Forces | None,
    gate: float,
) -> OwnOrbitFit:
    """Fit the follower's orbit to the solutions of a receiver.

    Parameters
    ----------
    epoch_s : instant of the state [s] (None: the first solution)
    """
    samples = join_observed([frame.observation for frame in frames], part.name)
    assert isinstance(samples, GnssSamples)
    return fit_own_state(
        *read_gnss(samples, part, attitude),
        read_gnss_errors(part),
        start_utc=scenario.time.start_utc,
        epoch_s=epoch_s,
        forces=forces,
        gate=gate,
    )


def _take_known_orbit(scenario: Scenario, frame: Frame, forces: Forces | None) -> EstimatedOrbit:
    """Return the follower's recorded orbit at a frame, known without error."""
    own = frame.truth.states["follower"]
    return EstimatedOrbit(
        scenario.time.start_utc, frame.time_s, own.position_m, own.velocity_m_s, np.zeros((6, 6)), forces
    )
