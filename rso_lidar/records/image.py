"""Images of cameras beside the lidar: what the sensor said, and what was really there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar.records.schema import Record, array


@dataclass(frozen=True, eq=False, repr=False)
class CameraImage(Record):
    """Image of one camera, taken about a laser flash: what the spacecraft could know of it."""

    intensity_counts: np.ndarray = array("row col band", "u2", "count", "output of the sensor, black level included")
    exposure_s: np.ndarray = array("", "f8", "s", "time for which each row was exposed")


@dataclass(frozen=True, eq=False, repr=False)
class CameraLabels(Record):
    """True content of the pixels of one camera, at the middle of its exposure.

    Target, part, facet and distance are those of the part that covers most of the pixel, and of its largest facet there.
    Keypoints are in the order of `Source.keypoints`.
    """

    electrons: np.ndarray = array(
        "row col band", "f4", "1", "expected electrons in each pixel, before the full well and without noise"
    )
    target: np.ndarray = array("row col", "i2", "1", "index of the target, -1 for sky")
    part: np.ndarray = array("row col", "i2", "1", "index of the target's part, -1 for sky")
    range_m: np.ndarray = array("row col", "f8", "m", "slant distance from the camera's origin, NaN for sky")
    filled_fraction: np.ndarray = array("row col", "f4", "1", "share of the pixel's area that is on a target")
    facet: np.ndarray | None = array(
        "row col", "i4", "1", "facet index in the source file, -1 for sky; None in older recordings", optional=True
    )
    keypoint_px: np.ndarray | None = array(
        "keypoint row_col",
        "f8",
        "1",
        "row and column of each keypoint, 0 at the centre of the first pixel; NaN outside the field",
        optional=True,
    )
    keypoint_range_m: np.ndarray | None = array(
        "keypoint", "f8", "m", "distance of each keypoint from the sensor's origin", optional=True
    )
    keypoint_visibility: np.ndarray | None = array(
        "keypoint", "u1", "1", "0 outside the field, 1 hidden by a target, 2 visible", optional=True
    )
