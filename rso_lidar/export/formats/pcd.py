"""Organised point clouds as PCD 0.7, with the rows and columns of the focal plane and NaN where nothing came back.

The format is that of the Point Cloud Library (its documentation, "The PCD file format"). Points are in lidar axes,
which are the optical axes of that library too: x right, y down, z along the boresight.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from rso_lidar.errors import RecordingError, did_you_mean
from rso_lidar.export.writer.frame_files import write_frame_files
from rso_lidar.records import Frame

_POINT = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4")]
_LABELS = [("target", "<i2"), ("part", "<i2")]


def write_pcd(
    path: str | os.PathLike[str],
    frames: Iterable[Frame],
    *,
    overwrite: bool = False,
    viewpoint: str = "lidar",
    labels: bool = True,
) -> Path:
    """Write one binary PCD file per frame, and return the path of the folder.

    Parameters
    ----------
    path : of the folder; the files are 000000.pcd and so on, by the number of the frame
    viewpoint : axes in which VIEWPOINT gives the lidar's pose [m]. ``lidar`` gives the identity. A target's name makes
        viewers that apply it show all clouds in that target's axes. Viewers hold it in float32
    labels : write the labels `target` and `part` too (int16, -1 for sky)
    """
    return write_frame_files(
        path, frames, "pcd", lambda frame: encode_pcd(frame, viewpoint, labels=labels), overwrite=overwrite
    )


def encode_pcd(frame: Frame, viewpoint: str = "lidar", *, labels: bool = True) -> bytes:
    """Encode the organised cloud of a frame as a PCD file.

    Parameters
    ----------
    viewpoint : axes in which VIEWPOINT gives the lidar's pose
    labels : add the labels `target` and `part`
    """
    rows, cols = frame.range_m.shape
    points = np.zeros((rows, cols), dtype=_POINT + _LABELS * labels)
    for axis, name in enumerate("xyz"):
        points[name] = frame.points_m[..., axis]
    points["intensity"] = frame.intensity_counts
    if labels:
        points["target"], points["part"] = frame.labels.target, frame.labels.part
    kinds = [points.dtype[name] for name in points.dtype.names or ()]
    head = [
        "# .PCD v0.7 - Point Cloud Data file format",
        f"# frame {frame.index} at {frame.time_s!r} s, lidar axes, metres and counts",
        "VERSION 0.7",
        f"FIELDS {' '.join(points.dtype.names or ())}",
        f"SIZE {' '.join(str(kind.itemsize) for kind in kinds)}",
        f"TYPE {' '.join(kind.kind.upper() for kind in kinds)}",
        f"COUNT {' '.join('1' for _ in kinds)}",
        f"WIDTH {cols}",
        f"HEIGHT {rows}",
        f"VIEWPOINT {_describe_viewpoint(frame, viewpoint)}",
        f"POINTS {rows * cols}",
        "DATA binary",
    ]
    return "\n".join([*head, ""]).encode("ascii") + points.tobytes()


def _describe_viewpoint(frame: Frame, axes: str) -> str:
    """Return the lidar's pose in these axes as PCD writes it: x y z, then the quaternion with w first."""
    if axes == "lidar":
        return "0 0 0 1 0 0 0"
    tree = frame.truth.poses
    if axes not in tree and axes != "inertial":
        guess = did_you_mean(axes, tree)
        raise RecordingError(f"viewpoint: no axes named '{axes}'{guess or ';'} (known: {', '.join(tree)})")
    pose = frame.truth.pose(axes, "lidar")
    numbers = [*pose.translation, *pose.rotation.as_quat(canonical=True, scalar_first=True)]
    return " ".join(repr(float(number)) for number in numbers)
