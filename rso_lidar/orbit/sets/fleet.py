"""Propagation of many element sets side by side by SGP4, in TEME axes.

Distances and speeds are the same in TEME as in GCRS. Where SGP4 has no state the result is NaN, never an exception: among
thousands of objects a few have always decayed.
"""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from rso_lidar import units
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.sets.element_set import ElementSet
from rso_lidar.orbit.sets.teme import MOST_AGE_S, TOO_OLD, find_failures

SWITCH_S = 1e-4  # a set ends this long before the next begins, so that each instant has one set


class Fleet:
    """Element sets propagated side by side.

    Parameters
    ----------
    sets : the element sets; results refer to them by their number in this order
    start_utc : instant from which seconds are counted
    """

    def __init__(self, sets: Sequence[ElementSet], start_utc: datetime.datetime) -> None:
        self.sets = tuple(sets)
        self.start_utc = start_utc
        self._models = [entry.satrec() for entry in self.sets]
        epochs = [entry.epoch_utc for entry in self.sets]
        # SGP4 subtracts dates, so each set keeps the leap seconds of its epoch. They change only at half years.
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
        """Propagate some sets to common instants.

        Parameters
        ----------
        which : (set,) numbers of the sets
        time_s : (time,) instants [s since the start]

        Returns
        -------
        position_m, velocity_m_s : (set, time, 3) in TEME axes [m], [m/s]; NaN where there is no state
        error : (set, time) SGP4's codes, `TOO_OLD` beyond `MOST_YEARS` from the epoch
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
        """Propagate sets to one instant each.

        Parameters
        ----------
        which : (pair,) numbers of the sets
        time_s : (pair,) instants [s since the start]

        Returns
        -------
        position_m, velocity_m_s : (pair, 3) in TEME axes [m], [m/s]; NaN where there is no state
        """
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


class InTeme(Protocol):
    """Objects whose states in TEME axes are known by their numbers."""

    def at(self, which: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions [m] and velocities [m/s] (pair, 3) of the objects ``which[k]`` at ``time_s[k]``."""
        ...


class ScheduledFleet:
    """Objects over a span, each propagated by its only element set or by that of several whose epoch is nearest.

    It switches half-way between neighbouring epochs, with a jump, as `SetSequence` does.

    Parameters
    ----------
    objects : an element set, or several of one object, for each object
    start_utc : start of the span
    duration_s : its length [s]

    Attributes
    ----------
    fleet : the sets that apply within the span; those of one object follow each other in order of time
    owner : (set,) number of the object that each set belongs to
    from_s, to_s : (set,) when each set applies [s since the start], infinite at the first and last set of an object
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
        """Whether each object (object,) switches between sets within the span."""
        more: np.ndarray = self._count > 1
        return more

    def number(self, which: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Return the number in `fleet` (pair,) of the set that applies to object ``which[k]`` at ``time_s[k]``."""
        number: np.ndarray = self._first[which]
        count = self._count[which]
        for k in range(1, int(count.max(initial=1))):
            after = np.where(k < count, self._first[which] + k, 0)
            number = np.where((k < count) & (self.from_s[after] <= time_s), after, number)
        return number

    def at(self, which: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return states of objects in TEME axes, each at its own instant.

        Parameters
        ----------
        which : (pair,) numbers of the objects
        time_s : (pair,) instants [s since the start]

        Returns
        -------
        position_m, velocity_m_s : (pair, 3) [m], [m/s]; NaN where there is no state
        """
        return self.fleet.at(self.number(which, time_s), time_s)

    def elements(self, which: int, time_s: float) -> ElementSet:
        """Return the set that applies to an object at an instant [s]."""
        return self.fleet.sets[int(self.number(np.array([which]), np.array([time_s]))[0])]

    def switches(self, which: int, from_s: float, to_s: float) -> int:
        """Count the switches of an object between its sets from one instant to another.

        Parameters
        ----------
        which : number of the object
        from_s, to_s : instants [s since the start]

        Returns
        -------
        number of switches, negative if `to_s` is before `from_s`
        """
        return int(np.diff(self.number(np.array([which, which]), np.array([from_s, to_s])))[0])

    def oldest(self, which: int) -> tuple[float, ElementSet]:
        """Return the set of an object that is used farthest from its epoch within the span, and that time [day]."""
        mine = np.flatnonzero(self.owner == which)
        ends = np.clip([self.from_s[mine], self.to_s[mine]], 0.0, self.duration_s)
        since = np.array([(self.start_utc - self.fleet.sets[k].epoch_utc).total_seconds() for k in mine])
        ages = np.abs(since + ends).max(axis=0) / units.DAY_S
        return float(ages.max()), self.fleet.sets[int(mine[np.argmax(ages)])]

    def ages_days(self, which: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Return the time (pair,) from the epoch of the set that applies to each instant [day]."""
        flown = [self.fleet.sets[k] for k in self.number(which, time_s)]
        since = np.array([(self.start_utc - entry.epoch_utc).total_seconds() for entry in flown])
        age: np.ndarray = (since + time_s) / units.DAY_S
        return age


def _schedule(sets: Sequence[ElementSet], start: Epochs, duration_s: float) -> list[tuple[float, ElementSet]]:
    """Select the sets of one object that apply within a span; of equal epochs the first.

    Parameters
    ----------
    sets : element sets of the object
    start : the start of the span, one epoch
    duration_s : length of the span [s]

    Returns
    -------
    list of (begin_s, element set)
    """
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
    """Convert states to metres, with NaN where SGP4 failed.

    Parameters
    ----------
    position_km, velocity_km_s : (…, 3) states of SGP4 [km], [km/s]
    error : (…) error codes

    Returns
    -------
    position [m] and velocity [m/s], each (…, 3)
    """
    position, velocity = position_km * units.KM, velocity_km_s * units.KM
    bad = find_failures(position, velocity, error)
    position[bad], velocity[bad] = np.nan, np.nan
    return position, velocity
