"""Frames written in any format: those of `export`, and those that require time scales and the Earth."""

from __future__ import annotations

import datetime
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar import orbit
from rso_lidar.detector import ReportWords
from rso_lidar.errors import RecordingError, RsoLidarError, did_you_mean, suppress_warnings, warn
from rso_lidar.evaluation.orbit_determination.tracking_data import save_tracking_data
from rso_lidar.evaluation.recorded_runs.flown_scenario import load_scenario
from rso_lidar.export import (
    Frames,
    Recording,
    format_for,
    peek_source,
    read_truth,
    write_raster,
    writer_for,
)
from rso_lidar.files import check_writable, convert_path
from rso_lidar.mission_analysis import choose_globe_samples, find_velocity_jumps_s, write_globe
from rso_lidar.motion import write_aem
from rso_lidar.orbit import write_oem
from rso_lidar.part import parse_toml
from rso_lidar.pose import ROOT
from rso_lidar.records import Frame, Source

_TABLES = ("csv", "parquet")  # written with UTC, which needs time scales


def save(
    path: str | os.PathLike[str], frames: Iterable[Frame], *, overwrite: bool = False, format: str = "", **options: Any
) -> Path:
    """Write frames to a file or folder as they arrive, and return its path.

    The suffix selects the format. .h5 and .nc are recordings that `open` reads and that hold everything in the frames;
    docs/exports.md lists the contents of the others. .zarr, .pcd, .ply, .bop, .png and .rosbag2 name folders. The file
    appears under its name when it is complete. `rso-lidar export` has the same suffixes.

    Parameters
    ----------
    path : of the file or folder
    frames : from `simulate` or `open`
    overwrite : whether an existing file or folder may be replaced
    format : name of the format, where the suffix does not give it

    Other Parameters
    ----------------
    options : of that format, such as ``viewpoint="tdrs"`` of pcd, ``target="tdrs"`` of tum, kitti, tdm, oem (a body; the
        follower if left out) and aem (any axes), ``sensor="gyro"`` of csv and parquet (the truth if left out),
        ``frame_stride_bytes=66_960``, ``header_bytes``, ``frame_header_bytes`` and ``report`` (that of the scenario if left
        out) of raster

    Returns
    -------
    Path
        Of the file or folder.

    Raises
    ------
    RecordingError
        For an unknown suffix, a path that may not be written, and frames that the format cannot hold.
    """
    path = convert_path(path, RecordingError)
    wanted = format_for(format or path)
    if wanted.writer and wanted.name not in _TABLES:
        return writer_for(wanted.name)(path, frames, overwrite=overwrite, **options)
    place = check_writable(path, overwrite=overwrite)
    source, frames = peek_source(place, frames)
    if wanted.name in _TABLES:
        texts = _utc_formatter(source)
        return writer_for(wanted.name)(place, frames, utc=texts, overwrite=overwrite, **options)
    scenario = parse_toml(source.scenario, "recording", RecordingError)
    if wanted.name == "raster":
        return _write_reports(place, frames, scenario, **options)
    if scenario.get("world", {}).get("axes") == "local":
        raise RecordingError(f"{place.name}: a local world has no Earth to give positions about; write a .csv")
    if wanted.name == "czml":
        return _write_czml(place, frames, source, **options)
    if wanted.name == "tdm":
        some = frames if isinstance(frames, Frames) else frames[:] if isinstance(frames, Recording) else list(frames)
        return save_tracking_data(place, some, folder=_find_folder(some), overwrite=overwrite, **options)
    write = {"oem": _write_oem, "aem": _write_aem}[wanted.name]
    return write(place, frames, source, **options)


def _write_reports(
    place: Path, frames: Iterable[Frame], scenario: dict[str, Any], *, report: ReportWords | None = None, **lengths: Any
) -> Path:
    """Write the words in which the camera of a scenario, or another one, reports each frame."""
    table = scenario.get("lidar", {}).get("detector", {})
    stated = table.get("report") if isinstance(table, dict) else None
    used = ReportWords(**stated) if report is None and stated is not None else report
    if used is None:
        raise RecordingError(
            f"{place.name}: the detector of this recording states no words of its own; add [lidar.detector.report] to the "
            "scenario and run it, or give rso_lidar.save report=rso_lidar.detector.ReportWords()"
        )

    def encode(frame: Frame) -> np.ndarray:
        return used.encode(frame.observation.reading)

    return write_raster(place, frames, encode, overwrite=True, **lengths)


