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

    Target, part and distance are those of the part that covers most of the pixel.
    """

    electrons: np.ndarray = array(
        "row col band", "f4", "1", "expected electrons in each pixel, before the full well and without noise"
    )
    target: np.ndarray = array("row col", "i2", "1", "index of the target, -1 for sky")
    part: np.ndarray = array("row col", "i2", "1", "index of the target's part, -1 for sky")
    range_m: np.ndarray = array("row col", "f8", "m", "slant distance from the camera's origin, NaN for sky")
    filled_fraction: np.ndarray = array("row col", "f4", "1", "share of the pixel's area that is on a target")
