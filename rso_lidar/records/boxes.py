"""Boxes about labelled pixels: of each target in an image, and of each of its parts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar.records.image import CameraLabels
from rso_lidar.records.reading import Labels


@dataclass(frozen=True)
class LabelBox:
    """Box about the pixels whose label is one target, or one part of it.

    `target` and `part` are indices in `Source.targets` and in its `parts`; `part` is None for the whole target. `box_px` has
    first row, first column, last row and last column. `pixels` counts the labelled pixels in the box.
    """

    target: int
    part: int | None
    box_px: tuple[int, int, int, int]
    pixels: int


def find_boxes(labels: Labels | CameraLabels, *, by_part: bool = False) -> list[LabelBox]:
    """Find the boxes of all targets in an image of the lidar or of a camera, or of all their parts.

    A box holds the pixels whose label it is: what another target or part covers is outside.

    Parameters
    ----------
    labels : of the image
    by_part : whether each part has a box, instead of each target

    Returns
    -------
    list of LabelBox
        In the order of targets and parts; those without a pixel are left out.
    """
    boxes = []
    for target in np.unique(labels.target[labels.target >= 0]).tolist():
        mine = labels.target == target
        for part in np.unique(labels.part[mine]).tolist() if by_part else [None]:
            marked = mine if part is None else mine & (labels.part == part)
            first_row, first_col, last_row, last_col = find_box(marked).tolist()
            boxes.append(LabelBox(target, part, (first_row, first_col, last_row, last_col), int(marked.sum())))
    return boxes


def find_box(marked: np.ndarray) -> np.ndarray:
    """Return first row, first column, last row and last column of the marked pixels, or -1 where none is.

    Parameters
    ----------
    marked : (row, col) bool

    Returns
    -------
    ndarray
        (edge) i2.

        >>> find_box(np.array([[False, True, True], [False, False, True]])).tolist()
        [0, 1, 1, 2]
    """
    if not marked.any():
        return np.full(4, -1, np.int16)
    rows, cols = np.flatnonzero(marked.any(axis=1)), np.flatnonzero(marked.any(axis=0))
    return np.array([rows[0], cols[0], rows[-1], cols[-1]], np.int16)
