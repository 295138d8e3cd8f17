"""Reference trackers run on a recording, with their errors against the truth.

A tracker receives the points of the frames and what a spacecraft knows of itself: the PTU's encoders, its attitude (from
a star tracker), its orbit and its burns. Of the target it receives the mesh only; the truth is used for the errors alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.evaluation.recorded_runs.flown_scenario import (
    find_recorded_target,
    load_scenario,
    load_surfaces,
    sample_target,
)
from rso_lidar.evaluation.track_quality.own_knowledge import (
    find_measured_mount,
    find_pointing_error_rad,
    list_known_burns,
)
from rso_lidar.evaluation.track_quality.range_noise import estimate_range_noise_m
from rso_lidar.evaluation.track_quality.tracking_figure import TRACKED_QUANTITIES, tracking_figure
from rso_lidar.orbit import elements_from_state
from rso_lidar.picture import SavedResult
from rso_lidar.pose import ROOT, cross, quaternion_xyzw, rotate_vectors
from rso_lidar.records import Frame, Truth
from rso_lidar.rpo import CentroidWander, SensorBias
from rso_lidar.scenario import Scenario, list_lunar_bodies
from rso_lidar.track import (
    Alignment,
    Fix,
    MeshHinge,
    PoseFollower,
    SampledMesh,
    Track,
    filter_positions,
    locate_centroid,
    measure_visible_centroid,
)

if TYPE_CHECKING:
    from scipy.spatial.transform import RigidTransform, Rotation


@dataclass(frozen=True, eq=False)
class Tracking(SavedResult):
    """Estimates and errors of the reference trackers: `table` holds columns (time) by name, with units in the names.

    `tracks` are the filters: ``cv`` in axes that do not rotate and, in orbit, ``cw`` in the follower's rtn axes, both with
    the follower's origin. `hinges` are those of the target whose angles ICP estimates. Errors are estimate minus truth of
    the target's origin, in lidar axes; those of hinge angles are from -pi to pi.

    Columns of `table`, NaN where there is no estimate: ``time_s``; ``points`` of the centroid and ``found_fraction``,
    the share of the target's pixels that returned; ``true_range_m`` and ``centroid_range_m``; ``centroid_right_m``,
    ``_down_m`` and ``_ahead_m``, in lidar axes, and their errors ``centroid_error_right_m`` and so on. Of the filters
    ``cv`` and ``cw``: ``cv_x_m`` and ``cv_velocity_x_m_s`` in the axes of the filter, their errors in lidar axes
    (``cv_error_right_m``), ``cv_nis``, and where they estimate slow errors, ``cv_bias_range_m`` with its standard
    deviation ``cv_bias_range_sigma_m`` and so on. Of ICP: ``icp_right_m``, ``icp_quaternion_x`` to ``_w`` of
    lidar_from_target, the rms distance ``icp_rms_m`` of points from the model, and the errors ``icp_error_m``,
    ``icp_error_rad`` (the whole turn, symmetry not considered) and ``icp_long_axis_error_rad``.

    `AXES` are the words for the lidar axes in names of columns, and `FILTERS` the names of the filters in words.
    """

    AXES: ClassVar[tuple[str, ...]] = ("right", "down", "ahead")
    FILTERS: ClassVar[Mapping[str, str]] = TRACKED_QUANTITIES

    title: str
    target: str
    table: dict[str, np.ndarray]
    tracks: dict[str, Track]
    range_noise_m: float
    acceleration_m_s2_sqrt_hz: float
    hinges: tuple[str, ...] = ()

    def figure(self) -> Any:
        """Return a matplotlib Figure: errors of centroid and filters, NIS with its bounds, and errors of ICP."""
        note = f"range noise {self.range_noise_m:.3g} m, process noise {self.acceleration_m_s2_sqrt_hz:g} m/s²/√Hz"
        return tracking_figure(self.table, tuple(self.tracks), self.target, self.title, note)

    def columns(self) -> dict[str, np.ndarray]:
        """Return the columns of the table by name."""
        return self.table


def tracking(
    frames: Sequence[Frame],
    target: str | None = None,
    *,
    folder: Path | None = None,
    range_noise_m: float | None = None,
    acceleration_m_s2_sqrt_hz: float = 1e-4,
    shape: bool = True,
    poses: bool = True,
    hinges: bool = True,
    bias: SensorBias | None = None,
    centroid: CentroidWander | None = None,
    each: Iterable[Frame] | None = None,
) -> Tracking:
    """Run centroid, Kalman filters and ICP on a recording.

    Parameters
    ----------
    frames : a recording, or frames of one scenario in the order of time
    target : name of the target (None: the first); other targets in the field disturb these trackers
    folder : folder of the mesh files that the scenario names (None: the working folder)
    range_noise_m : standard deviation of one range [m] (None: from the recorded returns, simulated again on the detector)
    acceleration_m_s2_sqrt_hz : process noise of the filters, each axis [m/s²/√Hz]
    shape : whether the filters correct for the target's shape. They then use the mean and the spread of the distance
        between the visible middle and the target's origin, over all directions. That error varies slowly and is not white
        noise, so that NIS is below 3 at most frames. Otherwise the filters follow the visible middle
    poses : whether ICP runs
    hinges : whether ICP estimates the angles of the target's hinges; otherwise it assumes those of the mesh
    bias : bias of ranges and of the boresight that the filters estimate (None: they assume none)
    centroid : wander of the centroid that the filters estimate, in place of the spread over all directions (None: none)
    each : iterator over the same frames that reports progress (None: `frames`)

    Returns
    -------
    Tracking
        Table of estimates and errors.

    Raises
    ------
    RecordingError
        For a recording without frames or without the target, and for another mesh than the recorded one.
    """
    if not len(frames):
        raise RecordingError("track: the recording has no frames; record some")
    source = frames[0].source
    scenario = load_scenario(source, folder)
    number = find_recorded_target(source, target, "track")
    name = source.targets[number].name
    load_surfaces(scenario, source, number, "track")  # raises where the mesh is not the recorded one
    model = sample_target(scenario, number, hinged=hinges)
    size_m = 2.0 * model.radius_m
    noise_m = estimate_range_noise_m(scenario.instrument, frames) if range_noise_m is None else range_noise_m
    follow = PoseFollower(model) if poses else None
    wander = measure_visible_centroid(model) if shape else (0.0, 0.0, 0.0)
    if centroid is not None:
        wander = (wander[0], 0.0, 0.0)
    rows = [
        _evaluate_frame(scenario, frame, name, size_m, noise_m, wander, follow)
        for frame in (frames if each is None else each)
    ]
    time_s = np.array([row.time_s for row in rows])
    burns = list_known_burns(scenario, time_s)
    table = _tabulate(rows, model)
    tracks = {}
    for kind, mean_motion in _choose_filters(
        frames[0], local=scenario.is_local or bool(list_lunar_bodies(scenario.located_bodies))
    ).items():
        track = tracks[kind] = filter_positions(
            time_s,
            np.array([row.place_m(kind) for row in rows]),
            np.array([row.spread_m2(kind) for row in rows]),
            mean_motion_rad_s=mean_motion,
            acceleration_m_s2_sqrt_hz=acceleration_m_s2_sqrt_hz,
            kicks=[(burn.time_s, -rows[k].from_rtn(kind).apply(burn.delta_v_m_s)) for burn, k in burns],
            bias=bias,
            centroid=centroid,
        )
        table |= _tabulate_errors(kind, track, rows)
    known = tuple(hinge.name for hinge in model.hinges) if "icp_error_rad" in table else ()
    return Tracking(source.title, name, table, tracks, noise_m, acceleration_m_s2_sqrt_hz, known)


def _choose_filters(first: Frame, *, local: bool) -> dict[str, float | None]:
    """Return the filters by name, each with the mean motion [rad/s] of the follower's orbit, None for none."""
    if local:
        return {"cv": None}
    own = first.truth.states["follower"]
    period_s = float(elements_from_state(own.position_m, own.velocity_m_s).period_s)
    return {"cv": None, "cw": 2.0 * np.pi / period_s}


