"""What a trade study has found: a table of runs, and the means of its points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar.scenario import Scenario
from rso_lidar.study.trade_asked import Study
from rso_lidar.study.trade_plan import Plan


@dataclass(frozen=True, eq=False)
class TradeTable:
    """A trade study and its answers: `table` holds columns (row) by name: row, seed, fields, figures of merit, error."""

    study: Study
    base: Scenario
    plan: Plan
    table: dict[str, np.ndarray]

    def of_points(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return mean and standard deviation (point) of a figure of merit over its seeds; NaN where none has one."""
        values = self.table[name].reshape(-1, self.study.seeds)
        known = np.isfinite(values)
        count = known.sum(axis=1)
        mean = np.where(count > 0, np.where(known, values, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan)
        squared = np.where(known, (values - mean[:, None]) ** 2, 0.0).sum(axis=1)
        return mean, np.where(count > 1, np.sqrt(squared / np.maximum(count - 1, 1)), np.nan)
