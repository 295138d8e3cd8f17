"""Trajectories and tables: TUM and KITTI poses of one target; the truth, or samples of a sensor, as CSV and Parquet.

TUM is the format of the RGB-D benchmark of TU Munich: time tx ty tz qx qy qz qw. KITTI is that of the KITTI odometry
benchmark: the 12 numbers of a 3 x 4 matrix, row by row. Trajectory evaluators read both.
"""

from __future__ import annotations

import csv
import datetime
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TextIO

import numpy as np

from rso_lidar.errors import RecordingError, did_you_mean
from rso_lidar.export.formats.parquet import check_parquet, write_parquet
from rso_lidar.export.formats.truth_batches import TruthBatch, peek_source, read_truth_batches
from rso_lidar.export.layout.datasets import split_unit
from rso_lidar.export.reader.recording import Frames, Recording
from rso_lidar.files import check_stream, check_writable, write_atomically
from rso_lidar.pose import quaternion_xyzw
from rso_lidar.records import Frame, SensorSamples, Source, Truth, join_samples, specs, tabulate_truth
from rso_lidar.units import NS_PER_S

_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
Utc = Callable[[np.ndarray], np.ndarray]  # instants [s since start_utc]: as text
_AXES = {"xyz": "xyz", "quaternion": "xyzw"}  # names of the places along a dimension


def write_tum(
    path: str | os.PathLike[str],
    frames: Iterable[Frame],
    *,
    target: str | None = None,
    lidar_in_target: bool = False,
    overwrite: bool = False,
) -> Path:
    """Write a TUM trajectory: time_s, position [m] and quaternion (x, y, z, w) of a target in lidar axes.

    Parameters
    ----------
    frames : from `simulate` or `open`
    target : name of the target or of any axes; optional if there is one target
    lidar_in_target : write the lidar's poses in the target's axes instead
    """
    with _open_text(path, frames, overwrite) as (file, source, courses):
        name, a, b = _resolve_axes(source, target, lidar_in_target)
        file.write(f"# {b} in {a} axes [m], {a}_from_{b} as x, y, z, w\n")
        file.write(
            f"# seconds since {source.start_utc}, which is {to_stamp_ns(source.start_utc, 0.0) // NS_PER_S} s since 1970\n"
        )
        file.write("# time tx ty tz qx qy qz qw\n")
        for truth, _ in courses:
            translation, quaternion, _ = _compute_poses(truth, name, a, b)
            for time_s, where, turn in zip(truth.time_s.tolist(), translation, quaternion, strict=True):
                cells = (*(f"{value:.9f}" for value in where), *(f"{value:.15f}" for value in turn))
                file.write(f"{time_s:.9f} {' '.join(cells)}\n")
    return Path(path)


def write_kitti(
    path: str | os.PathLike[str],
    frames: Iterable[Frame],
    *,
    target: str | None = None,
    lidar_in_target: bool = False,
    overwrite: bool = False,
) -> Path:
    """Write a KITTI trajectory: in each line the 3 x 4 matrix lidar_from_target [m], row by row, without times.

    Parameters
    ----------
    frames : from `simulate` or `open`
    target : name of the target or of any axes; optional if there is one target
    lidar_in_target : write the lidar's poses in the target's axes instead
    """
    with _open_text(path, frames, overwrite) as (file, source, courses):
        name, a, b = _resolve_axes(source, target, lidar_in_target)
        for truth, _ in courses:
            translation, _, matrix = _compute_poses(truth, name, a, b)
            rows = np.concatenate([matrix, translation[..., None]], axis=-1).reshape(-1, 12)
            file.writelines(" ".join(f"{value:.15e}" for value in row) + "\n" for row in rows.tolist())
    return Path(path)


