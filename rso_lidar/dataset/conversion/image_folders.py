"""Frames as folders of PNG images, with annotations in the format of COCO (cocodataset.org/#format-data).

Annotations are a box and a mask for the target of each frame, written frame by frame at constant memory. Masks are
uncompressed run lengths, column by column, as pycocotools reads them.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from rso_lidar.dataset.annotation.frame_labels import LEAST_PHOTONS, find_box
from rso_lidar.dataset.conversion.frame_batches import ExportedFrame, read_batches, read_frames
from rso_lidar.dataset.shards.layout import name_camera_array
from rso_lidar.export import choose_depth_scale, encode_png, quantize_depth, split_bands
from rso_lidar.units import MM

if TYPE_CHECKING:
    from rso_lidar.dataset.reading.random_access import Dataset

OWN_TARGET = 0  # value of the label `target` on the sample's target; other bodies have other numbers
MASKS = ("target", "part_class_id")  # label k is the grey level k + 1, and the sky is 0
_IMAGES = ("range_m", "intensity_counts", *MASKS)  # arrays of the lidar that are written
_CAMERA_IMAGES = ("intensity_counts", *MASKS)  # and of each camera beside it
_OF_TARGET = ("lit_pixels", "reporting_pixels", "range_to_target_m", "position_m", "quaternion_xyzw")
_OF_TARGET_IN_IMAGE = ("target_pixels", "position_m", "quaternion_xyzw")


def write_image_folders(folder: Path, data: Dataset, splits: Sequence[str], info: Mapping[str, Any]) -> float:
    """Write images/<split>/<range|intensity|target|part_class_id>/<frame>.png, and annotations/<split>.json.

    A grey level of a range image is a step of range, the same in all images of the folder. Grey level 0 is no return, or a
    range beyond 65,535 steps. Images of a camera beside the lidar are in images/<split>/camera.<name>/<intensity|…>, and
    their annotations in annotations/<split>.camera.<name>.json. Their grey levels are counts of the sensor.

    Returns
    -------
    float
        Step of range [mm]: the finest of 0.1, 0.2, 0.5, 1, … with which 16 bits reach the farthest true range.
    """
    step_mm = choose_depth_scale(_find_farthest_m(data, splits))
    images = [*list_images(data), "photons"]
    (folder / "annotations").mkdir()
    for split in splits:
        below = folder / "images" / split
        for kind in ("range", "intensity", *MASKS):
            (below / kind).mkdir(parents=True)
        with ExitStack() as stack:
            place = folder / "annotations" / f"{split}.json"
            coco = stack.enter_context(open_coco(place, {**info, "range_step_mm": step_mm}, data.classes))
            cameras = {}
            for camera in data.cameras:
                for kind in ("intensity", *MASKS):
                    (below / f"camera.{camera}" / kind).mkdir(parents=True)
                tables = {
                    sensor: json.loads(entries[camera].table) for sensor, entries in data.constants.cameras.items()
                }
                place = folder / "annotations" / f"{split}.camera.{camera}.json"
                cameras[camera] = stack.enter_context(open_coco(place, {**info, "cameras": tables}, data.classes))
            for frame in read_frames(data, split, images):
                _write_images(below, frame, step_mm)
                _annotate(coco, frame)
                for camera, coco_of_camera in cameras.items():
                    bands = _list_bands(data, camera)
                    names = _write_camera_images(below / f"camera.{camera}", frame, camera, bands)
                    _annotate_image(coco_of_camera, frame, camera, names)
    return step_mm


def list_images(data: Dataset) -> list[str]:
    """List the arrays that become images."""
    of_cameras = [name_camera_array(camera, field) for camera in data.cameras for field in _CAMERA_IMAGES]
    return [*_IMAGES, *of_cameras]


def _list_bands(data: Dataset, camera: str) -> list[str]:
    """Return the names of the bands of a camera, those of the first sensor."""
    return [band["name"] for band in json.loads(data.constants.cameras[data.sensors[0]][camera].table)["bands"]]


def _write_camera_images(folder: Path, frame: ExportedFrame, camera: str, bands: Sequence[str]) -> list[str]:
    """Write the image of a camera and its masks, and return the names of the files of the image."""
    names = []
    for suffix, image in split_bands(bands, frame.images[name_camera_array(camera, "intensity_counts")]):
        names.append(f"{frame.name}{suffix}.png")
        (folder / "intensity" / names[-1]).write_bytes(encode_png(image))
    for mask in MASKS:
        levels = (frame.images[name_camera_array(camera, mask)] + 1).astype(np.uint8)
        (folder / mask / f"{frame.name}.png").write_bytes(encode_png(levels))
    return names


def _annotate_image(coco: CocoWriter, frame: ExportedFrame, camera: str, names: Sequence[str]) -> None:
    """Add an image of a camera, in files of some names, and its target to the annotations of its split."""
    target = frame.images[name_camera_array(camera, "target")]
    facts = frame.description
    files = [f"{facts['split']}/camera.{camera}/intensity/{name}" for name in names]
    image = {"file_name": files[0], "height": target.shape[0], "width": target.shape[1], "files": files}
    of_target = {field: facts[name_camera_array(camera, field)] for field in _OF_TARGET_IN_IMAGE}
    coco.add({**image, **facts}, (target == OWN_TARGET) & bool(facts["present"]), facts["class_id"] + 1, of_target)


def _find_farthest_m(data: Dataset, splits: Sequence[str]) -> float:
    """Return the farthest true range [m] of the splits."""
    farthest_m = 0.0
    for split in splits:
        for batch in read_batches(data.split(split), ["true_range_m"]):
            known = batch["true_range_m"][np.isfinite(batch["true_range_m"])]
            farthest_m = max(farthest_m, float(known.max(initial=0.0)))
    return farthest_m


def _write_images(folder: Path, frame: ExportedFrame, step_mm: float) -> None:
    """Write the images of one frame, with `step_mm` of range [mm] to a grey level."""
    levels = quantize_depth(
        frame.images["range_m"].astype(float), step_mm * MM
    )  # 0 for false alarms far behind all bodies
    pictures = {"range": levels, "intensity": frame.images["intensity_counts"].astype(np.uint16)}
    pictures |= {mask: (frame.images[mask] + 1).astype(np.uint8) for mask in MASKS}
    for kind, picture in pictures.items():
        (folder / kind / f"{frame.name}.png").write_bytes(encode_png(picture))


def _annotate(coco: CocoWriter, frame: ExportedFrame) -> None:
    """Add a frame, and its target where there is one, to the annotations of its split."""
    n_rows, n_cols = frame.images["target"].shape
    facts = frame.description
    image = {"file_name": f"{facts['split']}/intensity/{frame.name}.png", "height": n_rows, "width": n_cols}
    mask = (frame.images["target"] == OWN_TARGET) & (frame.images["photons"] >= LEAST_PHOTONS)
    of_target = {key: facts[key] for key in _OF_TARGET}
    coco.add({**image, **facts}, mask & bool(facts["present"]), facts["class_id"] + 1, of_target)


class CocoWriter:
    """Writer of the images and annotations of one file, frame by frame; `open_coco` makes it."""

    def __init__(self, images: TextIO, annotations: TextIO) -> None:
        self._images, self._annotations = images, annotations
        self._counts = [0, 0]

    def add(self, image: Mapping[str, Any], mask: np.ndarray, category: int, more: Mapping[str, Any]) -> None:
        """Add a frame.

        Parameters
        ----------
        image : entry of the image, without its number
        mask : (row, col) bool, pixels of the target. If it is empty, the frame has no annotation
        category : number of the target's class
        more : further keys of the annotation
        """
        self._write(self._images, 0, {"id": self._counts[0] + 1, **image})
        if mask.any():
            number = self._counts[1] + 1
            entry = {"id": number, "image_id": self._counts[0], "category_id": category, **outline_mask(mask), **more}
            self._write(self._annotations, 1, entry)

    def _write(self, stream: TextIO, kind: int, entry: Mapping[str, Any]) -> None:
        """Write one entry of a list: kind 0 for images, 1 for annotations."""
        stream.write(f"{',' if self._counts[kind] else ''}\n{json.dumps(entry)}")
        self._counts[kind] += 1


@contextmanager
def open_coco(place: Path, info: Mapping[str, Any], categories: Sequence[str]) -> Iterator[CocoWriter]:
    """Yield a writer of an annotation file, which is complete when the context ends.

    Parameters
    ----------
    categories : names of the classes; their numbers in the file start at 1, because many readers take 0 for background
    """
    listed = [{"id": number, "name": name, "supercategory": "target"} for number, name in enumerate(categories, 1)]
    beside = place.with_suffix(".annotations")
    with place.open("w", encoding="utf-8", newline="\n") as images:
        images.write(f'{{"info": {json.dumps(info)},\n"categories": {json.dumps(listed)},\n"images": [')
        with beside.open("w+", encoding="utf-8", newline="\n") as annotations:
            yield CocoWriter(images, annotations)
            images.write('],\n"annotations": [')
            annotations.seek(0)
            while part := annotations.read(1 << 20):
                images.write(part)
        beside.unlink()
        images.write("]}\n")


def outline_mask(mask: np.ndarray) -> dict[str, Any]:
    """Return the box, area and run lengths of a mask, as COCO defines them.

    Parameters
    ----------
    mask : (row, col) bool, with at least one pixel

    Returns
    -------
    dict
        ``bbox`` (left, top, width, height [pixels]), ``area`` [pixels], ``segmentation`` and ``iscrowd``.
    """
    top, left, bottom, right = find_box(mask).tolist()
    return {
        "bbox": [left, top, right - left + 1, bottom - top + 1],
        "area": int(mask.sum()),
        "segmentation": {"counts": measure_runs(mask), "size": list(mask.shape)},
        "iscrowd": 0,
    }


def measure_runs(mask: np.ndarray) -> list[int]:
    """Return the lengths of runs of equal pixels of a mask, column by column; the first run is of unset pixels.

    Parameters
    ----------
    mask : (row, col) bool

    >>> measure_runs(np.array([[False, True], [False, True], [True, False]]))
    [2, 3, 1]
    """
    flat = mask.ravel(order="F")
    ends = np.flatnonzero(np.diff(flat)) + 1
    edges = np.concatenate([[0], ends, [flat.size]])
    runs = np.diff(edges).tolist()
    return [0, *runs] if flat[0] else runs
