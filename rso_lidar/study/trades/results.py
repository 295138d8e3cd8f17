"""The results of a trade study: a table of runs, and the means of its points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar.scenario import Scenario
from rso_lidar.study.trades.definition import Study
from rso_lidar.study.trades.merits import DETECTION, MERITS
from rso_lidar.study.trades.plan import TradePlan


@dataclass(frozen=True, eq=False)
class TradeTable:
    """A trade study and its results: `table` holds columns (row) by name: row, seed, fields, figures of merit, error.

    Where a figure of merit depends on detection, there are also ``detection_fraction``, ``detected`` and
    ``min_detection_fraction``. ``detected`` is 1 where the point's mean over seeds reaches that limit.
    """

    study: Study
    base: Scenario
    plan: TradePlan
    table: dict[str, np.ndarray]

    @property
    def needs_detection(self) -> bool:
        """Whether a figure of merit depends on detection, so that points need a minimum detection fraction."""
        return any(MERITS[name].of_detected for name in self.study.merits)

    @property
    def detected(self) -> np.ndarray:
        """Mask (point) of points whose detection fraction, averaged over seeds, reaches the study's minimum."""
        mean = self.of_points(DETECTION)[0]
        enough: np.ndarray = np.isfinite(mean) & (mean >= self.study.min_detection_fraction)
        return enough

    def ranked(self, name: str) -> np.ndarray:
        """Return a mask (point) of points that a figure of merit ranks: with a value, and with enough detections.

        Parameters
        ----------
        name : of the figure of merit
        """
        known: np.ndarray = np.isfinite(self.of_points(name)[0])
        return np.logical_and(known, self.detected) if MERITS[name].of_detected else known

    def of_points(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return mean and standard deviation (point) of a figure of merit over the seeds; NaN where no seed has a value.

        Parameters
        ----------
        name : of the figure of merit
        """
        values = self.table[name].reshape(-1, self.study.seeds)
        known = np.isfinite(values)
        count = known.sum(axis=1)
        mean = np.where(count > 0, np.where(known, values, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan)
        squared = np.where(known, (values - mean[:, None]) ** 2, 0.0).sum(axis=1)
        return mean, np.where(count > 1, np.sqrt(squared / np.maximum(count - 1, 1)), np.nan)
