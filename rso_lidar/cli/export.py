"""`rso-lidar export`: a recording written in the format of another tool."""

import datetime
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from rso_lidar import export as files
from rso_lidar import orbit
from rso_lidar.cli.completion import format_names
from rso_lidar.cli.globe import globe
from rso_lidar.cli.outputs import Overwrite
from rso_lidar.cli.progress import counted
from rso_lidar.cli.recordings import RecordingFile, held_bytes, places
from rso_lidar.cli.terminal import echo
from rso_lidar.draft import free
from rso_lidar.errors import RecordingError, RsoLidarError, did_you_mean, unwarned, warn
from rso_lidar.export.course import courses, whole
from rso_lidar.export.czml import thinned, write_czml
from rso_lidar.export.formats import FORMATS, Format, format_for, writer_for
from rso_lidar.motion.aem import write_aem
from rso_lidar.orbit.oem import write_oem
from rso_lidar.pose import ROOT
from rso_lidar.records import BodyState, Source
from rso_lidar.study.recorded import scenario_of
from rso_lidar.study.timeline import breaks_s
from rso_lidar.toml_text import parse_toml

_OF_A_TARGET = ("tum", "kitti")
_OF_A_BODY = ("oem", "aem")
_QUICK = ("tum", "kitti", "csv", "oem", "aem", "czml")  # read no image


def export(
    recording: RecordingFile,
    to: Annotated[Path, typer.Option("--to", help="What to write; a folder for formats of one file a frame.")],
    form: Annotated[
        str | None,
        typer.Option(
            "--format",
            metavar="NAME",
            help=f"Instead of the suffix: {', '.join(FORMATS)}.",
            autocompletion=format_names,
        ),
    ] = None,
    frames: Annotated[
        str | None,
        typer.Option(
            "--frames",
            metavar="A:B",
            help="Frames A to B-1 only, by number in the scenario; a third number after another colon is the step.",
        ),
    ] = None,
    target: Annotated[
        str | None,
        typer.Option(
            "--target", metavar="NAME", help="Target of a tum or kitti; body of an oem or aem (the follower)."
        ),
    ] = None,
    lidar_in_target: Annotated[
        bool, typer.Option("--lidar-in-target", help="tum, kitti: the lidar in the target's axes, not the reverse.")
    ] = False,
    overwrite: Overwrite = False,
) -> None:
    """Write a recording in another format, and say what that loses."""
    wanted = format_for(form or to)
    if target is not None and wanted.name not in _OF_A_TARGET + _OF_A_BODY:
        raise RecordingError(f"--target {target}: is for tum, kitti, oem and aem; leave it out of a {wanted.name}")
    if lidar_in_target and wanted.name not in _OF_A_TARGET:
        raise RecordingError(f"--lidar-in-target: is for tum and kitti; leave it out of a {wanted.name}")
    if to.exists() and to.resolve() == recording.resolve():
        raise RecordingError(f"{to}: is the recording itself; give another name")
    with files.open(recording) as read:
        chosen = files.Frames(read, places(read, frames))
        options: dict[str, Any] = {"target": target, "lidar_in_target": lidar_in_target}
        if wanted.name == "oem":
            _oem(to, chosen, target, recording.parent, overwrite)
        elif wanted.name == "aem":
            _aem(to, chosen, target, overwrite)
        elif wanted.name == "czml":
            _czml(to, chosen, overwrite)
        elif wanted.name == "csv":
            start_utc = _start(read.source)
            writer_for("csv")(to, chosen, utc=lambda time_s: _texts(start_utc, time_s), overwrite=overwrite)
        elif wanted.name in _QUICK:
            writer_for(wanted.name)(to, chosen, **options, overwrite=overwrite)
        else:
            writer_for(wanted.name)(to, counted(chosen, "exporting"), overwrite=overwrite)
        echo(_said(to, wanted, len(chosen), len(read)))