def write_csv(
    path: str | os.PathLike[str],
    frames: Iterable[Frame],
    *,
    sensor: str | None = None,
    utc: Utc | None = None,
    overwrite: bool = False,
) -> Path:
    """Write the truth as a table with the columns of `rso-lidar truth`, one row per frame, at full precision.

    Parameters
    ----------
    frames : from `simulate` or `open`
    sensor : name of a sensor whose samples are written instead, one row per sample
    utc : formats times [s since start_utc] as UTC text; without it, a leap second during the run is not counted
    """
    place = check_writable(path, overwrite=overwrite)
    source, frames = peek_source(place, frames)
    with write_atomically(place) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        for number, table in enumerate(_tabulate(place, frames, source, sensor, utc)):
            check_stream(file, draft, place)
            if number == 0:
                writer.writerow(table)
            writer.writerows(zip(*(values.tolist() for values in table.values()), strict=True))
        check_stream(file, draft, place)
    return place


def write_table(
    path: str | os.PathLike[str],
    frames: Iterable[Frame],
    *,
    sensor: str | None = None,
    utc: Utc | None = None,
    overwrite: bool = False,
) -> Path:
    """Write the table of `write_csv` as a Parquet file.

    Parameters
    ----------
    frames, sensor, utc : as for `write_csv`
    """
    place = check_writable(path, overwrite=overwrite)
    check_parquet(place)
    source, frames = peek_source(place, frames)
    tables = list(_tabulate(place, frames, source, sensor, utc))
    table = {name: np.concatenate([columns[name] for columns in tables]) for name in tables[0]}
    metadata = {
        "title": source.title,
        "start_utc": source.start_utc,
        "scenario": source.scenario,
        "seed": str(source.seed),
    }
    return write_parquet(place, table, metadata | ({"sensor": sensor} if sensor else {}))


def _tabulate(
    place: Path, frames: Iterable[Frame], source: Source, sensor: str | None, utc: Utc | None
) -> Iterator[dict[str, np.ndarray]]:
    """Yield the truth of frames, or the samples of a sensor, as tables with the same columns.

    Parameters
    ----------
    sensor : name of the sensor (None: the truth)
    utc : formats times as text (None: without leap seconds)
    """
    format_utc = utc or partial(_format_utc, source.start_utc)
    if sensor is not None:
        samples = _read_samples(frames, sensor)
        yield _tabulate_samples(samples, format_utc(samples.time_s) if samples.time_s.size else np.empty(0, str))
        return
    targets = [target.name for target in source.targets]
    head: list[str] = []
    for truth, angles in read_truth_batches(frames):
        table = tabulate_truth(truth, targets, format_utc(truth.time_s), angles)
        head = head or list(table)
        if list(table) != head:
            raise RecordingError(f"{place}: frames differ in what they know of the truth; export them apart")
        yield table


def to_stamp_ns(start_utc: str, time_s: float) -> int:
    """Return a time as nanoseconds since 1970 in POSIX time, which counts no leap seconds.

    Parameters
    ----------
    start_utc : start of the run, ISO 8601 with an offset
    time_s : since the start [s]

    Raises
    ------
    RecordingError
        If `start_utc` has no offset.

    Examples
    --------
    >>> to_stamp_ns("2024-09-17T12:00:00Z", 0.05)
    1726574400050000000
    """
    start = datetime.datetime.fromisoformat(start_utc)
    if start.tzinfo is None:
        raise RecordingError(f"start_utc: {start_utc} has no offset; record the frames again")
    whole, fraction = divmod(time_s, 1.0)
    return (
        (start - _EPOCH) // datetime.timedelta(microseconds=1) * 1000
        + int(whole) * NS_PER_S
        + round(fraction * NS_PER_S)
    )


@contextmanager
def _open_text(
    path: str | os.PathLike[str], frames: Iterable[Frame], overwrite: bool
) -> Iterator[tuple[TextIO, Source, Iterator[TruthBatch]]]:
    """Yield a text file that appears when it is complete, the source of the frames, and their truth in batches."""
    place = check_writable(path, overwrite=overwrite)
    source, frames = peek_source(place, frames)
    with write_atomically(place) as draft, draft.open("w", encoding="utf-8", newline="") as file:

        def checked() -> Iterator[TruthBatch]:
            for course in read_truth_batches(frames):
                check_stream(file, draft, place)
                yield course

        yield file, source, checked()
        check_stream(file, draft, place)