# -------------------------------------------------------------------------------------------------- frame by frame


@dataclass(frozen=True, eq=False)
class _EvaluatedFrame:
    """One frame: the measurement, the pose of the lidar in each filter's axes, and the truth of the target there.

    `middle_m` (xyz) and `covariance_m2` (3, 3) in lidar axes are the measurement of the filters. `seat` is
    follower_from_lidar from the encoders. `turns` (axes_from_follower), `true_m` and `true_m_s` (xyz) are by filter,
    `true_hinges_rad` by hinge of the mesh.
    """

    time_s: float
    fix: Fix | None  # without its points, of which a long run has many
    points: int
    middle_m: np.ndarray
    covariance_m2: np.ndarray
    seat: RigidTransform
    turns: dict[str, Rotation]
    true_m: dict[str, np.ndarray]
    true_m_s: dict[str, np.ndarray]
    true_pose: RigidTransform
    true_hinges_rad: np.ndarray
    found: Alignment | None

    def lidar_from(self, kind: str) -> Rotation:
        """Return the rotation lidar_from_axes of a filter's axes."""
        return (self.turns[kind] * self.seat.rotation).inv()

    def from_rtn(self, kind: str) -> Rotation:
        """Return the rotation axes_from_rtn, from the follower's rtn axes into a filter's."""
        return self.turns[kind] * self.turns["cw"].inv()

    def place_m(self, kind: str) -> np.ndarray:
        """Return the measured position (xyz) [m] relative to the follower, in a filter's axes; NaN without one."""
        place: np.ndarray = self.turns[kind].apply(self.seat.apply(self.middle_m))
        return place

    def spread_m2(self, kind: str) -> np.ndarray:
        """Return the covariance (3, 3) [m²] of that position."""
        turn = self.lidar_from(kind).inv().as_matrix()
        spread: np.ndarray = np.einsum("ij,jk,lk->il", turn, self.covariance_m2, turn)
        return spread


