"""Maps that a laboratory measured of a camera, pixel by pixel, in SI units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from rso_lidar.detector.curve_fit.measured_curve import MeasuredCurve
from rso_lidar.errors import ScenarioError

MapQuantity = Literal["counts_mean", "range_mean", "detection_rate", "dark_counts"]
PixelConstant = Literal["gain", "offset", "t0", "threshold"]


@dataclass(frozen=True, eq=False)
class MeasuredMap:
    """A quantity of each pixel, measured at one level of light; arrays (row, col).

    Parameters
    ----------
    name : of the map in messages and reports
    quantity : what was measured
    photons : expected photons on each pixel, after the optics and before quantum efficiency; 0 for `dark_counts`
    value : mean [counts], mean error of range [m], number of flashes with a report, or number of triggers. NaN where a
        pixel reported nothing
    trials : reports behind each mean, flashes, or armed time of `dark_counts` [s]
    scatter : standard deviation of single reports over all pixels, in the unit of the values; NaN where it is not measured
    range_m : mean range of the plate [m]
    systematic : error of each pixel that all its trials share, 1 sigma, in the unit of the values
    """

    name: str
    quantity: MapQuantity
    photons: float
    value: np.ndarray
    trials: np.ndarray
    scatter: float
    range_m: float
    systematic: float

    def __post_init__(self) -> None:
        if self.value.ndim != 2 or self.trials.shape != self.value.shape:
            raise ScenarioError(
                f"{self.name}: has the shapes {self.value.shape} and {self.trials.shape}; give rows and columns of both"
            )

    def pool(self) -> MeasuredCurve:
        """Return the map as a curve of one point: that of all its pixels together."""
        known = np.isfinite(self.value)
        number = float(self.trials[known].sum())
        if self.quantity == "detection_rate":
            value = float(self.value[known].sum()) / number
        else:
            value = float(np.median(self.value[known]))
        if self.quantity == "dark_counts":  # of most pixels: a few hot ones hold most of the sum
            value *= int(known.sum())
        columns = [self.photons, value, number, self.range_m, np.nan, self.systematic]
        photons, values, trials, range_m, threshold, systematic = np.array(columns)[:, None]
        return MeasuredCurve(self.name, self.quantity, photons, values, trials, range_m, threshold, systematic)
