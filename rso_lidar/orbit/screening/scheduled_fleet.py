"""Objects over a span: which element set, or which piece of a trajectory, applies to each of them at each instant."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from typing import Any, Protocol, TypeAlias

import numpy as np

from rso_lidar import units
from rso_lidar.orbit.central_body import check_trajectory
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.screening.mixed_fleet import MixedFleet
from rso_lidar.orbit.screening.trajectory_piece import SWITCH_S, find_pieces
from rso_lidar.orbit.sets.element_set import ElementSet
from rso_lidar.orbit.sets.fleet import Fleet
from rso_lidar.orbit.sets.teme import gcrs_from_teme
from rso_lidar.orbit.trajectory import Trajectory
from rso_lidar.pose import rotate_vectors
from rso_lidar.records import BodyState

STEP_S = 300.0  # of the coarse grid
ScreenedObject: TypeAlias = ElementSet | Sequence[ElementSet] | Trajectory


class InTeme(Protocol):
    """Objects whose states in TEME axes are known by their numbers."""

    def at(self, which: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions [m] and velocities [m/s] (pair, 3) of the objects ``which[k]`` at ``time_s[k]``."""
        ...


class ScheduledFleet:
    """Objects over a span, each propagated by its element set, by that of several whose epoch is nearest, or by its states.

    It switches half-way between neighbouring epochs, with a jump, as `SetSequence` does. An object that answers `states` is
    a trajectory, and is divided into smooth pieces.

    Parameters
    ----------
    objects : an element set, several of one object, or a trajectory, for each object
    start_utc : start of the span
    duration_s : its length [s]
    step_s : greatest step of the coarse grid [s]

    Attributes
    ----------
    fleet : the sets and pieces that apply within the span; those of one object follow each other in order of time
    owner : (set,) number of the object that each belongs to
    from_s, to_s : (set,) when each applies [s since the start], infinite at the first and last set of an object
    gaps : (gap,) whose trajectory has no states, and when
    """

    def __init__(
        self,
        objects: Sequence[ScreenedObject],
        start_utc: datetime.datetime,
        duration_s: float,
        step_s: float = STEP_S,
    ) -> None:
        start = Epochs(start_utc, np.zeros(1))
        sets: list[Any] = []
        owner: list[int] = []
        spans: list[tuple[float, float]] = []
        gaps: list[tuple[str, str]] = []
        is_flown = np.zeros(len(objects), dtype=bool)
        for number, entry in enumerate(objects):
            if isinstance(entry, Trajectory):
                pieces, missing = find_pieces(entry, number, start_utc, duration_s, step_s)
                is_flown[number] = True
                label = str(getattr(entry, "label", "") or f"object {number + 1}")
                gaps += [(label, why) for why in missing]
                sets += pieces
                spans += [(piece.from_s, piece.to_s) for piece in pieces]
            else:
                check_object(entry, f"object {number + 1}")
                flown = [(-np.inf, entry)] if isinstance(entry, ElementSet) else _schedule(entry, start, duration_s)
                begins_s = [begin_s for begin_s, _ in flown]
                sets += [elements for _, elements in flown]
                spans += zip(begins_s, [*(begin_s - SWITCH_S for begin_s in begins_s[1:]), np.inf], strict=True)
            owner += [number] * (len(sets) - len(owner))
        self.start_utc = start_utc
        self.duration_s = duration_s
        self.fleet: Fleet | MixedFleet
        self.fleet = MixedFleet(sets, start_utc, step_s) if is_flown.any() else Fleet(sets, start_utc)
        self.owner = np.array(owner, dtype=int)
        self.from_s, self.to_s = np.array(spans, dtype=float).reshape(-1, 2).T
        self.gaps = tuple(gaps)
        self._is_flown = is_flown
        self._first = np.searchsorted(self.owner, np.arange(len(objects)))
        self._count = np.bincount(self.owner, minlength=len(objects))

    def __len__(self) -> int:
        return len(self._first)

    @property
    def several(self) -> np.ndarray:
        """Whether each object (object,) has several sets or pieces within the span."""
        more: np.ndarray = self._count > 1
        return more

    @property
    def switching(self) -> int:
        """Number of objects that switch between element sets within the span."""
        return int((self.several & ~self._is_flown).sum())

    def number(self, which: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Return the number in `fleet` (pair,) of the set that applies to each object at an instant.

        Parameters
        ----------
        which : (pair,) numbers of the objects
        time_s : (pair,) instants [s since the start]
        """
        number: np.ndarray = self._first[which]
        count = self._count[which]
        for k in range(1, int(count.max(initial=1))):
            after = np.where(k < count, self._first[which] + k, 0)
            number = np.where((k < count) & (self.from_s[after] <= time_s), after, number)
        return number

    def at(self, which: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return states (pair, 3) of objects in TEME axes, each at its own instant [m], [m/s]; NaN where there is no state.

        Parameters
        ----------
        which : (pair,) numbers of the objects
        time_s : (pair,) instants [s since the start]
        """
        number = self.number(which, time_s)
        position, velocity = self.fleet.at(number, time_s)
        beyond = (time_s < self.from_s[number] - 1e-9) | (time_s > self.to_s[number] + SWITCH_S + 1e-9)
        position[beyond], velocity[beyond] = np.nan, np.nan  # a piece is continued there
        return position, velocity

    def states_in_gcrs(self, which: np.ndarray, epochs: Epochs) -> BodyState:
        """Return states (pair, 3) of objects in GCRS axes, as `at` does.

        Parameters
        ----------
        which : (pair,) numbers of the objects
        epochs : (pair,) instants, from the start of the span on
        """
        position, velocity = self.at(which, epochs.time_s)
        rotation = gcrs_from_teme(epochs)
        return BodyState(rotate_vectors(rotation, position), rotate_vectors(rotation, velocity))

    def elements(self, which: int, time_s: float) -> Any:
        """Return the set or the piece that applies to an object at an instant.

        Parameters
        ----------
        which : number of the object
        time_s : instant [s since the start]
        """
        return self.fleet.sets[int(self.number(np.array([which]), np.array([time_s]))[0])]

    def switches(self, which: int, from_s: float, to_s: float) -> int:
        """Count the switches of an object between its sets.

        Parameters
        ----------
        which : number of the object
        from_s, to_s : instants [s since the start]

        Returns
        -------
        int
            Negative if `to_s` is before `from_s`; 0 for a trajectory.
        """
        if self._is_flown[which]:
            return 0
        return int(np.diff(self.number(np.array([which, which]), np.array([from_s, to_s])))[0])

    def oldest(self, which: int) -> tuple[float, Any]:
        """Return the set of an object that is used farthest from its epoch within the span, and that time [day].

        Of a trajectory the time is not a number.

        Parameters
        ----------
        which : number of the object
        """
        mine = np.flatnonzero(self.owner == which)
        ends = np.clip([self.from_s[mine], self.to_s[mine]], 0.0, self.duration_s)
        ages = np.abs(self._since_epoch_s(mine) + ends).max(axis=0) / units.DAY_S
        return float(ages.max()), self.fleet.sets[int(mine[np.argmax(ages)])]

    def ages_days(self, which: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Return the time (pair,) from the epoch of the set that applies to each instant [day]; NaN for a trajectory.

        Parameters
        ----------
        which : (pair,) numbers of the objects
        time_s : (pair,) instants [s since the start]
        """
        age: np.ndarray = (self._since_epoch_s(self.number(which, time_s)) + time_s) / units.DAY_S
        return age

    def _since_epoch_s(self, numbers: np.ndarray) -> np.ndarray:
        """Return the time from the epoch of each set to the start [s]; NaN for a piece of a trajectory."""
        epochs = [getattr(self.fleet.sets[k], "epoch_utc", None) for k in numbers]
        return np.array([np.nan if at is None else (self.start_utc - at).total_seconds() for at in epochs])


def check_object(entry: Any, name: str) -> None:
    """Check that an object is an element set, several of them, or a trajectory."""
    several = [entry] if isinstance(entry, ElementSet) else entry
    if not isinstance(several, Sequence) or not all(isinstance(elements, ElementSet) for elements in several):
        check_trajectory(entry, name)


def _schedule(sets: Sequence[ElementSet], start: Epochs, duration_s: float) -> list[tuple[float, ElementSet]]:
    """Select the sets of one object that apply within a span, each with its begin [s]; of equal epochs the first."""
    distinct = {(entry.epoch_utc, entry.epoch_rest_ns): entry for entry in reversed(sets)}
    ordered = [distinct[epoch] for epoch in sorted(distinct)]
    epoch_s = np.array([-float(start.since(entry.epoch_utc)[0]) for entry in ordered])
    begin_s = [-np.inf, *(0.5 * (epoch_s[1:] + epoch_s[:-1])).tolist()]
    first = int(np.searchsorted(begin_s, 0.0, side="right")) - 1
    flown = [pair for pair in zip(begin_s, ordered, strict=False) if pair[0] < duration_s][max(first, 0) :]
    return [(-np.inf if k == 0 else begin, entry) for k, (begin, entry) in enumerate(flown)]
