"""Folders in the style of BOP, the benchmark of 6D pose estimators: depth, masks, cameras and target poses.

The format is that of the BOP toolkit (docs/bop_datasets_format.md there). Translations are in mm, and rotations are
stored row by row. Depth is z, not slant range: 16 bits times depth_scale, 0 where there is none. The camera axes
(OpenCV's: x right, y down, z forward) are the lidar axes. The model axes are a target's axes, with the origin at its
centre of mass.
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from rso_lidar.errors import RecordingError, warn
from rso_lidar.export.layout.datasets import compute_lidar_poses
from rso_lidar.export.writer.folders import check_export_folder, draft_export_folder
from rso_lidar.export.writer.frame_files import describe_frame, get_file_stem, write_new_file, write_source
from rso_lidar.export.writer.frame_stream import take_first
from rso_lidar.records import Frame
from rso_lidar.units import MM

SCENE = "000000"
FOLDERS = ("depth", "gray", "mask", "mask_visib")
TABLES = ("scene_camera", "scene_gt", "scene_gt_info")
_FULL = 2**16 - 1
_BEYOND, _BEYOND_M = 1.01, 10.0  # margins of the depth scale beyond the farthest target: a factor, and metres
MOST_OFF_PINHOLE_PIXELS = 0.05  # error of the camera matrix below which there is no warning


def write_bop(path: str | os.PathLike[str], frames: Iterable[Frame], *, overwrite: bool = False) -> Path:
    """Write frames as the images of one BOP scene, 000000, and return the path of the folder.

    The number of an image is that of its frame. The number of an object is the position of its target in source.json,
    from 1. Intensities are 16-bit grey PNGs. No label holds what another target hides, so `mask` equals `mask_visib`.
    """
    place = check_export_folder(path, overwrite=overwrite)
    first, coming = take_first(place, frames)
    with draft_export_folder(place, overwrite=overwrite) as draft, ExitStack() as stack:
        write_source(draft, first.source, "bop")
        scene = draft / SCENE
        for name in FOLDERS:
            (scene / name).mkdir(parents=True)
        tables = {name: stack.enter_context(_open_table(scene / f"{name}.json")) for name in TABLES}
        lines = stack.enter_context((draft / "frames.jsonl").open("w", encoding="utf-8", newline="\n"))
        sight: np.ndarray | None = None
        warned = False
        for frame in coming:
            if frame.line_of_sight is not sight:
                sight = frame.line_of_sight
                camera, off_pixels = fit_pinhole(place, sight)
                if off_pixels > MOST_OFF_PINHOLE_PIXELS and not warned:
                    warned = True
                    warn(
                        f"{place}: frame {frame.index}: the lens bends rays by up to {off_pixels:.2g} pixels from the "
                        "pinhole that BOP knows; for exact points use .pcd"
                    )
                if frame is first:
                    _write_camera(draft, frame, camera)
            depth_scale = _write_images(place, scene, frame)
            number = str(frame.index)
            described = {"cam_K": camera.ravel().tolist(), "depth_scale": depth_scale, "time_s": frame.time_s}
            _write_entry(tables["scene_camera"], number, described)
            poses, infos = _describe_objects(place, scene, frame)
            _write_entry(tables["scene_gt"], number, poses)
            _write_entry(tables["scene_gt_info"], number, infos)
            lines.write(
                json.dumps({"file": f"{SCENE}/depth/{get_file_stem(place, frame)}.png", **describe_frame(frame)}) + "\n"
            )
    return place


def fit_pinhole(place: Path, line_of_sight: np.ndarray) -> tuple[np.ndarray, float]:
    """Fit a camera matrix (3, 3) [pixels] to lines of sight, and return it with its largest error [pixels].

    Column and row 0 are the centre of the first pixel, as in OpenCV.
    """
    rows, cols = line_of_sight.shape[:2]
    if np.any(line_of_sight[..., 2] <= 0):
        raise RecordingError(f"{place}: a pixel looks sideways or back, and BOP knows pinholes only; use .pcd")
    across, down = line_of_sight[..., 0] / line_of_sight[..., 2], line_of_sight[..., 1] / line_of_sight[..., 2]
    col, row = np.meshgrid(np.arange(cols, dtype=float), np.arange(rows, dtype=float))
    camera, off = np.eye(3), []
    for axis, (tangent, pixel) in enumerate(((across, col), (down, row))):
        spread = tangent - tangent.mean()
        if not spread.any():
            raise RecordingError(f"{place}: a focal plane one pixel wide has no camera matrix; use .pcd")
        focal = float((spread * pixel).sum() / (spread * spread).sum())
        centre = float(pixel.mean() - focal * tangent.mean())
        camera[axis, axis], camera[axis, 2] = focal, centre
        off.append(float(np.abs(focal * tangent + centre - pixel).max()))
    return camera, max(off)


def choose_depth_scale(farthest_m: float) -> float:
    """Choose the step of depth images of 16 bits, as fine as a farthest range and a margin of 1 % and 10 m permit.

    Parameters
    ----------
    farthest_m : greatest true range [m]

    Returns
    -------
    float
        One of 0.1, 0.2, 0.5, 1, 2, 5, … [mm per count].

        >>> choose_depth_scale(3.0e3)
        50.0
    """
    greatest_mm = (_BEYOND * farthest_m + _BEYOND_M) / MM
    steps = (digit * 10.0**power for power in range(-1, 12) for digit in (1, 2, 5))
    return next(round(step, 1) for step in steps if step * _FULL >= greatest_mm)


def quantize_depth(depth: np.ndarray, step: float) -> np.ndarray:
    """Convert depths to the counts of a depth image.

    Parameters
    ----------
    depth : (row, col), NaN for no return
    step : depth of one count, in the unit of `depth`

    Returns
    -------
    ndarray
        (row, col) uint16, 0 where nothing returned or the depth is beyond the last count, at least 1 elsewhere.
    """
    valid = np.isfinite(depth)
    counts = np.zeros(depth.shape)
    counts[valid] = np.maximum(np.rint(depth[valid] / step), 1)
    counts[counts > _FULL] = 0
    return counts.astype(np.uint16)


def _write_images(place: Path, scene: Path, frame: Frame) -> float:
    """Write depth and intensity of a frame.

    Parameters
    ----------
    frame : to be written; false triggers beyond the range of the scale are left out

    Returns
    -------
    float
        depth_scale [mm per count], as fine as the true ranges of the targets permit.
    """
    depth_mm = np.where(frame.valid, frame.points_m[..., 2] / MM, np.nan)
    on_target = frame.labels.target >= 0
    known = frame.labels.range_m[on_target] if on_target.any() else frame.range_m[frame.valid]
    step = choose_depth_scale(float(known.max(initial=0.0)))
    name = f"{get_file_stem(place, frame)}.png"
    write_new_file(place, scene / "depth" / name, encode_png(quantize_depth(depth_mm, step)))
    write_new_file(place, scene / "gray" / name, encode_png(frame.intensity_counts))
    return step


def _write_camera(folder: Path, frame: Frame, camera: np.ndarray) -> None:
    """Write camera.json with the camera of the first frame, because tools expect one camera per folder.

    Parameters
    ----------
    camera : (3, 3) matrix [pixels]
    """
    rows, cols = frame.range_m.shape
    content = {
        "cx": camera[0, 2],
        "cy": camera[1, 2],
        "fx": camera[0, 0],
        "fy": camera[1, 1],
        "width": cols,
        "height": rows,
    }
    (folder / "camera.json").write_text(json.dumps(content, indent=1) + "\n", newline="\n")


def _describe_objects(place: Path, scene: Path, frame: Frame) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Write the masks of the targets of a frame, and describe their poses and visible areas."""
    poses, infos = [], []
    seen = compute_lidar_poses(frame.truth.poses)
    here = [(number, target.name) for number, target in enumerate(frame.source.targets) if target.name in seen]
    for place_in_image, (number, name) in enumerate(here):
        matrix = seen[name]
        poses.append(
            {
                "cam_R_m2c": matrix[:3, :3].ravel().tolist(),
                "cam_t_m2c": (matrix[:3, 3] / MM).tolist(),
                "obj_id": number + 1,
            }
        )
        mask = frame.labels.target == number
        file = f"{get_file_stem(place, frame)}_{place_in_image:06d}.png"
        for folder in ("mask", "mask_visib"):
            write_new_file(place, scene / folder / file, encode_png((mask * 255).astype(np.uint8)))
        count, box = int(mask.sum()), _find_box(mask)
        infos.append(
            {
                "bbox_obj": box,
                "bbox_visib": box,
                "px_count_all": count,
                "px_count_valid": int((mask & frame.valid).sum()),
                "px_count_visib": count,
                "visib_fract": 1.0 if count else 0.0,
            }
        )
    return poses, infos


def _find_box(mask: np.ndarray) -> list[int]:
    """Return left, top, width and height of the set pixels; four times -1 without any."""
    row, col = np.nonzero(mask)
    if not len(row):
        return [-1, -1, -1, -1]
    left, top = int(col.min()), int(row.min())
    return [left, top, int(col.max()) - left + 1, int(row.max()) - top + 1]


def encode_png(image: np.ndarray) -> bytes:
    """Encode an image as a grey PNG.

    Parameters
    ----------
    image : (row, col) uint8 or uint16

    Returns
    -------
    bytes
        The content of the file.
    """
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(image)).save(stream, format="PNG")
    return stream.getvalue()


@contextmanager
def _open_table(path: Path) -> Iterator[TextIO]:
    """Yield a file for a JSON object that grows by one entry per image."""
    with path.open("w", encoding="utf-8", newline="\n") as stream:
        stream.write("{")
        yield stream
        stream.write("\n}\n")


def _write_entry(stream: TextIO, key: str, value: Any) -> None:
    """Write one entry of a JSON object."""
    stream.write(f"{',' if stream.tell() > 1 else ''}\n{json.dumps(key)}: {json.dumps(value)}")
