"""Annotations in the format of COCO: a box and a mask for the target of each frame (cocodataset.org/#format-data).

The file is written frame by frame, at constant memory. Masks are uncompressed run lengths, column by column, as pycocotools
reads them.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from rso_lidar.dataset.annotation.frame_labels import find_box


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
        """Write one entry of a list.

        Parameters
        ----------
        kind : 0 for images, 1 for annotations
        """
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
