"""Measurements of a target as tracking data messages (CCSDS TDM): written from a recording, and fitted to."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rso_lidar import units
from rso_lidar.errors import RecordingError, ScenarioError, warn_of_input
from rso_lidar.evaluation.orbit_determination.recorded_measurements import find_attitude, measure_target
from rso_lidar.evaluation.recorded_runs.flown_scenario import (
    find_recorded_target,
    load_scenario,
    load_surfaces,
    sample_target,
)
from rso_lidar.evaluation.track_quality.range_noise import estimate_range_noise_m
from rso_lidar.files import check_writable
from rso_lidar.orbit import (
    Ephemeris,
    Epochs,
    Forces,
    OrbitParameterMessage,
    TrackingDataMessage,
    check_covariances,
    format_utc,
    is_message_of,
    read_table_text,
    write_tdm,
)
from rso_lidar.records import Frame
from rso_lidar.track import (
    MEASUREMENT_GATE,
    EstimatedOrbit,
    RelativeModel,
    RelativeOrbitFit,
    SightBias,
    fit_relative_state,
    measure_visible_centroid,
)

_J2 = Forces()


def save_tracking_data(
    path: str | Path,
    frames: Sequence[Frame],
    target: str | None = None,
    *,
    known_attitude: bool = False,
    range_noise_m: float | None = None,
    shape: bool = True,
    corrected: bool = False,
    folder: Path | None = None,
    overwrite: bool = False,
) -> Path:
    """Write the measurements of a target in a recording as a tracking data message (CCSDS TDM, keyword = value).

    Each frame in which the target is whole in the field gives range, right ascension and declination of the centroid of its
    returns, by the encoders and the follower's star tracker. These are the measurements of `fit_relative_orbit`. The
    message states the mean offset of the centroid from the target's origin as CORRECTION_RANGE, and in comments the noise
    of a measurement (the median of all) and the counts of each.

    Parameters
    ----------
    path : of the file
    frames : a recording, or frames of one scenario in the order of time
    target : name of the target (None: the first)
    known_attitude : whether the recorded attitude of the follower counts as known without error

    Other Parameters
    ----------------
    range_noise_m : standard deviation of one range [m] (None: from the recorded returns, simulated again on the detector)
    shape : whether the shape of the model gives a correction, and adds to the noise
    corrected : whether the correction is in the ranges
    folder : folder of the mesh files that the scenario names (None: the working folder)
    overwrite : whether an existing file may be replaced

    Returns
    -------
    Path
        Of the file.

    Raises
    ------
    RecordingError
        For a recording without frames, target, star tracker or measurement, in a local world, or with another mesh than the
        recorded one; and for a file that cannot be written.
    """
    place = check_writable(path, overwrite=overwrite)
    if not len(frames):
        raise RecordingError("tdm: the recording has no frames; record some")
    if corrected and not shape:
        raise RecordingError("tdm: corrected: the correction is that of the shape; leave shape on")
    source = frames[0].source
    scenario = load_scenario(source, folder)
    if scenario.is_local:
        raise RecordingError("tdm: a local world has no inertial axes for directions; record a scenario in orbit")
    number = find_recorded_target(source, target, "tdm")
    attitude = find_attitude(scenario, frames, known_attitude=known_attitude)
    if attitude is None:
        raise RecordingError(
            'tdm: the recording has no star tracker; record it with a [[sensor]] of type "star_tracker", or take the '
            "attitude as known (--known-attitude)"
        )
    load_surfaces(scenario, source, number, "tdm")  # raises where the mesh is not the recorded one
    model = sample_target(scenario, number)
    noise_m = estimate_range_noise_m(scenario.instrument, frames) if range_noise_m is None else range_noise_m
    before_m, along_m, across_m = measure_visible_centroid(model) if shape else (0.0, 0.0, 0.0)
    fixes = measure_target(
        scenario,
        frames,
        attitude,
        size_m=2.0 * model.radius_m,
        range_noise_m=noise_m,
        wander_m=(along_m, across_m),
    )
    good = np.flatnonzero(np.isfinite(fixes.position_m).all(axis=1))
    name = source.targets[number].name
    if not len(good):
        raise RecordingError(f"tdm: no frame measures '{name}' whole in the field and with an attitude; give others")
    line_m = fixes.position_m[good]
    range_m = np.linalg.norm(line_m, axis=1)
    toward = line_m / range_m[:, None]
    spread = fixes.covariance_m2[good]
    ahead_m2 = np.einsum("ni,nij,nj->n", toward, spread, toward)
    across_m2 = 0.5 * (np.trace(spread, axis1=1, axis2=2) - ahead_m2)
    if corrected:
        line_m = line_m - before_m * toward
    time_s = fixes.time_s[good]
    start_utc = scenario.time.start_utc
    comments = [
        f"Centroid of the returns of the lidar; attitude: {attitude.source}; noise of one range {noise_m:.3g} m"
    ]
    if shape:
        comments.append(
            "CORRECTION_RANGE leads from the visible centroid to the origin of the target: mean of all views"
        )
    comments += [
        f"INTENSITY {format_utc(start_utc, at_s)}: sum {total:.0f} counts, peak {peak:.0f} counts, {count:.0f} pixels"
        for at_s, total, peak, count in zip(
            time_s.tolist(),
            fixes.intensity_counts[good],
            fixes.peak_counts[good],
            fixes.pixel_count[good],
            strict=True,
        )
    ]
    return write_tdm(
        place,
        "follower",
        name,
        Epochs(start_utc, time_s),
        line_m,
        sigma_range_m=float(np.sqrt(np.median(ahead_m2))),
        sigma_angle_rad=float(np.median(np.sqrt(across_m2) / range_m)),
        sigma_offset_m=(along_m, across_m) if shape else None,
        correction_range_m=-before_m if shape else None,
        corrections_applied=corrected,
        comments=comments,
        overwrite=overwrite,
    )


def fit_tracking_data(
    measured: TrackingDataMessage | str | Path,
    own: EstimatedOrbit | str | Path,
    target: str | None = None,
    *,
    range_sigma_m: float | None = None,
    angle_sigma_rad: float | None = None,
    round_trip: bool = False,
    epoch_s: float | None = None,
    motion: RelativeModel = "nonlinear",
    forces: Forces | None = _J2,
    gate: float = MEASUREMENT_GATE,
) -> RelativeOrbitFit:
    """Fit the observer's orbit relative to a target to a tracking data message (CCSDS TDM).

    Instants with a range, a right ascension and a declination are measurements, with the corrections that the message
    states. Measurements count as independent but for a constant offset from the target's origin, whose standard deviations
    are those of the message's comments. A constant error of the attitude is not known from a message.

    Parameters
    ----------
    measured : the message, or the path of its file
    own : the observer's orbit: an estimate, or the path of an OPM, with its covariance, or of an OEM or CSV ephemeris, which
        counts as known without error
    target : name of the target (None: the only one)
    range_sigma_m, angle_sigma_rad : standard deviations of a measurement [m], [rad] (None: those of the message's comments)
    round_trip : whether ranges of a signal that comes back are the length of both ways

    Other Parameters
    ----------------
    epoch_s : instant of the estimated state, since `start_utc` of the message [s] (None: the first measurement)
    motion : "nonlinear" integrates both orbits; "yamanaka_ankersen" and "hill" are linear models
    forces : on both bodies besides the central attraction, for an orbit from a file; None for two-body motion
    gate : probability that a measurement without fault is kept

    Returns
    -------
    RelativeOrbitFit
        Its times count from the `start_utc` of the message.

    Raises
    ------
    ScenarioError
        For files that cannot be read, a message without positions or without known noise, and measurements that do not
        determine a state.
    """
    message = measured if isinstance(measured, TrackingDataMessage) else TrackingDataMessage.from_file(measured)
    time_s, line_m = message.find_positions(target, round_trip=round_trip)
    stated = message.select_target(target)
    for name, given in (("range_sigma_m", range_sigma_m), ("angle_sigma_rad", angle_sigma_rad)):
        if given is not None and not 0.0 < given < np.inf:
            raise ScenarioError(f"{name}: {given:g} is not a standard deviation; give more than 0, or leave it out")
    sigma_m = _find_sigma([each.sigma_range_m for each in stated]) if range_sigma_m is None else range_sigma_m
    sigma_rad = _find_sigma([each.sigma_angle_rad for each in stated]) if angle_sigma_rad is None else angle_sigma_rad
    if sigma_m is None or sigma_rad is None:
        what, option = ("ranges", "--range-noise") if sigma_m is None else ("angles", "--angle-noise")
        raise ScenarioError(f"{message.where}: does not state the noise of its {what}; give it ({option})")
    if not isinstance(own, EstimatedOrbit):
        own = load_observer_orbit(own, message.start_utc, float(time_s[0]), forces)
    elif own.start_utc != message.start_utc:
        later_s = float(Epochs(own.start_utc, np.zeros(1)).since(message.start_utc)[0])
        own = EstimatedOrbit(
            message.start_utc, own.epoch_s + later_s, own.position_m, own.velocity_m_s, own.covariance, own.forces
        )
    along_m, across_m = (max(each.sigma_offset_m[k] for each in stated) for k in (0, 1))
    range_m = np.linalg.norm(line_m, axis=1)
    toward = line_m / range_m[:, None]
    ahead = np.einsum("ni,nj->nij", toward, toward)
    across_m2 = (sigma_rad * range_m[:, None, None]) ** 2
    return fit_relative_state(
        time_s,
        line_m,
        sigma_m**2 * ahead + across_m2 * (np.eye(3) - ahead),
        own,
        epoch_s=epoch_s,
        motion=motion,
        bias=SightBias((0.0, 0.0, 0.0), (along_m, across_m, across_m)),
        gate=gate,
    )


def load_observer_orbit(
    path: str | Path, start_utc: datetime.datetime, at_s: float, forces: Forces | None
) -> EstimatedOrbit:
    """Load an orbit from an OPM, with its covariance, or from an OEM or CSV ephemeris, whose state at an instant is taken.

    Parameters
    ----------
    path : of the file
    start_utc : instant from which times count
    at_s : instant of the state of an ephemeris [s]
    forces : besides the central attraction; None for two-body motion

    Raises
    ------
    ScenarioError
        For a file that cannot be read, and an OPM with maneuvers.
    """
    if not is_message_of("OPM", read_table_text(Path(path))):
        known = Ephemeris(file=str(path)).states(Epochs(start_utc, np.array([at_s])))
        return EstimatedOrbit(start_utc, at_s, known.position_m[0], known.velocity_m_s[0], np.zeros((6, 6)), forces)
    message = OrbitParameterMessage.from_file(path)
    if message.maneuvers:
        raise ScenarioError(
            f"{path}: has maneuvers, and a fit needs a coast; give the orbit as an OEM, or without them"
        )
    state = message.state
    epoch_s = float(Epochs(state.epoch_utc, np.zeros(1)).since(start_utc)[0])
    if abs(epoch_s - at_s) > units.DAY_S:
        warn_of_input(
            f"{path}: its epoch is {abs(epoch_s - at_s) / units.DAY_S:.3g} days from the measurements, over which the orbit "
            "is propagated without process noise; give an orbit near them"
        )
    if message.covariance is not None:
        check_covariances(message.covariance, f"{path}: covariance")
    return EstimatedOrbit(
        start_utc,
        epoch_s,
        np.array(state.position_m),
        np.array(state.velocity_m_s),
        np.zeros((6, 6)) if message.covariance is None else message.covariance,
        forces,
    )


def _find_sigma(stated: Sequence[float | None]) -> float | None:
    """Return the greatest of the standard deviations that segments state; None where none does."""
    return max((sigma for sigma in stated if sigma is not None), default=None)
