"""Many element sets flown side by side by SGP4, each at its own instants or all at the same, in TEME axes.

Distances and speeds are the same in TEME as in GCRS. What SGP4 rejects is NaN, never an exception: of thousands a few
have always decayed.
"""

from __future__ import annotations

import datetime
from collections.abc import Sequence

import numpy as np

from rso_lidar import units
from rso_lidar.orbit.element_set import ElementSet
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.teme import REASONS, failed


class Fleet:
    """Element sets, in the order given, flown at seconds counted from `start_utc`."""

    def __init__(self, sets: Sequence[ElementSet], start_utc: datetime.datetime) -> None:
        self.sets = tuple(sets)
        self.start_utc = start_utc
        self._models = [entry.satrec() for entry in self.sets]
        epochs = [entry.epoch_utc for entry in self.sets]
        # SGP4 subtracts dates, so that the leap seconds of an epoch must be counted on: they change at half years only.
        halves = [(epoch.year, epoch.month > 6) for epoch in epochs]
        first = dict(zip(halves, epochs, strict=True))
        self._eras = list(first.values())
        number = {half: k for k, half in enumerate(first)}
        self._era = np.array([number[half] for half in halves], dtype=int)

    def __len__(self) -> int:
        return len(self.sets)

    def grid(self, which: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return position [m], velocity [m/s] (set, time, 3) and SGP4's error codes (set, time) at common instants.

        NaN where there is no state; `which` picks the sets by number.
        """
        from sgp4.api import SatrecArray

        which = np.asarray(which, dtype=int)
        position = np.empty((len(which), len(time_s), 3))
        velocity = np.empty_like(position)
        error = np.zeros(position.shape[:2], dtype=int)
        for era in np.unique(self._era[which]):
            rows = np.flatnonzero(self._era[which] == era)
            dates = self._dates(time_s, int(era))
            error[rows], position[rows], velocity[rows] = SatrecArray([self._models[k] for k in which[rows]]).sgp4(
                *dates
            )
        return *_checked(position, velocity, error), error

    def at(self, which: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (pair, 3) of the set ``which[k]`` at ``time_s[k]``; NaN where none."""
        which, time_s = np.asarray(which, dtype=int), np.asarray(time_s, dtype=float)
        position = np.empty((len(which), 3))
        velocity = np.empty_like(position)
        error = np.zeros(len(which), dtype=int)
        for era in np.unique(self._era[which]):
            mine = np.flatnonzero(self._era[which] == era)
            mine = mine[np.argsort(which[mine], kind="stable")]
            whole, fraction = self._dates(time_s[mine], int(era))
            edges = np.flatnonzero(np.diff(which[mine])) + 1
            for begin, end in zip([0, *edges.tolist()], [*edges.tolist(), len(mine)], strict=True):
                rows = mine[begin:end]
                model = self._models[which[rows[0]]]
                error[rows], position[rows], velocity[rows] = model.sgp4_array(whole[begin:end], fraction[begin:end])
        return _checked(position, velocity, error)

    def _dates(self, time_s: np.ndarray, era: int) -> tuple[np.ndarray, np.ndarray]:
        return Epochs(self.start_utc, time_s).utc_julian(leap_seconds_at=self._eras[era])


def reason(error: int) -> str:
    """Return in words why SGP4 has no state, from its error code; 0 stands for a state that is nowhere possible."""
    return REASONS.get(error, "it has decayed or gone astray")


def _checked(position_km: np.ndarray, velocity_km_s: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    position, velocity = position_km * units.KM, velocity_km_s * units.KM
    bad = failed(position, velocity, error)
    position[bad], velocity[bad] = np.nan, np.nan
    return position, velocity