def _resolve_axes(source: Source, target: str | None, lidar_in_target: bool) -> tuple[str, str, str]:
    """Return the name of the target axes, and a and b of the poses a_from_b to write.

    Parameters
    ----------
    target : name given by the user; None for the only target
    """
    known = [entry.name for entry in source.targets]
    if target is None:
        if len(known) != 1:
            which = f"there are {len(known)} ({', '.join(known)})" if known else "the recording has none"
            raise RecordingError(f"target: {which}; name one with --target (target=...)")
        target = known[0]
    return target, *((target, "lidar") if lidar_in_target else ("lidar", target))


def _compute_poses(truth: Truth, name: str, a: str, b: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a_from_b as translations (time, 3) [m], quaternions (time, 4) and matrices (time, 3, 3).

    Parameters
    ----------
    a, b : names of the axes
    """
    known = list(truth.poses)
    if name not in known:
        guess = did_you_mean(name, known)
        raise RecordingError(
            f"--target {name}: nothing in the recording has that name{guess} (known: {', '.join(known)})"
        )
    pose = truth.pose(a, b)
    n = truth.time_s.size
    quaternion = np.broadcast_to(quaternion_xyzw(pose.rotation), (n, 4))
    return (
        np.broadcast_to(pose.translation, (n, 3)),
        quaternion,
        np.broadcast_to(pose.rotation.as_matrix(), (n, 3, 3)),
    )


def _format_utc(start_utc: str, time_s: np.ndarray) -> np.ndarray:
    """Format times as ISO UTC text with microseconds."""
    start = datetime.datetime.fromisoformat(start_utc).astimezone(datetime.UTC)
    texts = [(start + datetime.timedelta(microseconds=round(at * 1e6))).isoformat("T", "microseconds") for at in time_s]
    return np.array([text.replace("+00:00", "Z") for text in texts], dtype=str)


def _read_samples(frames: Iterable[Frame], sensor: str) -> SensorSamples:
    """Return the samples of a sensor in frames, as one series; of a recording, no image is read.

    Parameters
    ----------
    frames : from `simulate` or `open`, at least one

    Raises
    ------
    RecordingError
        If there is no such sensor.
    """
    if isinstance(frames, Recording):
        frames = frames[:]
    samples_by_frame: list[Mapping[str, SensorSamples]]
    if isinstance(frames, Frames):
        samples_by_frame = [frames.recording.read_samples(frames.recording.place(k)) for k in frames.places]
    else:
        samples_by_frame = [frame.observation.sensors for frame in frames]
    known = samples_by_frame[0]
    if sensor not in known:
        guess = did_you_mean(sensor, known)
        listed = f"{guess or ';'} (known: {', '.join(known)})" if known else "; the frames have no sensors"
        raise RecordingError(f"--sensor {sensor}: there is no sensor of that name{listed}")
    return join_samples([{sensor: some[sensor]} for some in samples_by_frame])[sensor]


def _tabulate_samples(samples: SensorSamples, utc: np.ndarray) -> dict[str, np.ndarray]:
    """Tabulate samples: columns (sample) by name, with units in the names.

    Parameters
    ----------
    utc : the instants at which they hold, as text (sample)

    Returns
    -------
    The columns. A vector has a column for each axis (``angular_velocity_x_rad_s``), other arrays one for each place
    (``force_0_n``). ``utc`` is text.
    """
    table = {"time_s": samples.time_s, "utc": utc}
    for field, spec in specs(type(samples)).items():
        values = getattr(samples, field)
        if values is None or field == "time_s":
            continue
        stem, unit = split_unit(field.removesuffix("_xyzw") if spec.dims[-1] == "quaternion" else field)
        places = [_AXES.get(dim, range(size)) for dim, size in zip(spec.dims[1:], values.shape[1:], strict=True)]
        for place in np.ndindex(values.shape[1:]):
            words = (str(names[k]) for names, k in zip(places, place, strict=True))
            table[re.sub("_+", "_", "_".join([stem, *words, unit])).strip("_")] = values[(slice(None), *place)]
    return table
