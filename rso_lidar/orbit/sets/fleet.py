"""Many element sets flown side by side by SGP4, each at its own instants or all at the same, in TEME axes.

`ScheduledFleet` are of objects, which may have several sets each.

Distances and speeds are the same in TEME as in GCRS. What SGP4 rejects is NaN, never an exception: of thousands a few
have always decayed.
"""

from __future__ import annotations

import datetime
from collections.abc import Sequence

import numpy as np

from rso_lidar import units
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.sets.element_set import ElementSet
from rso_lidar.orbit.sets.teme import MOST_AGE_S, TOO_OLD, find_failures

SWITCH_S = 1e-4  # a set ends so long before the next begins: an instant has one set


class Fleet:
    """Element sets, in the order given, flown at seconds counted from `start_utc`."""

    def __init__(self, sets: Sequence[ElementSet], start_utc: datetime.datetime) -> None:
        self.sets = tuple(sets)
        self.start_utc = start_utc
        self._models = [entry.satrec() for entry in self.sets]
        epochs = [entry.epoch_utc for entry in self.sets]
        # SGP4 subtracts dates, so that the leap seconds of an epoch must be counted on: they change at half years only.
        start = Epochs(start_utc, np.zeros(1))
        self._since_epoch_s = np.array([float(start.since(epoch)[0]) for epoch in epochs])
        halves = [(epoch.year, epoch.month > 6) for epoch in epochs]
        first = dict(zip(halves, epochs, strict=True))
        self._eras = list(first.values())
        number = {half: k for k, half in enumerate(first)}
        self._era = np.array([number[half] for half in halves], dtype=int)

    def __len__(self) -> int:
        return len(self.sets)

    def grid(self, which: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return position [m], velocity [m/s] (set, time, 3) and SGP4's error codes (set, time) at common instants.

        NaN where there is no state, or none within `MOST_YEARS` of the epoch; `which` picks the sets by number.
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
        error[np.abs(self._since_epoch_s[which][:, None] + time_s) > MOST_AGE_S] = TOO_OLD
        return *_mask_failures(position, velocity, error), error

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
        error[np.abs(self._since_epoch_s[which] + time_s) > MOST_AGE_S] = TOO_OLD
        return _mask_failures(position, velocity, error)

    def _dates(self, time_s: np.ndarray, era: int) -> tuple[np.ndarray, np.ndarray]:
        return Epochs(self.start_utc, time_s).utc_julian(leap_seconds_at=self._eras[era])


class ScheduledFleet:
    """Objects flown for a span: each by its only element set, or by that of several whose epoch is nearest.

    Between sets it switches half-way between neighbouring epochs, and jumps there, as `SeveralSets` does. `fleet` holds
    the sets that are flown within the span, those of one object together and in their order, `owner` (set) is whose they
    are, and `from_s`, `to_s` (set) are when each flies [s since the start]; the ends are open.
    """

    def __init__(
        self, objects: Sequence[ElementSet | Sequence[ElementSet]], start_utc: datetime.datetime, duration_s: float
    ) -> None:
        start = Epochs(start_utc, np.zeros(1))
        sets: list[ElementSet] = []
        owner: list[int] = []
        from_s: list[float] = []
        for number, entry in enumerate(objects):
            flown = [(-np.inf, entry)] if isinstance(entry, ElementSet) else _schedule(entry, start, duration_s)
            for begin_s, elements in flown:
                sets.append(elements)
                owner.append(number)
                from_s.append(begin_s)
        self.start_utc = start_utc
        self.duration_s = duration_s
        self.fleet = Fleet(sets, start_utc)
        self.owner = np.array(owner, dtype=int)
        self.from_s = np.array(from_s)
        last = np.append(self.owner[1:] != self.owner[:-1], True)[: len(sets)]
        self.to_s = np.where(last, np.inf, np.append(self.from_s[1:], np.inf)[: len(sets)] - SWITCH_S)
        self._first = np.searchsorted(self.owner, np.arange(len(objects)))
        self._count = np.bincount(self.owner, minlength=len(objects))

    def __len__(self) -> int:
        return len(self._first)

    @property
    def several(self) -> np.ndarray:
        """Return which objects (object) switch between sets within the span."""
        more: np.ndarray = self._count > 1
        return more

    def number(self, which: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Return the number in `fleet` (pair) of the set that flies object ``which[k]`` at ``time_s[k]``."""
        number: np.ndarray = self._first[which]
        count = self._count[which]
        for k in range(1, int(count.max(initial=1))):
            after = np.where(k < count, self._first[which] + k, 0)
            number = np.where((k < count) & (self.from_s[after] <= time_s), after, number)
        return number

    def at(self, which: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (pair, 3) of the object ``which[k]`` at ``time_s[k]``; NaN where none."""
        return self.fleet.at(self.number(which, time_s), time_s)

    def elements(self, which: int, time_s: float) -> ElementSet:
        """Return the set that flies an object at an instant [s]."""
        return self.fleet.sets[int(self.number(np.array([which]), np.array([time_s]))[0])]

    def switches(self, which: int, from_s: float, to_s: float) -> int:
        """Return how often an object changes to another of its sets between two instants [s]."""
        return int(np.diff(self.number(np.array([which, which]), np.array([from_s, to_s])))[0])

    def oldest(self, which: int) -> tuple[float, ElementSet]:
        """Return the greatest time from an epoch to when its set of this object flies within the span [day], and the set."""
        mine = np.flatnonzero(self.owner == which)
        ends = np.clip([self.from_s[mine], self.to_s[mine]], 0.0, self.duration_s)
        since = np.array([(self.start_utc - self.fleet.sets[k].epoch_utc).total_seconds() for k in mine])
        ages = np.abs(since + ends).max(axis=0) / units.DAY_S
        return float(ages.max()), self.fleet.sets[int(mine[np.argmax(ages)])]

    def ages_days(self, which: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Return the time (pair) from the epoch of the set that flies to each instant [day]."""
        flown = [self.fleet.sets[k] for k in self.number(which, time_s)]
        since = np.array([(self.start_utc - entry.epoch_utc).total_seconds() for entry in flown])
        age: np.ndarray = (since + time_s) / units.DAY_S
        return age


def _schedule(sets: Sequence[ElementSet], start: Epochs, duration_s: float) -> list[tuple[float, ElementSet]]:
    """Return the sets of one object that fly within a span, each with when it begins to [s]; of equal epochs the first."""
    distinct = {(entry.epoch_utc, entry.epoch_rest_ns): entry for entry in reversed(sets)}
    ordered = [distinct[epoch] for epoch in sorted(distinct)]
    epoch_s = np.array([-float(start.since(entry.epoch_utc)[0]) for entry in ordered])
    begin_s = [-np.inf, *(0.5 * (epoch_s[1:] + epoch_s[:-1])).tolist()]
    first = int(np.searchsorted(begin_s, 0.0, side="right")) - 1
    flown = [pair for pair in zip(begin_s, ordered, strict=False) if pair[0] < duration_s][max(first, 0) :]
    return [(-np.inf if k == 0 else begin, entry) for k, (begin, entry) in enumerate(flown)]


def _mask_failures(
    position_km: np.ndarray, velocity_km_s: np.ndarray, error: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    position, velocity = position_km * units.KM, velocity_km_s * units.KM
    bad = find_failures(position, velocity, error)
    position[bad], velocity[bad] = np.nan, np.nan
    return position, velocity
