"""Frames as folders of PNG images, with annotations in the format of COCO (cocodataset.org/#format-data).

Annotations are a box and a mask for the target of each frame, written frame by frame at constant memory. Masks are
uncompressed run lengths, column by column, as pycocotools reads them.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from rso_lidar.dataset.annotation.frame_labels import LEAST_PHOTONS
from rso_lidar.dataset.conversion.frame_batches import ExportedFrame, read_batches, read_frames
from rso_lidar.export import choose_depth_scale, encode_png, quantize_depth
from rso_lidar.records import find_box
from rso_lidar.units import MM

if TYPE_CHECKING:
    from rso_lidar.dataset.reading.random_access import Dataset

OWN_TARGET = 0  # value of the label `target` on the sample's target; other bodies have other numbers
MASKS = ("target", "part_class_id")  # label k is the grey level k + 1, and the sky is 0
IMAGES = ("range_m", "intensity_counts", *MASKS)  # arrays that are written
_READ = (*IMAGES, "photons")
_OF_TARGET = ("lit_pixels", "reporting_pixels", "range_to_target_m", "position_m", "quaternion_xyzw")


def write_image_folders(folder: Path, data: Dataset, splits: Sequence[str], info: Mapping[str, Any]) -> float:
    """Write images/<split>/<range|intensity|target|part_class_id>/<frame>.png, and annotations/<split>.json.

    A grey level of a range image is a step of range, the same in all images of the folder. Grey level 0 is no return, or a
    range beyond 65,535 steps.

    Returns
    -------
    float
        Step of range [mm]: the finest of 0.1, 0.2, 0.5, 1, … with which 16 bits reach the farthest true range.
    """
    step_mm = choose_depth_scale(_find_farthest_m(data, splits))
    (folder / "annotations").mkdir()
    for split in splits:
        for kind in ("range", "intensity", *MASKS):
            (folder / "images" / split / kind).mkdir(parents=True)
        place = folder / "annotations" / f"{split}.json"
        with open_coco(place, {**info, "range_step_mm": step_mm}, data.classes) as coco:
            for frame in read_frames(data, split, _READ):
                _write_images(folder / "images" / split, frame, step_mm)
                _annotate(coco, frame)
    return step_mm


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
