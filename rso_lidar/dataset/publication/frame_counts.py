"""Counts of the frames of a dataset by split, class and reporting pixels, and the ranges of its targets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from rso_lidar.dataset.reading.random_access import Dataset

NO_TARGET = "no target"
PIXEL_STEPS = (0, 1, 10, 100, 1000)  # lowest number of reporting pixels of each bin
_COLUMNS = ("class_id", "range_to_target_m", "reporting_pixels")


@dataclass(frozen=True)
class FrameCounts:
    """Frames by split and class, and by split and reporting pixels; and nearest and farthest range [m] by class."""

    by_class: dict[str, dict[str, int]]
    by_pixels: dict[str, tuple[int, ...]]
    ranges_m: dict[str, tuple[float, float]]

    @property
    def frames(self) -> dict[str, int]:
        """Number of frames of each split."""
        return {split: sum(classes.values()) for split, classes in self.by_class.items()}


def count_frames(data: Dataset) -> FrameCounts:
    """Count the frames of a dataset, one shard in memory at a time."""
    names = [*data.classes, NO_TARGET]
    by_class: dict[str, dict[str, int]] = {}
    by_pixels: dict[str, tuple[int, ...]] = {}
    nearest_m, farthest_m = np.full(len(data.classes), np.inf), np.full(len(data.classes), -np.inf)
    for name in data.splits:
        split = data.split(name)
        of_class, of_pixels = np.zeros(len(names), int), np.zeros(len(PIXEL_STEPS), int)
        for shard in range(len(split.records)):
            arrays = split.read_shard(shard, _COLUMNS)
            class_id, range_m = arrays["class_id"], arrays["range_to_target_m"]
            of_class += np.bincount(np.where(class_id < 0, len(names) - 1, class_id), minlength=len(names))
            known = (class_id >= 0) & np.isfinite(range_m)
            np.minimum.at(nearest_m, class_id[known], range_m[known])
            np.maximum.at(farthest_m, class_id[known], range_m[known])
            bins = np.searchsorted(PIXEL_STEPS, arrays["reporting_pixels"][class_id >= 0], side="right") - 1
            of_pixels += np.bincount(bins, minlength=len(PIXEL_STEPS))
        by_class[name] = dict(zip(names, of_class.tolist(), strict=True))
        by_pixels[name] = tuple(of_pixels.tolist())
    ranges = zip(data.classes, nearest_m.tolist(), farthest_m.tolist(), strict=True)
    ranges_m = {name: (low, high) for name, low, high in ranges if low <= high}
    return FrameCounts(by_class, by_pixels, ranges_m)
