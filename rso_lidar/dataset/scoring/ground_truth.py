"""Truth of the frames that predictions are scored against."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rso_lidar.dataset.metrics.resampling import EncounterIndex

MIN_LIT_PIXELS = 1


@dataclass(frozen=True, eq=False)
class FrameTruth:
    """Truth of some frames, one row each.

    Arrays (frame) are named as in the shards of a dataset: `sample`, `step` and `draw` identify a frame, `class_id` and
    `model_id` are -1 without a target, and poses are lidar_from_target, NaN without a target. A frame with fewer than
    `min_lit_pixels` lit pixels carries no light to judge by: it is left out of all but false alarms.
    """

    sample: np.ndarray
    step: np.ndarray
    draw: np.ndarray
    class_id: np.ndarray
    model_id: np.ndarray
    present: np.ndarray
    range_to_target_m: np.ndarray
    lit_pixels: np.ndarray
    reporting_pixels: np.ndarray
    total_photons: np.ndarray
    position_m: np.ndarray
    quaternion_xyzw: np.ndarray
    classes: tuple[str, ...]
    models: tuple[str, ...]
    min_lit_pixels: int = MIN_LIT_PIXELS

    def __len__(self) -> int:
        return len(self.sample)

    @cached_property
    def encounters(self) -> EncounterIndex:
        """Encounter of each frame: its sample."""
        return EncounterIndex(self.sample)

    @cached_property
    def is_lit(self) -> np.ndarray:
        """Frames (frame) with a target that enough pixels could see."""
        lit: np.ndarray = (self.present > 0) & (self.class_id >= 0) & (self.lit_pixels >= self.min_lit_pixels)
        return lit

    @staticmethod
    def from_columns(
        columns: Mapping[str, np.ndarray], classes: tuple[str, ...], models: tuple[str, ...], min_lit_pixels: int
    ) -> FrameTruth:
        """Take the truth from columns of a split.

        Parameters
        ----------
        columns : arrays (frame, …) by the names of `COLUMNS`
        classes, models : names by number
        min_lit_pixels : least number of lit pixels of a frame that matters
        """
        taken = {name: np.asarray(columns[name]) for name in COLUMNS}
        return FrameTruth(**taken, classes=classes, models=models, min_lit_pixels=min_lit_pixels)


COLUMNS = (
    "sample", "step", "draw", "class_id", "model_id", "present", "range_to_target_m", "lit_pixels", "reporting_pixels",
    "total_photons", "position_m", "quaternion_xyzw",
)  # fmt: skip
