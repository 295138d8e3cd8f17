"""The quantities that a requirement can bound: figures of merit, figures of other studies, and parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rso_lidar.errors import did_you_mean
from rso_lidar.mission_analysis import Budget
from rso_lidar.study.trades.merits import MERITS

Kind = Literal["merit", "budget", "reach", "finding", "timeline", "tracking", "parameter"]
REACH = "budget.max_range_m"
FINDING = ("finding.max_range_m", "finding.worst_range_m")
STATISTICS: dict[str, Callable[[np.ndarray], float]] = {
    "mean": lambda values: float(np.mean(values)),
    "rms": lambda values: float(np.sqrt(np.mean(values**2))),
    "median": lambda values: float(np.median(values)),
    "p95": lambda values: float(np.quantile(values, 0.95)),
    "greatest": lambda values: float(np.max(values)),
    "least": lambda values: float(np.min(values)),
}
EXTREMES = ("greatest", "least")  # no sample bounds them: the next run may exceed all of them
_UNITS = (  # ends of names of columns, the longest first
    ("_m_s2", "m/s²"), ("_rad_s", "rad/s"), ("_m_s", "m/s"), ("_rad", "rad"), ("_deg", "deg"), ("_photons", "photons"),
    ("photons", "photons"), ("_pixels", "pixels"), ("pixels_on_target", "pixels"), ("pixels_across", "pixels"),
    ("_returns", "pixels"), ("_counts", "counts"), ("_m", "m"), ("_s", "s"),
)  # fmt: skip


@dataclass(frozen=True)
class BoundedQuantity:
    """What a requirement bounds: `kind` states which study computes it, and `is_random` whether noise enters it."""

    name: str
    kind: Kind
    unit: str
    is_random: bool

    @property
    def column(self) -> str:
        """Name of the column in the table of its study."""
        return self.name.partition(".")[2]


def find_quantity(name: str) -> BoundedQuantity:
    """Return the quantity of a name.

    The unit of a parameter is found with the parameter and is empty here.

    Parameters
    ----------
    name : a figure of merit; ``budget.``, ``timeline.`` or ``tracking.`` and a column of that table;
        ``finding.max_range_m``; or the path of a parameter

    Raises
    ------
    ValueError
        For another name.
    """
    if name in MERITS:
        merit = MERITS[name]
        return BoundedQuantity(name, "merit", merit.unit, merit.noise != "none")
    study, dot, column = name.partition(".")
    if not dot:
        known = (*MERITS, REACH, *FINDING)
        raise ValueError(
            f"no quantity '{name}'{did_you_mean(name, known)} (figures of merit: {', '.join(sorted(MERITS))}; or "
            "budget.<column>, timeline.<column>, tracking.<column>, or the path of a parameter)"
        )
    if name == REACH:
        return BoundedQuantity(name, "reach", "m", False)
    if study == "budget":
        if column not in Budget.COLUMNS or column == "range_m":
            known = tuple(known_name for known_name in (*Budget.COLUMNS, "max_range_m") if known_name != "range_m")
            raise ValueError(
                f"a budget has no column '{column}'{did_you_mean(column, known)} (known: {', '.join(known)})"
            )
        return BoundedQuantity(name, "budget", find_column_unit(column), False)
    if study == "finding":
        if name not in FINDING:
            raise ValueError(f"no quantity '{name}'{did_you_mean(name, FINDING)} (known: {', '.join(FINDING)})")
        return BoundedQuantity(name, "finding", "m", False)
    if study == "timeline":
        return BoundedQuantity(name, "timeline", find_column_unit(column), False)
    if study == "tracking":
        return BoundedQuantity(name, "tracking", find_column_unit(column), True)
    return BoundedQuantity(name, "parameter", "", False)


def find_column_unit(column: str) -> str:
    """Return the unit that the name of a column ends with; 1 for none.

    >>> find_column_unit("pointing_error_rad"), find_column_unit("detection_probability")
    ('rad', '1')
    """
    return next((unit for end, unit in _UNITS if column.endswith(end)), "1")
