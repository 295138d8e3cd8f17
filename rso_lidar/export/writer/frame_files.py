"""Folders with one file per frame, and the metadata beside them: times, poses and the scenario."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.errors import RecordingError, RunError
from rso_lidar.export.layout.attributes import AXES
from rso_lidar.export.layout.datasets import compute_lidar_poses
from rso_lidar.export.layout.target_table import tabulate_targets
from rso_lidar.export.writer.folders import check_export_folder, draft_export_folder
from rso_lidar.export.writer.frame_stream import take_first
from rso_lidar.records import Frame, Source


def write_frame_files(
    path: str | os.PathLike[str],
    frames: Iterable[Frame],
    kind: str,
    content: Callable[[Frame], bytes],
    *,
    overwrite: bool = False,
) -> Path:
    """Write one file per frame, named by the number of the frame (000012.pcd), and return the path of the folder.

    The folder also has source.json (scenario, targets, axes) and frames.jsonl (a line for each file: time and poses).
    """
    place = check_export_folder(path, overwrite=overwrite)
    first, coming = take_first(place, frames)
    with draft_export_folder(place, overwrite=overwrite) as draft:
        write_source(draft, first.source, kind)
        sizes: dict[str, int] = {}
        with (draft / "frames.jsonl").open("w", encoding="utf-8", newline="\n") as lines:
            for frame in coming:
                name = f"{get_file_stem(place, frame)}.{kind}"
                written = content(frame)
                write_new_file(place, draft / name, written)
                sizes[name] = len(written)
                lines.write(json.dumps({"file": name, **describe_frame(frame)}) + "\n")
        for name, size in sizes.items():
            if (draft / name).stat().st_size != size:
                raise RunError(f"{place}: not written: another program truncated {name} in it; run again")
    return place


def get_file_stem(place: Path, frame: Frame) -> str:
    """Return the name of a frame's file without its suffix: the number of the frame in six digits."""
    if frame.index < 0:
        raise RecordingError(
            f"{place}: frame {frame.index}: has a negative number, and no file to go to; number from 0"
        )
    return f"{frame.index:06d}"


def write_new_file(place: Path, file: Path, content: bytes) -> None:
    """Write a file that must not exist yet; raise `RecordingError` if the file exists, because a frame is given twice.

    Parameters
    ----------
    file : to write; its name begins with the number of its frame
    """
    try:
        with file.open("xb") as stream:
            stream.write(content)
    except FileExistsError:
        number = int(file.stem.split("_")[0])
        raise RecordingError(f"{place}: frame {number} is given twice; give each frame once") from None


def write_source(folder: Path, source: Source, kind: str) -> None:
    """Write source.json: the origin of the frames in a folder, and their axes."""
    content = {
        "format": kind,
        "rso_lidar_version": source.versions.get("rso_lidar", "unknown"),
        "title": source.title,
        "start_utc": source.start_utc,
        "seed": source.seed,
        "axes": AXES,
        "quaternion_order": "xyzw",
        "targets": tabulate_targets(source.targets),
        "versions": dict(source.versions),
        "scenario": source.scenario,
    }
    text = json.dumps(content, indent=1, ensure_ascii=False)
    (folder / "source.json").write_text(text + "\n", encoding="utf-8", newline="\n")


def describe_frame(frame: Frame) -> dict[str, Any]:
    """Return index, time [s] and true poses of a frame: lidar_from of all axes, as position [m] and x, y, z, w."""
    from scipy.spatial.transform import Rotation

    seen = compute_lidar_poses(frame.truth.poses)
    quaternions = Rotation.from_matrix(np.array([m[:3, :3] for m in seen.values()])).as_quat(canonical=True)
    return {
        "index": frame.index,
        "time_s": frame.time_s,
        "lidar_from": {
            name: {"position_m": matrix[:3, 3].tolist(), "quaternion_xyzw": quaternion.tolist()}
            for (name, matrix), quaternion in zip(seen.items(), quaternions, strict=True)
        },
    }
