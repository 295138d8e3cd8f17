"""Point clouds as binary PLY, one file per frame: the returned points, each with its pixel."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from rso_lidar.export.writer.frame_files import write_frame_files
from rso_lidar.records import Frame

_POINT = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<u2"), ("row", "<u2"), ("col", "<u2")]
_LABELS = [("target", "<i2"), ("part", "<i2")]
_TYPES = {"<f4": "float", "<u2": "ushort", "<i2": "short"}


def write_ply(
    path: str | os.PathLike[str], frames: Iterable[Frame], *, overwrite: bool = False, labels: bool = True
) -> Path:
    """Write one binary little-endian PLY file per frame, and return the path of the folder.

    Parameters
    ----------
    path : of the folder; the files are 000000.ply and so on, by the number of the frame
    labels : write the labels `target` and `part` too (short, -1 for sky)
    """
    return write_frame_files(path, frames, "ply", lambda frame: encode_ply(frame, labels=labels), overwrite=overwrite)


def encode_ply(frame: Frame, *, labels: bool = True) -> bytes:
    """Encode the returned points of a frame, in lidar axes, as a PLY file."""
    row, col = np.nonzero(frame.valid)
    fields = _POINT + _LABELS * labels
    points = np.zeros(len(row), dtype=fields)
    for axis, name in enumerate("xyz"):
        points[name] = frame.points_m[row, col, axis]
    points["intensity"], points["row"], points["col"] = frame.intensity_counts[row, col], row, col
    if labels:
        points["target"], points["part"] = frame.labels.target[row, col], frame.labels.part[row, col]
    head = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment frame {frame.index} at {frame.time_s!r} s, lidar axes, metres and counts",
        f"element vertex {len(points)}",
        *(f"property {_TYPES[kind]} {name}" for name, kind in fields),
        "end_header",
    ]
    return "\n".join([*head, ""]).encode("ascii") + points.tobytes()
