"""Status of a recording that a run is writing: how many frames it has, and whether the run is alive."""

from __future__ import annotations

import re
import time
from dataclasses import dataclass
from pathlib import Path

from rso_lidar.errors import RecordingError
from rso_lidar.export.reader.hdf5_file import TEMPORARY
from rso_lidar.export.reader.recording import Recording
from rso_lidar.files import is_locked
from rso_lidar.records import Source

_LOCK = re.compile(r"^\.(.+)\.lock$")
_BEGIN_S = 0.1  # longer than a run takes from making its lock file to holding it


@dataclass(frozen=True)
class RecordingStatus:
    """Status of a recording that a run may be writing.

    Parameters
    ----------
    output : final path
    file : the file that holds the frames now
    running : whether a process writes it, or may write it on systems that cannot tell
    complete : whether the file has its final name
    frames : number of complete frames
    time_s : emission of the last of them [s since the start] (None: before the first)
    source : of the recording (None: before the first frame, or where the writer was changing the file)
    """

    output: Path
    file: Path
    running: bool
    complete: bool
    frames: int = 0
    time_s: float | None = None
    source: Source | None = None


def read_status(path: Path) -> RecordingStatus:
    """Read the status of a recording that a run may be writing.

    A running simulation takes precedence over an older recording that it will replace.

    Parameters
    ----------
    path : of the recording, by its final or its temporary name

    Returns
    -------
    RecordingStatus

    Raises
    ------
    RecordingError
        If there is no recording of that name, or it cannot be read.
    """
    output = path.with_name(TEMPORARY.sub("", path.name))
    named = None if path.name == output.name else path.name
    if not path.parent.is_dir():
        raise RecordingError(f"{path}: there is no folder {path.parent}; check the name")
    names = [entry.name for entry in path.parent.iterdir()]
    locks = {match[1] for name in names if (match := _LOCK.match(name))}
    temporary = {name for name in (*names, *locks) if name.startswith(f"{output.name}.tmp-") and TEMPORARY.search(name)}
    ours = [path.with_name(name) for name in temporary if not name.endswith(".starting") and named in (None, name)]
    running = _find_locked(ours, locks)
    if running is None and not output.exists() and any(file.name in locks for file in ours):
        time.sleep(_BEGIN_S)
        running = _find_locked(ours, locks)
    if running is not None:
        return _read_file_status(output, running, running=True)
    if output.exists():
        return _read_file_status(output, output, running=False)
    left = sorted((file for file in ours if file.exists()), key=lambda file: file.stat().st_mtime_ns)
    if left:
        unknown = is_locked(left[-1].with_name(f".{left[-1].name}.lock")) is None
        return _read_file_status(output, left[-1], running=unknown)
    Recording(path).close()  # which says what is wrong
    raise RecordingError(f"{path}: was taken away while it was looked at; look again")


def _find_locked(files: list[Path], locks: set[str]) -> Path | None:
    """Return the first of the files whose lock a process holds."""
    for file in sorted(files):
        if file.name in locks and is_locked(file.with_name(f".{file.name}.lock")):
            return file
    return None


def _read_file_status(output: Path, file: Path, *, running: bool) -> RecordingStatus:
    """Read the status of one file of a recording."""
    complete = file == output
    try:
        with Recording(file) as recording:
            count = len(recording)
            time_s = float(recording.time_s[count - 1]) if count else None
            return RecordingStatus(output, file, running, complete, count, time_s, recording.source)
    except RecordingError:
        if not running:
            raise
        return RecordingStatus(output, file, running, complete)  # not begun, or just being renamed