def _evaluate_frame(
    scenario: Scenario,
    frame: Frame,
    name: str,
    size_m: float,
    noise_m: float,
    wander: tuple[float, float, float],
    follow: PoseFollower | None,
) -> _EvaluatedFrame:
    """Measure the target in one frame.

    Parameters
    ----------
    size_m : greatest extent of the target [m]
    noise_m : standard deviation of a range [m]
    wander : offset of the visible centroid along the line of sight, its standard deviation, and rms across it [m]
    follow : ICP; None to omit it
    """
    truth, settings = frame.truth, frame.observation.settings
    pixel_rad = scenario.lidar.receiver.pixel_pitch_m / settings["focal_length_m"]
    fix = locate_centroid(frame.points_m, pixel_rad=pixel_rad, range_noise_m=noise_m, gate_m=size_m)
    seat = find_measured_mount(scenario, frame.observation)
    own = truth.pose(ROOT, "follower").rotation
    turns = {"cv": own}
    link, turning = truth.poses.link("follower", name), truth.rates(ROOT, "follower")[1]
    true_m = {"cv": rotate_vectors(own, link.translation_m)}
    true_m_s = {"cv": rotate_vectors(own, link.velocity_m_s + cross(turning, link.translation_m))}
    if not scenario.is_local:
        in_rtn = truth.poses.link("follower.rtn", name)
        turns["cw"] = truth.pose("follower.rtn", "follower").rotation
        true_m["cw"], true_m_s["cw"] = in_rtn.translation_m, in_rtn.velocity_m_s
    alignment, middle, covariance = None, np.full(3, np.nan), np.eye(3)
    if fix is not None:
        alignment = follow(truth.time_s, fix.points_m, own * seat.rotation, _half_field_rad(frame)) if follow else None
        toward = fix.position_m / fix.range_m
        ahead = np.outer(toward, toward)
        before_m, along_m, across_m = wander
        middle = fix.position_m - before_m * toward
        across_m = float(np.hypot(across_m, find_pointing_error_rad(scenario) * fix.range_m))
        covariance = fix.covariance_m2 + along_m**2 * ahead + across_m**2 * (np.eye(3) - ahead)
    kept = None if fix is None else replace(fix, points_m=fix.points_m[:0].copy())
    points, pose = 0 if fix is None else len(fix.points_m), truth.pose("lidar", name)
    hinges_rad = _measure_hinges_rad(truth, name, follow.model.hinges if follow else ())
    return _EvaluatedFrame(
        truth.time_s, kept, points, middle, covariance, seat, turns, true_m, true_m_s, pose, hinges_rad, alignment
    )


def _measure_hinges_rad(truth: Truth, target: str, hinges: tuple[MeshHinge, ...]) -> np.ndarray:
    """Return the true angles (hinge) [rad] of a target's hinges, from -pi to pi."""
    turns = [truth.pose(target, f"{target}.{hinge.name}").rotation.as_rotvec() @ hinge.direction for hinge in hinges]
    return np.array(turns, dtype=float)


def _half_field_rad(frame: Frame) -> tuple[float, float]:
    """Return half width and half height of the field of view [rad], from the lines of sight of its pixels."""
    across = np.abs(frame.line_of_sight[..., :2] / frame.line_of_sight[..., 2:])
    n_rows, n_cols = across.shape[:2]
    width, height = across.max(axis=(0, 1)) * (
        n_cols / max(n_cols - 1, 1),
        n_rows / max(n_rows - 1, 1),
    )  # to the pixels' edges
    return float(np.arctan(width)), float(np.arctan(height))


