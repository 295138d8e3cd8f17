"""Registry of the formats in which frames can be written: suffixes, writers, what each loses; saving and opening by it.

The writers are imported on demand, so that an unused format costs nothing.

>>> import tempfile, pathlib
>>> folder = tempfile.TemporaryDirectory()
>>> save(pathlib.Path(folder.name) / "approach.h6", [])
Traceback (most recent call last):
rso_lidar.errors.RecordingError: ...approach.h6: unknown suffix '.h6'; did you mean '.h5'? (known: .h5, .hdf5, ...)
>>> folder.cleanup()
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from rso_lidar.errors import RecordingError, did_you_mean
from rso_lidar.export.reader.hdf5_file import TEMPORARY
from rso_lidar.export.reader.recording import Recording
from rso_lidar.export.writer.recorder import SUFFIXES as READ_SUFFIXES
from rso_lidar.files import convert_path, explain_unreadable
from rso_lidar.records import Frame

Writer = Callable[..., Path]  # (path, frames, *, overwrite=False, and options of its own) -> the path


@dataclass(frozen=True)
class Format:
    """A format in which frames can be written.

    `writer` names its function; it is empty where `evaluation.conversion` composes the output. `folder` says that the path
    names a folder. `loses` is one sentence for users, and `extra` the extra to install.
    """

    name: str
    suffixes: tuple[str, ...]
    writer: str
    folder: bool
    loses: str
    extra: str = ""


_CLOUD = (
    "the line of sight of pixels without a return, further returns of a pixel, photons, most labels, images of cameras"
)
_MESSAGES = (
    "most labels, photons, further returns, kept records, exposure times of cameras, and samples of other sensors that are "
    "not valid"
)
_TABLE = "all images, labels and settings: a table of the truth, or of the samples of one sensor"
_POSES = "all images, labels and settings: only where things were is kept"

FORMATS = {
    file_format.name: file_format
    for file_format in (
        Format("hdf5", (".h5", ".hdf5"), "writer.hdf5:write_hdf5", False, "nothing"),
        Format("netcdf", (".nc",), "writer.hdf5:write_hdf5", False, "nothing"),  # HDF5 recordings are netCDF-4 with CF
        Format("zarr", (".zarr",), "writer.zarr_store:write_zarr", True, "nothing", "zarr"),
        Format(
            "npz",
            (".npz",),
            "formats.npz:write_npz",
            False,
            "reading frame by frame: arrays are read as a whole, 2 GB at most",
        ),
        Format("pcd", (".pcd",), "formats.pcd:write_pcd", True, f"{_CLOUD}; points are rounded to float32"),
        Format(
            "ply",
            (".ply",),
            "formats.ply:write_ply",
            True,
            f"pixels without a return (row and col of the others are kept), {_CLOUD}; points are rounded to float32",
        ),
        Format(
            "bop",
            (".bop",),
            "formats.bop:write_bop",
            True,
            "range finer than one step of 16 bits (depth_scale of each frame, in mm), what false triggers report far "
            "behind the targets, silhouettes behind other targets, further returns, photons, most labels, and all but the "
            "first band of cameras that have neither one nor three",
        ),
        Format(
            "png",
            (".png",),
            "formats.png:write_png",
            True,
            "all images of the lidar and all labels: only images of cameras, and where things were, are kept",
        ),
        Format("mcap", (".mcap",), "formats.mcap:write_mcap", False, _MESSAGES, "mcap"),
        Format("rosbag2", (".rosbag2",), "formats.rosbag2:write_rosbag2", True, _MESSAGES, "mcap"),
        Format(
            "raster",
            (".raw",),
            "",
            False,
            "times, poses, labels, images of cameras, and what the words of the report cannot hold of range and intensity",
        ),
        Format("tum", (".tum",), "formats.trajectory:write_tum", False, _POSES),
        Format("kitti", (".kitti",), "formats.trajectory:write_kitti", False, f"{_POSES}, without times"),
        Format("csv", (".csv",), "formats.trajectory:write_csv", False, _TABLE),
        Format("parquet", (".parquet",), "formats.trajectory:write_table", False, _TABLE, "parquet"),
        Format("oem", (".oem",), "", False, "all but positions and velocities of bodies"),
        Format("tdm", (".tdm",), "", False, "all but range, direction and intensity of one target in each frame"),
        Format("aem", (".aem",), "", False, "all but the attitude of bodies"),
        Format("czml", (".czml",), "", False, "all but where bodies are and how they are turned"),
    )
}
FORMAT_SUFFIXES = {suffix: file_format for file_format in FORMATS.values() for suffix in file_format.suffixes}
_INSTEAD = {".mat": "MATLAB reads .h5 with h5read (docs/exports.md)", ".las": "use .pcd, which keeps rows and columns"}


def format_for(word: str | os.PathLike[str]) -> Format:
    """Find a format by its name, a suffix or a path.

    Parameters
    ----------
    word : such as ``"pcd"``, ``".pcd"`` or ``"clouds.pcd"``

    Returns
    -------
    Format
        Its name, suffixes, writer, and what it loses.

        >>> format_for("clouds.pcd").name, format_for("kitti").suffixes
        ('pcd', ('.kitti',))

    Raises
    ------
    RecordingError
        If no format matches.
    """
    text = os.fspath(word)
    if text in FORMATS:
        return FORMATS[text]
    suffix = text if text.startswith(".") and "/" not in text and text.count(".") == 1 else Path(text).suffix
    if suffix.lower() in FORMAT_SUFFIXES:
        return FORMAT_SUFFIXES[suffix.lower()]
    if suffix.lower() in _INSTEAD:
        raise RecordingError(f"{text}: '{suffix}' cannot be written; {_INSTEAD[suffix.lower()]}")
    if isinstance(word, str) and not suffix and os.sep not in text:
        raise RecordingError(f"{text}: unknown format{did_you_mean(text, FORMATS)} (known: {', '.join(FORMATS)})")
    what = f"unknown suffix '{suffix}'" if suffix else "the name has no suffix"
    raise RecordingError(f"{text}: {what}{did_you_mean(suffix, FORMAT_SUFFIXES)} (known: {', '.join(FORMAT_SUFFIXES)})")


def writer_for(word: str | os.PathLike[str]) -> Writer:
    """Find the function that writes frames in a format.

    Parameters
    ----------
    word : name, suffix or path, as for `format_for`

    Returns
    -------
    Writer
        Function ``(path, frames, *, overwrite)``.

    Raises
    ------
    RecordingError
        If no format matches, or the format is written by `rso_lidar.save` only.
    """
    file_format = format_for(word)
    if not file_format.writer:
        raise RecordingError(
            f"{os.fspath(word)}: {file_format.name} needs the recording's scenario; "
            "use rso_lidar.save or `rso-lidar export`"
        )
    module, function = file_format.writer.split(":")
    writer: Writer = getattr(import_module(f"rso_lidar.export.{module}"), function)
    return writer


def save(
    path: str | os.PathLike[str], frames: Iterable[Frame], *, overwrite: bool = False, format: str = "", **options: Any
) -> Path:
    """Write frames in a format of this room; `rso_lidar.save` knows more formats.

    Parameters
    ----------
    path : of the file or folder to write
    frames : consumed one at a time, from `simulate` or `open`
    overwrite : whether an existing output may be replaced
    format : name of the format, if the suffix does not state it
    **options : of that format's writer, such as ``viewpoint="tdrs"`` of `export.formats.pcd.write_pcd`

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
    path : of an HDF5 file or a Zarr store

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
    readable = (*READ_SUFFIXES, *format_for("zarr").suffixes)
    if Path(path).exists() and suffix.lower() in FORMAT_SUFFIXES and suffix.lower() not in readable:
        kind = FORMAT_SUFFIXES[suffix.lower()].name
        raise RecordingError(
            f"{path}: {kind} is written for other tools and cannot be read back; give the original recording "
            f"({', '.join(readable)})"
        )
    if Path(path).is_file() and suffix.lower() not in readable:
        raise RecordingError(
            f"{path}: unknown suffix '{suffix}'{did_you_mean(suffix, readable)} (known: {', '.join(readable)})"
        )
    return Recording(Path(path))