def _utc_formatter(source: Source) -> Any:
    """Return a function that formats times [s since the start] as ISO UTC texts to the microsecond, with leap seconds."""
    start_utc = _parse_start(source)
    return lambda time_s: np.array(orbit.Epochs(start_utc, time_s).skyfield_time().utc_iso(places=6))


def _parse_start(source: Source) -> datetime.datetime:
    return datetime.datetime.fromisoformat(source.start_utc)


def _write_oem(place: Path, frames: Iterable[Frame], source: Source, target: str | None = None) -> Path:
    """Write the states of a target, or of the follower, as an OEM, with a new segment at each impulse."""
    folder = _find_folder(frames)
    truth = read_truth(frames)
    name = _check_name(target, list(truth.states))
    breaks = _find_breaks_s(source, name, truth.time_s, folder)
    epochs = orbit.Epochs(_parse_start(source), truth.time_s)
    return write_oem(place, name, name, epochs, truth.states[name], breaks_s=breaks, overwrite=True)


def _write_aem(place: Path, frames: Iterable[Frame], source: Source, target: str | None = None) -> Path:
    """Write the attitude of a target, or of the follower, relative to inertial axes as an AEM."""
    from scipy.spatial.transform import Rotation

    truth = read_truth(frames)
    name = _check_name(target, list(truth.poses))
    turned = np.broadcast_to(truth.pose(ROOT, name).rotation.as_matrix(), (truth.time_s.size, 3, 3))
    epochs = orbit.Epochs(_parse_start(source), truth.time_s)
    return write_aem(place, name, name, epochs, Rotation.from_matrix(turned), overwrite=True)


def _write_czml(place: Path, frames: Iterable[Frame], source: Source) -> Path:
    """Write bodies, lines of sight and boresight for a globe, reduced to a number of epochs that viewers play smoothly."""
    if isinstance(frames, Recording):
        frames = frames[:]
    if isinstance(frames, Frames):  # so that no other frame is read
        chosen = [frames.places[k] for k in choose_globe_samples(len(frames)).tolist()]
        truth = read_truth(Frames(frames.recording, chosen))
    else:
        truth = read_truth(frames, choose_globe_samples)
    targets = [target.name for target in source.targets]
    return write_globe(place, source.title, _parse_start(source), targets, truth)


def _check_name(name: str | None, known: list[str]) -> str:
    """Return the name of a body or of axes, by default the follower's, or raise `RecordingError`."""
    wanted = "follower" if name is None else name
    if wanted not in known:
        guess = did_you_mean(wanted, known)
        raise RecordingError(
            f"--target {wanted}: nothing of that name can be written{guess} (known: {', '.join(known)})"
        )
    return wanted


def _find_folder(frames: Iterable[Frame]) -> Path | None:
    """Return the folder of a recording, which holds the files that its scenario names; None without a file."""
    recording = frames.recording if isinstance(frames, Frames) else frames
    return recording.path.parent if isinstance(recording, Recording) else None


def _find_breaks_s(source: Source, name: str, time_s: np.ndarray, folder: Path | None) -> list[float]:
    """Find the times [s] of impulses with at least two of the times (time) [s] on either side."""
    try:
        with suppress_warnings():
            planned = sorted(find_velocity_jumps_s(load_scenario(source, folder), name))
    except (RsoLidarError, OSError):  # axes without a motion, or missing files
        planned = []
    edges: list[float] = []
    low = 0
    for at in planned:
        place = int(np.searchsorted(time_s, at))
        if not 0 < place < time_s.size:
            continue
        if place - low < 2 or time_s.size - place < 2:
            warn(f"{name}: the impulse at {at:g} s has fewer than two frames beside it and is not marked")
            continue
        edges.append(at)
        low = place
    return edges
