"""Frames to files, files to frames: `save`, `open`, and a `Recorder` for those who write frame by frame.

>>> import tempfile, pathlib
>>> folder = tempfile.TemporaryDirectory()
>>> save(pathlib.Path(folder.name) / "approach.h6", [])
Traceback (most recent call last):
rso_lidar.errors.RecordingError: ...approach.h6: unknown suffix '.h6'; did you mean '.h5'? (known: .h5, .hdf5, ...)
>>> folder.cleanup()
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from rso_lidar.errors import RecordingError, did_you_mean
from rso_lidar.export.layout.intermediates import PhotonImage, check_kept
from rso_lidar.export.reader.hdf5_file import TEMPORARY
from rso_lidar.export.reader.recording import Frames, Recording
from rso_lidar.export.reader.stored_array import StoredArray
from rso_lidar.export.registry import SUFFIXES as WRITTEN
from rso_lidar.export.registry import format_for, writer_for
from rso_lidar.export.writer.recorder import SUFFIXES, Recorder, check_output, run_id
from rso_lidar.files import convert_path, explain_unreadable
from rso_lidar.public_names import limit_dir
from rso_lidar.records import Frame

__all__ = [
    "Frames",
    "PhotonImage",
    "Recorder",
    "Recording",
    "StoredArray",
    "check_kept",
    "check_output",
    "format_for",
    "open",
    "run_id",
    "save",
    "writer_for",
]

__dir__ = limit_dir(__name__)


def save(
    path: str | os.PathLike[str], frames: Iterable[Frame], *, overwrite: bool = False, format: str = "", **options: Any
) -> Path:
    """Write frames in a format of this room; `rso_lidar.save` knows more formats.

    Parameters
    ----------
    path : of the file or folder to write.
    frames : consumed one at a time, from `simulate` or `open`.
    overwrite : whether an existing output may be replaced.
    format : name of the format, if the suffix does not state it.
    **options : of that format's writer, such as ``viewpoint="tdrs"`` of `export.formats.pcd.write_pcd`.

    Returns
    -------
    Path
        Where the output is.

    Raises
    ------
    RecordingError
        If the format is unknown, the output exists or cannot be written there, or there are no frames.
    RunError
        If writing fails midway, such as on a full disk.
    """
    path = convert_path(path, RecordingError)
    return writer_for(format or path)(path, frames, overwrite=overwrite, **options)


def open(path: str | os.PathLike[str]) -> Recording:
    """Open a recording, complete or temporary; arrays are read when they are used.

    Parameters
    ----------
    path : of an HDF5 file or a Zarr store.

    Returns
    -------
    Recording
        A sequence of frames; close it, or use it as a context manager.

    Raises
    ------
    RecordingError
        If there is no recording at the path, or it is damaged.
    """
    path = convert_path(path, RecordingError)
    try:
        with suppress(FileNotFoundError, NotADirectoryError):  # which the reader tells, with the closest name
            path.lstat()
    except (OSError, ValueError) as error:
        raise RecordingError(explain_unreadable(path, error)) from None
    suffix = Path(TEMPORARY.sub("", path.name)).suffix
    readable = (*SUFFIXES, *format_for("zarr").suffixes)
    if Path(path).exists() and suffix.lower() in WRITTEN and suffix.lower() not in readable:
        kind = WRITTEN[suffix.lower()].name
        raise RecordingError(
            f"{path}: {kind} is written for other tools and cannot be read back; give the original recording "
            f"({', '.join(readable)})"
        )
    if Path(path).is_file() and suffix.lower() not in readable:
        raise RecordingError(
            f"{path}: unknown suffix '{suffix}'{did_you_mean(suffix, readable)} (known: {', '.join(readable)})"
        )
    return Recording(Path(path))
