"""Statistics of labelled frames, by class and split."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar.dataset.checking.leaks import find_constants, find_leaks

COLUMNS = (
    "class_id",
    "present",
    "range_to_target_m",
    "lit_pixels",
    "reporting_pixels",
    "total_photons",
    "position_m",
    "intrinsics_px",
    "step",
    "draw",
)
_SHARES = (0.0, 0.5, 1.0)
_FEW_PIXELS, _MANY_PIXELS = 1, 100  # reporting pixels: detected at all; needed to classify (Fuller et al., sec. 5)


@dataclass(frozen=True, eq=False)
class LabelStatistics:
    """Columns of labels of many frames, with their table and warnings.

    Parameters
    ----------
    columns : arrays (frame) by name: those of `COLUMNS`, and drawn numbers
    classes : names of the classes
    """

    columns: Mapping[str, np.ndarray]
    classes: Sequence[str]

    @property
    def offset_px(self) -> np.ndarray:
        """Distance of the target's origin from the centre of the image (frame) [px], NaN without a target."""
        x, y, z = self.columns["position_m"].T
        offset: np.ndarray = np.hypot(x, y) / z * self.columns["intrinsics_px"][:, 0]
        return offset

    def tabulate(self) -> list[str]:
        """Return a table of ranges, pixels and photons by class, as lines."""
        ranges, pixels, many = "range, m (min, median, max)", "reporting pixels", "over 100"
        lines = [f"{'class':20} {'frames':>8} {ranges:>29} {pixels:>22} {'none':>6} {many:>9}"]
        for k, name in enumerate(self.classes):
            mine = self.columns["class_id"] == k
            if not mine.any():
                continue
            ranges = "  ".join(f"{x:8.4g}" for x in np.quantile(self.columns["range_to_target_m"][mine], _SHARES))
            reporting = self.columns["reporting_pixels"][mine]
            pixels = "  ".join(f"{x:6.0f}" for x in np.quantile(reporting, _SHARES))
            none, many = np.mean(reporting < _FEW_PIXELS), np.mean(reporting > _MANY_PIXELS)
            lines.append(f"{name:20} {mine.sum():8,} {ranges:>29} {pixels:>22} {none:6.0%} {many:9.0%}")
        without = int((self.columns["present"] == 0).sum())
        return [*lines, f"{'no target':20} {without:8,}"] if without else lines

    def warn(self) -> list[str]:
        """Return one line for each leak, and for each finding about targets and returns."""
        first = self.columns["draw"] == 0  # other noise draws share the pose, so they are not independent
        with_target = first & (self.columns["present"] == 1)
        independent = with_target & (self.columns["step"] == 0)  # later frames of an encounter resemble its first
        drawn = {name: values for name, values in self.columns.items() if name not in COLUMNS}
        tested = {"range": self.columns["range_to_target_m"], "offset from the centre": self.offset_px} | drawn
        reporting = np.where(self.columns["present"] == 1, self.columns["reporting_pixels"], -1)
        return [
            *find_leaks(
                {name: values[independent] for name, values in tested.items()},
                self.columns["class_id"][independent],
                self.classes,
            ),
            *find_constants(self.offset_px[with_target], reporting[first]),
        ]