def _tabulate(rows: Sequence[_EvaluatedFrame], model: SampledMesh) -> dict[str, np.ndarray]:
    """Tabulate measurements and estimated poses (time) with their errors."""
    middle = np.array([np.full(3, np.nan) if row.fix is None else row.fix.position_m for row in rows])
    true = np.array([row.true_pose.translation for row in rows])
    table = {
        "time_s": np.array([row.time_s for row in rows]),
        "points": np.array([row.points for row in rows]),
        "found_fraction": np.array([np.nan if row.fix is None else row.fix.found_fraction for row in rows]),
        "true_range_m": np.linalg.norm(true, axis=1),
        "centroid_range_m": np.linalg.norm(middle, axis=1),
    }
    table |= _vector_columns("centroid", middle, "_m") | _vector_columns("centroid_error", middle - true, "_m")
    if not any(row.found for row in rows):
        return table
    nothing = np.full(11, np.nan)
    columns = np.array(
        [nothing if row.found is None else _compare_alignment(row.found, row.true_pose, model) for row in rows]
    )
    table |= _vector_columns("icp", columns[:, :3], "_m")
    table |= {f"icp_quaternion_{axis}": columns[:, 3 + k] for k, axis in enumerate("xyzw")}
    names = ("icp_rms_m", "icp_error_m", "icp_error_rad", "icp_long_axis_error_rad")
    table |= {column: columns[:, 7 + k] for k, column in enumerate(names)}
    return table | _tabulate_hinges(rows, model)


def _tabulate_hinges(rows: Sequence[_EvaluatedFrame], model: SampledMesh) -> dict[str, np.ndarray]:
    """Tabulate the angles (time) of each hinge [rad] with standard deviations and errors."""
    table = {}
    for number, hinge in enumerate(model.hinges):
        estimates = [(row.found.hinge_angles_rad, row.found.hinge_sigmas_rad) if row.found else None for row in rows]
        angle, sigma = (
            np.array([estimate[k][hinge.name] if estimate else np.nan for estimate in estimates]) for k in (0, 1)
        )
        error = angle - np.array([row.true_hinges_rad[number] for row in rows])
        column = f"icp_hinge_{hinge.name}"
        table[f"{column}_rad"], table[f"{column}_sigma_rad"] = angle, sigma
        table[f"{column}_error_rad"] = np.arctan2(np.sin(error), np.cos(error))
    return table


def _compare_alignment(alignment: Alignment, true: RigidTransform, model: SampledMesh) -> np.ndarray:
    """Return position and quaternion of lidar_from_body, rms [m], and errors of position [m], turn and long axis [rad]."""
    place, rotation = alignment.pose.translation, alignment.pose.rotation
    ours, theirs = rotation.apply(model.long_axis), true.rotation.apply(model.long_axis)
    axis_rad = np.arctan2(np.linalg.norm(np.cross(ours, theirs)), np.dot(ours, theirs))
    turn_rad = (rotation.inv() * true.rotation).magnitude()
    apart_m = np.linalg.norm(place - true.translation)
    return np.array([*place, *quaternion_xyzw(rotation), alignment.rms_m, apart_m, turn_rad, axis_rad])


def _vector_columns(name: str, values: np.ndarray, unit: str) -> dict[str, np.ndarray]:
    """Return the three columns of vectors (time, 3) by name."""
    return {f"{name}_{axis}{unit}": column for axis, column in zip(Tracking.AXES, values.T, strict=True)}


def _tabulate_errors(kind: str, track: Track, rows: Sequence[_EvaluatedFrame]) -> dict[str, np.ndarray]:
    """Tabulate a filter's estimates in its own axes, its errors in lidar axes, and its NIS."""
    table = {}
    for values, word, unit, true in (
        (track.position_m, "", "_m", [row.true_m[kind] for row in rows]),
        (track.velocity_m_s, "_velocity", "_m_s", [row.true_m_s[kind] for row in rows]),
    ):
        for axis, column in zip("xyz", values.T, strict=True):
            table[f"{kind}{word}_{axis}{unit}"] = column
        off = values - np.array(true)
        seen = np.array([row.lidar_from(kind).apply(error_m) for row, error_m in zip(rows, off, strict=True)])
        table |= _vector_columns(f"{kind}{word}_error", seen, unit)
    for name, values in track.slow.items():
        stem, unit = name.rsplit("_", 1)
        table |= {f"{kind}_{name}": values, f"{kind}_{stem}_sigma_{unit}": track.slow_sigma[name]}
    return table | {f"{kind}_nis": track.nis}
