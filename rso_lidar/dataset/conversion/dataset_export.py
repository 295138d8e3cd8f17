"""Exports of a dataset in formats of other libraries: written completely or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar.dataset.conversion.frame_batches import choose_images
from rso_lidar.dataset.conversion.image_folders import list_images, write_image_folders
from rso_lidar.dataset.conversion.tar_archives import write_tar_archives
from rso_lidar.dataset.conversion.tensorflow_files import write_tensorflow_files
from rso_lidar.dataset.shards.layout import is_image
from rso_lidar.errors import DatasetError, did_you_mean
from rso_lidar.export import check_export_folder, draft_export_folder
from rso_lidar.units import MM

if TYPE_CHECKING:
    from rso_lidar.dataset.reading.random_access import Dataset

MARK = "dataset_export.json"  # marks a folder as an export, which --overwrite may replace
EXPORT_FORMATS = {
    "webdataset": "tar archives of arrays, for reading in sequence from object stores",
    "images": "folders of PNG images with annotations in the format of COCO",
    "tfrecord": "TFRecord files of messages tf.train.Example",
}
_LIMITS = {
    "webdataset": "no precision",
    "images": "differences of range below one grey level",
    "tfrecord": "double precision of numbers",
}


def export_dataset(
    data: Dataset,
    path: str | os.PathLike[str],
    to: str,
    *,
    splits: Sequence[str] = (),
    images: Sequence[str] = (),
    overwrite: bool = False,
) -> list[str]:
    """Write the frames of a dataset in a format of other libraries.

    Parameters
    ----------
    data : the dataset
    path : of the folder to write
    to : name of the format, one of `EXPORT_FORMATS`
    splits : names of the splits to write; all if empty
    images : names of the arrays of images to write; ``all`` for all of them. If empty, those of the reading, the target
        and the part classes
    overwrite : replace an older export once the new one is complete

    Returns
    -------
    list of str
        Lines for the user: what was written and what was left out.

    Raises
    ------
    DatasetError
        For an unknown format, split or array, and for a choice of arrays with the format `images`, which has its own.
    RecordingError
        If the folder may not be written.
    """
    chosen = _choose_splits(data, splits)
    _check_format(to, images)
    place = check_export_folder(path, overwrite=overwrite)
    arrays = choose_images(data.split(chosen[0]), images)
    info: dict[str, Any] = {
        "description": data.spec.name,
        "rso_lidar_version": version("rso-lidar"),
        "format": to,
        "splits": {name: len(data.split(name)) for name in chosen},
        "classes": list(data.classes),
        "part_classes": list(data.part_classes),
    }
    lines = []
    with draft_export_folder(place, overwrite=overwrite) as draft:
        if to == "images":
            arrays = list_images(data)
            advice = f"this format has {', '.join(arrays)} only"
            info["range_step_mm"] = step_mm = write_image_folders(draft, data, chosen, info)
            lines.append(
                f"range       {step_mm:g} mm per grey level; 0 is no return, or a range beyond "
                f"{np.iinfo(np.uint16).max * step_mm * MM:,.0f} m"
            )
        else:
            info["images"], advice = arrays, "choose arrays by --arrays, or all of them by --arrays all"
            write = write_tar_archives if to == "webdataset" else write_tensorflow_files
            write(draft, data, chosen, arrays)
        left = [name for name in data.split(chosen[0]).names if is_image(name) and name not in arrays]
        lines += [f"left out    images {', '.join(left)}; {advice}"] if left else []
        (draft / MARK).write_text(json.dumps(info, indent=1) + "\n", encoding="utf-8", newline="\n")
    return [f"written     {place} ({to}, {sum(info['splits'].values())} frames); lost: {_LIMITS[to]}", *lines]


def _choose_splits(data: Dataset, splits: Sequence[str]) -> list[str]:
    """Return the names of the splits to write, each once; all if none is given."""
    chosen = list(dict.fromkeys(splits or data.splits))
    if not chosen:
        raise DatasetError(f"{data.folder}: holds no frames yet; make them with --resume")
    for name in chosen:
        data.split(name)  # raises for an unknown name
    return chosen


def _check_format(to: str, images: Sequence[str]) -> None:
    """Check the name of a format, and that it takes a choice of arrays."""
    if to == "matlab":
        raise DatasetError("matlab: reads the shards as they are; see examples/matlab/dataset_datastore.m")
    if to not in EXPORT_FORMATS:
        raise DatasetError(
            f"{to}: no such format{did_you_mean(to, EXPORT_FORMATS)} (known: {', '.join(EXPORT_FORMATS)})"
        )
    if to == "images" and images:
        raise DatasetError(f"images: has range, intensity, target and part class; leave out {', '.join(images)}")
