"""Registry of the formats in which frames can be written: suffixes, writers, and what each format loses.

The writers are imported on demand, so that an unused format costs nothing.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from rso_lidar.errors import RecordingError, did_you_mean

Writer = Callable[..., Path]  # (path, frames, *, overwrite=False, and options of its own) -> the path


@dataclass(frozen=True)
class Format:
    """A format in which frames can be written.

    `writer` names its function; it is empty where `study.conversion` composes the output. `folder` says that the path
    names a folder. `loses` is one sentence for users, and `extra` the extra to install.
    """

    name: str
    suffixes: tuple[str, ...]
    writer: str
    folder: bool
    loses: str
    extra: str = ""


_CLOUD = "the line of sight of pixels without a return, further returns of a pixel, photons and most labels"
_MESSAGES = "most labels, photons, further returns, kept records, and samples of other sensors that are not valid"
_TABLE = "all images, labels and settings: a table of the truth, or of the samples of one sensor"
_POSES = "all images, labels and settings: only where things were is kept"

FORMATS = {
    made.name: made
    for made in (
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
            "behind the targets, silhouettes behind other targets, further returns, photons and most labels",
        ),
        Format("mcap", (".mcap",), "formats.mcap:write_mcap", False, _MESSAGES, "mcap"),
        Format("rosbag2", (".rosbag2",), "formats.rosbag2:write_rosbag2", True, _MESSAGES, "mcap"),
        Format("tum", (".tum",), "formats.trajectory:write_tum", False, _POSES),
        Format("kitti", (".kitti",), "formats.trajectory:write_kitti", False, f"{_POSES}, without times"),
        Format("csv", (".csv",), "formats.trajectory:write_csv", False, _TABLE),
        Format("parquet", (".parquet",), "formats.trajectory:write_table", False, _TABLE, "parquet"),
        Format("oem", (".oem",), "", False, "all but positions and velocities of bodies"),
        Format("aem", (".aem",), "", False, "all but the attitude of bodies"),
        Format("czml", (".czml",), "", False, "all but where bodies are and how they are turned"),
    )
}
SUFFIXES = {suffix: made for made in FORMATS.values() for suffix in made.suffixes}
_INSTEAD = {".mat": "MATLAB reads .h5 with h5read (docs/exports.md)", ".las": "use .pcd, which keeps rows and columns"}


def format_for(word: str | os.PathLike[str]) -> Format:
    """Find a format by its name, a suffix or a path.

    Parameters
    ----------
    word : such as ``"pcd"``, ``".pcd"`` or ``"clouds.pcd"``.

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
    if suffix.lower() in SUFFIXES:
        return SUFFIXES[suffix.lower()]
    if suffix.lower() in _INSTEAD:
        raise RecordingError(f"{text}: '{suffix}' cannot be written; {_INSTEAD[suffix.lower()]}")
    if isinstance(word, str) and not suffix and os.sep not in text:
        raise RecordingError(f"{text}: unknown format{did_you_mean(text, FORMATS)} (known: {', '.join(FORMATS)})")
    what = f"unknown suffix '{suffix}'" if suffix else "the name has no suffix"
    raise RecordingError(f"{text}: {what}{did_you_mean(suffix, SUFFIXES)} (known: {', '.join(SUFFIXES)})")


def writer_for(word: str | os.PathLike[str]) -> Writer:
    """Find the function that writes frames in a format.

    Parameters
    ----------
    word : name, suffix or path, as for `format_for`.

    Returns
    -------
    Writer
        Function ``(path, frames, *, overwrite)``.

    Raises
    ------
    RecordingError
        If no format matches, or the format is written by `rso_lidar.save` only.
    """
    found = format_for(word)
    if not found.writer:
        raise RecordingError(
            f"{os.fspath(word)}: {found.name} needs time scales and the Earth; use rso_lidar.save or `rso-lidar export`"
        )
    module, function = found.writer.split(":")
    writer: Writer = getattr(import_module(f"rso_lidar.export.{module}"), function)
    return writer
