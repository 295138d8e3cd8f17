"""Folders in the style of BOP, the benchmark of 6D pose estimators: depth, masks, cameras and target poses.

The format is that of the BOP toolkit (docs/bop_datasets_format.md there). Translations are in mm, and rotations are
stored row by row. Depth is z, not slant range: 16 bits times depth_scale, 0 where there is none. The camera axes
(OpenCV's: x right, y down, z forward) are the lidar axes. The model axes are a target's axes, with the origin at its
centre of mass.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from rso_lidar.errors import RecordingError, warn
from rso_lidar.export.formats.companion_camera import (
    CompanionCamera,
    check_images,
    compute_camera_poses,
    read_cameras,
)
from rso_lidar.export.formats.png import encode_png
from rso_lidar.export.layout.datasets import compute_lidar_poses
from rso_lidar.export.writer.folders import check_export_folder, draft_export_folder
from rso_lidar.export.writer.frame_files import describe_frame, get_file_stem, write_new_file, write_source
from rso_lidar.export.writer.frame_stream import take_first
from rso_lidar.records import CameraLabels, Frame, Labels, find_box
from rso_lidar.units import MM

SCENE = "000000"
MASKS = ("mask", "mask_visib")
FOLDERS = ("depth", "gray", *MASKS)
TABLES = ("scene_camera", "scene_gt", "scene_gt_info")
_FULL = 2**16 - 1
_BEYOND, _BEYOND_M = 1.01, 10.0  # margins of the depth scale beyond the farthest target: a factor, and metres
MOST_OFF_PINHOLE_PIXELS = 0.05  # error of the camera matrix below which there is no warning


def write_bop(path: str | os.PathLike[str], frames: Iterable[Frame], *, overwrite: bool = False) -> Path:
    """Write frames as the images of one BOP scene, 000000, and return the path of the folder.

    The number of an image is that of its frame. The number of an object is the position of its target in source.json,
    from 1. Intensities are 16-bit grey PNGs. No label holds what another target hides, so `mask` equals `mask_visib`.
    scene_gt_info.json has the keypoints of each object beside its boxes, if its target has any, as COCO flattens them.

    A camera beside the lidar has folders and tables of its own in the scene, which end in its name as those of a sensor in
    the industrial sets of BOP: `rgb_nav` or `gray_nav`, `mask_nav`, `mask_visib_nav`, `scene_camera_nav.json` and so on.
    """
    place = check_export_folder(path, overwrite=overwrite)
    first, coming = take_first(place, frames)
    cameras = read_cameras(place, first)
    _warn_of_limits(place, cameras.values())
    endings = ["", *(f"_{name}" for name in cameras)]
    with draft_export_folder(place, overwrite=overwrite) as draft, ExitStack() as stack:
        write_source(draft, first.source, "bop")
        scene = draft / SCENE
        pictures = [f"{_get_kind(camera)}_{camera.name}" for camera in cameras.values()]
        for name in (*FOLDERS, *pictures, *(f"{mask}{ending}" for mask in MASKS for ending in endings[1:])):
            (scene / name).mkdir(parents=True)
        names = [f"{name}{ending}" for name in TABLES for ending in endings]
        tables = {name: stack.enter_context(_open_table(scene / f"{name}.json")) for name in names}
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
                    _write_camera(draft / "camera.json", camera.ravel().tolist(), frame.range_m.shape)
            depth_scale = _write_images(place, scene, frame)
            number = str(frame.index)
            described = {"cam_K": camera.ravel().tolist(), "depth_scale": depth_scale, "time_s": frame.time_s}
            _write_entry(tables["scene_camera"], number, described)
            seen = compute_lidar_poses(frame.truth.poses)
            poses, infos = _describe_objects(place, scene, frame, "", seen, frame.labels, frame.valid)
            _write_entry(tables["scene_gt"], number, poses)
            _write_entry(tables["scene_gt_info"], number, infos)
            check_images(place, frame, cameras)
            for other in cameras.values():
                for table, entry in _write_companion(place, scene, frame, other).items():
                    _write_entry(tables[f"{table}_{other.name}"], number, entry)
            lines.write(
                json.dumps({"file": f"{SCENE}/depth/{get_file_stem(place, frame)}.png", **describe_frame(frame)}) + "\n"
            )
        for other in cameras.values():
            _write_camera(draft / SCENE / f"camera_{other.name}.json", other.pinhole.matrix, other.shape)
    return place


def _get_kind(camera: CompanionCamera) -> str:
    """Return the name that BOP has for images of this number of bands."""
    return "rgb" if len(camera.bands) == 3 else "gray"


def _warn_of_limits(place: Path, cameras: Iterable[CompanionCamera]) -> None:
    """Warn of what BOP cannot hold of the cameras beside the lidar."""
    for camera in cameras:
        off_pixels = camera.pinhole.measure_bend_px(camera.shape[0], camera.shape[1])
        if off_pixels > MOST_OFF_PINHOLE_PIXELS:
            warn(
                f"{place}: camera '{camera.name}': the lens moves points by up to {off_pixels:.2g} pixels from the pinhole "
                "that BOP knows; for the coefficients use .png"
            )
        if len(camera.bands) not in (1, 3):
            warn(
                f"{place}: camera '{camera.name}': BOP knows grey and RGB images, so band '{camera.bands[0]['name']}' alone "
                "is written; for all bands use .png"
            )


def _write_companion(place: Path, scene: Path, frame: Frame, camera: CompanionCamera) -> dict[str, Any]:
    """Write the image of a camera beside the lidar, and return its entry of each table."""
    image, labels = frame.camera[camera.name], frame.camera_labels[camera.name]
    kind = _get_kind(camera)
    file = scene / f"{kind}_{camera.name}" / f"{get_file_stem(place, frame)}.png"
    write_new_file(place, file, encode_png(image.intensity_counts if kind == "rgb" else image.intensity_counts[..., 0]))
    seen = compute_camera_poses(frame, camera.name)
    no_depth = np.zeros(labels.target.shape, dtype=bool)
    poses, infos = _describe_objects(place, scene, frame, f"_{camera.name}", seen, labels, no_depth)
    described = {
        "cam_K": list(camera.pinhole.matrix),
        "time_s": frame.time_s,
        "exposure_s": float(image.exposure_s),
    }
    return dict(zip(TABLES, (described, poses, infos), strict=True))


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


def _write_camera(file: Path, matrix: Sequence[float], shape: Sequence[int]) -> None:
    """Write a file with one camera, that of the first frame, because tools expect one camera per folder.

    Parameters
    ----------
    matrix : 3 x 3, row by row [pixels]
    shape : of its images (row, col, …)
    """
    content = {
        "cx": matrix[2],
        "cy": matrix[5],
        "fx": matrix[0],
        "fy": matrix[4],
        "width": shape[1],
        "height": shape[0],
    }
    file.write_text(json.dumps(content, indent=1) + "\n", newline="\n")


def _describe_objects(
    place: Path,
    scene: Path,
    frame: Frame,
    ending: str,
    seen: Mapping[str, np.ndarray],
    labels: Labels | CameraLabels,
    has_depth: np.ndarray,
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Write the masks of the targets in an image of a frame, and describe their poses and visible areas.

    Parameters
    ----------
    seen : matrix (4, 4) of image_from_<name> for all axes
    has_depth : (row, col)
    """
    poses, infos = [], []
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
        mask = labels.target == number
        file = f"{get_file_stem(place, frame)}_{place_in_image:06d}.png"
        for folder in MASKS:
            write_new_file(place, scene / f"{folder}{ending}" / file, encode_png((mask * 255).astype(np.uint8)))
        count, box = int(mask.sum()), _find_box(mask)
        infos.append(
            {
                "bbox_obj": box,
                "bbox_visib": box,
                "px_count_all": count,
                "px_count_valid": int((mask & has_depth).sum()),
                "px_count_visib": count,
                "visib_fract": 1.0 if count else 0.0,
            }
            | _describe_keypoints(frame, number, labels)
        )
    return poses, infos


def _describe_keypoints(frame: Frame, number: int, labels: Labels | CameraLabels) -> dict[str, list[float]]:
    """Return the keypoints of a target as COCO has them: column, row and flag (0, 1 hidden, 2 visible) one after another.

    Those outside the image have zeros.
    """
    has_keypoints = bool(frame.source.targets[number].keypoints)
    if labels.keypoint_px is None or labels.keypoint_visibility is None or not has_keypoints:
        return {}
    mine = frame.source.find_keypoints(number)
    row_col = np.nan_to_num(labels.keypoint_px[mine])
    flat = np.column_stack([row_col[:, ::-1], labels.keypoint_visibility[mine]]).ravel()
    return {"keypoints": np.round(flat, 3).tolist()}


def _find_box(mask: np.ndarray) -> list[int]:
    """Return left, top, width and height of the set pixels; four times -1 without any."""
    top, left, bottom, right = find_box(mask).tolist()
    return [left, top, right - left + 1, bottom - top + 1] if top >= 0 else [-1, -1, -1, -1]


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
