"""Frames as folders of PNG images, with annotations in the format of COCO, for viewing and for image tools."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar.dataset.annotation.frame_labels import LEAST_PHOTONS
from rso_lidar.dataset.conversion.coco_annotations import CocoWriter, open_coco
from rso_lidar.dataset.conversion.frame_batches import ExportedFrame, read_batches, read_frames
from rso_lidar.export import choose_depth_scale, encode_png, quantize_depth
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
    """Write the images of one frame.

    Parameters
    ----------
    step_mm : range of one grey level [mm]
    """
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