def _said(to: Path, wanted: Format, count: int, held: int) -> str:
    kept = f"{count} frames" if count == held else f"{count} of {held} frames"
    size = held_bytes(to)
    text = f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.1f} kB"
    return f"written     {to} ({wanted.name}, {kept}, {text}); lost: {wanted.loses}"


# ------------------------------------------------------------------------------- what asks for time scales and the Earth


def _start(source: Source) -> datetime.datetime:
    return datetime.datetime.fromisoformat(source.start_utc)


def _texts(start_utc: datetime.datetime, time_s: np.ndarray) -> np.ndarray:
    """Return instants as ISO UTC text to the microsecond, leap seconds counted."""
    return np.array(orbit.Epochs(start_utc, time_s).skyfield_time().utc_iso(places=6))


def _about_the_earth(to: Path, source: Source, overwrite: bool) -> None:
    """Raise an error where an ephemeris cannot be written."""
    free(to, overwrite=overwrite)
    if parse_toml(source.scenario, "recording", RecordingError).get("world", {}).get("axes") == "local":
        raise RecordingError(f"{to.name}: a local world has no Earth to give positions about; write a .csv")


def _known(name: str | None, known: list[str]) -> str:
    wanted = "follower" if name is None else name
    if wanted not in known:
        guess = did_you_mean(wanted, known)
        raise RecordingError(
            f"--target {wanted}: nothing of that name can be written{guess} (known: {', '.join(known)})"
        )
    return wanted


def _oem(to: Path, frames: files.Frames, target: str | None, folder: Path, overwrite: bool) -> None:
    """Write the recorded states of a body; at impulses a new segment begins. Files that it names lie in `folder`."""
    source = frames[0].source
    _about_the_earth(to, source, overwrite)
    name = _known(target, list(frames[0].truth.states))
    batches = [(truth.time_s, truth.states[name]) for truth, _ in courses(frames)]
    time_s = np.concatenate([at for at, _ in batches])
    states = BodyState(
        np.concatenate([state.position_m for _, state in batches]),
        np.concatenate([state.velocity_m_s for _, state in batches]),
    )
    write_oem(
        to,
        name,
        name,
        orbit.Epochs(_start(source), time_s),
        states,
        breaks_s=_breaks(source, name, time_s, folder),
        overwrite=overwrite,
    )


def _breaks(source: Source, name: str, time_s: np.ndarray, folder: Path) -> list[float]:
    """Return the instants [s] of impulses between recorded frames that have two frames on either side."""
    try:
        with unwarned():
            planned = sorted(breaks_s(scenario_of(source, folder), name))
    except (RsoLidarError, OSError):  # a body that is no body of the scenario, or files that are not here
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


def _aem(to: Path, frames: files.Frames, target: str | None, overwrite: bool) -> None:
    """Write how axes were turned in inertial ones."""
    from scipy.spatial.transform import Rotation

    source = frames[0].source
    _about_the_earth(to, source, overwrite)
    name = _known(target, list(frames[0].truth.poses))
    batches = [(truth.time_s, truth.pose(ROOT, name).rotation.as_matrix()) for truth, _ in courses(frames)]
    time_s = np.concatenate([at for at, _ in batches])
    turned = np.concatenate([np.broadcast_to(matrix, (at.size, 3, 3)) for at, matrix in batches])
    write_aem(to, name, name, orbit.Epochs(_start(source), time_s), Rotation.from_matrix(turned), overwrite=overwrite)


def _czml(to: Path, frames: files.Frames, overwrite: bool) -> None:
    """Write bodies, lines of sight and boresight for a globe, thinned."""
    source = frames[0].source
    _about_the_earth(to, source, overwrite)
    some = files.Frames(frames.recording, [frames.places[k] for k in thinned(len(frames)).tolist()])
    place, _ = whole(courses(some))
    write_czml(to, globe(source.title, _start(source), [one.name for one in source.targets], place))
