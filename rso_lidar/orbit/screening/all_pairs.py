"""Conjunction screening of all pairs of many objects, by the bounds and the refinement of `conjunctions`.

The coarse grid, the shells and the bounds of each element set are computed once for all pairs. The sub-intervals that
remain are refined for all pairs together, so that each set is propagated in long rows.
"""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rso_lidar.orbit.screening.close_approach import (
    CloseApproach,
    RelativePositions,
    SubIntervals,
    join_approaches,
    refine_approaches,
)
from rso_lidar.orbit.screening.conjunctions import (
    describe_rejected,
    find_near_cells,
    split_into_lots,
)
from rso_lidar.orbit.screening.mixed_fleet import MixedFleet
from rso_lidar.orbit.screening.orbit_bounds import OrbitBounds
from rso_lidar.orbit.screening.scheduled_fleet import STEP_S, ScheduledFleet, ScreenedObject
from rso_lidar.orbit.screening.trajectory_piece import BRIEF_S, CUT
from rso_lidar.orbit.sets.fleet import Fleet


@dataclass(frozen=True, eq=False)
class PairScreening:
    """All close approaches among some objects, by time.

    Parameters
    ----------
    objects : the objects over the span
    approaches : the close approaches, by time of the least range; `lead` and `which` are the numbers of the two objects,
        the lower one first
    rejected : label of an object, and why it was not propagated, or not to the end
    near : number of pairs whose shells overlap
    """

    objects: ScheduledFleet
    approaches: tuple[CloseApproach, ...]
    rejected: tuple[tuple[str, str], ...]
    near: int

    @property
    def follower(self) -> ScheduledFleet:
        """The objects, each of which is the first one of a pair in turn."""
        return self.objects


def screen_pairs(
    objects: Sequence[ScreenedObject],
    start_utc: datetime.datetime,
    duration_s: float,
    within_m: float,
    step_s: float = STEP_S,
) -> PairScreening:
    """Find every close approach of any two of some objects.

    The close approaches are those that `screen` finds with each object in turn as the follower. An object with several
    element sets uses, at each instant, the one whose epoch is nearest. A trajectory is searched where it has states.

    Parameters
    ----------
    objects : the element set, several, or a trajectory (anything that answers `states`), of each object
    start_utc : start of the span
    duration_s : length of the span [s]
    within_m : limit of range [m]
    step_s : step of the coarse grid [s]

    Returns
    -------
    PairScreening
    """
    flights = ScheduledFleet(objects, start_utc, duration_s, step_s)
    fleet, sets = flights.fleet, np.arange(len(flights.fleet))
    span_s = np.stack([np.maximum(flights.from_s, 0.0), np.minimum(flights.to_s, duration_s)], axis=1)
    steps = max(1, int(np.ceil(duration_s / step_s)))
    instants = np.linspace(0.0, duration_s, steps + 1)
    bounds = OrbitBounds(fleet, sets, span_s)
    position, velocity, error = fleet.grid(sets, instants)
    rejected = _find_lost(bounds, position, error, instants, span_s)
    pairs: list[np.ndarray] = []
    spans: list[np.ndarray] = []
    cells: list[np.ndarray] = []
    near, count = 0, 0
    for number in range(len(sets)):
        others = _select_partners(number, flights, span_s, bounds, within_m)
        if not len(others):
            continue
        both = np.stack(
            [np.maximum(span_s[others, 0], span_s[number, 0]), np.minimum(span_s[others, 1], span_s[number, 1])], axis=1
        )
        near += len(others)
        row, cut = find_near_cells(
            position[others] - position[number],
            velocity[others] - velocity[number],
            float(instants[1] - instants[0]),
            (instants[1:] >= both[:, :1]) & (instants[:-1] <= both[:, 1:]),
            _add_bounds(bounds, number, others),
            within_m,
        )
        kept, place = np.unique(row, return_inverse=True)
        cells.append(np.stack([count + place, cut], axis=1))
        pairs.append(np.stack([np.full(len(kept), number), others[kept]], axis=1))
        spans.append(both[kept])
        count += len(kept)
    approaches: list[CloseApproach] = []
    if count:
        pair = _PairPositions(fleet, np.concatenate(pairs), np.concatenate(spans))
        times = SubIntervals(0.0, duration_s / (steps * CUT), steps * CUT)
        for lot in split_into_lots(np.concatenate(cells)):
            approaches += refine_approaches(pair, lot, times, within_m)
        approaches = _name_objects(approaches, pair.pairs, flights)
    approaches.sort(key=lambda approach: (approach.time_s, approach.lead, approach.which))
    lost = (*flights.gaps, *describe_rejected(fleet, rejected))
    return PairScreening(flights, tuple(approaches), lost, near)


def _add_bounds(bounds: OrbitBounds, number: int, others: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Add the bounds of one set to those of others, as `find_near_cells` needs them."""
    speed, fourth, off = bounds.speed_m_s, bounds.fourth_m_s4, bounds.off_m
    return speed[number] + speed[others], fourth[number] + fourth[others], off[number] + off[others]


class _PairPositions(RelativePositions):
    """Positions of element sets relative to others, by number of the pair.

    Parameters
    ----------
    fleet : the element sets
    pairs : (pair, 2) numbers of the sets
    span_s : (pair, 2) when both sets of a pair apply [s since the start]
    """

    def __init__(self, fleet: Fleet | MixedFleet, pairs: np.ndarray, span_s: np.ndarray) -> None:
        super().__init__(fleet, 0, fleet, span_s)
        self.pairs = pairs

    def relative(self, which: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Return positions (pair, 3) [m] of the second sets from the first ones of the pairs ``which[k]``."""
        both = self._fleet.at(self.pairs[which].T.ravel(), np.tile(time_s, 2))[0]
        position: np.ndarray = both[len(which) :] - both[: len(which)]
        return position


@dataclass(frozen=True, eq=False)
class _OneObject:
    """One object of a fleet, whatever number is asked for."""

    flights: ScheduledFleet
    number: int

    def at(self, which: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return its positions [m] and velocities [m/s] (pair, 3) in TEME axes."""
        return self.flights.at(np.full(len(which), self.number), time_s)


def _select_partners(
    number: int, flights: ScheduledFleet, span_s: np.ndarray, bounds: OrbitBounds, within_m: float
) -> np.ndarray:
    """Return the later sets of other objects that apply when a set does, `span_s` (set, 2), in shells near its own."""
    after = np.arange(number + 1, len(span_s))
    begin_s, end_s = np.maximum(span_s[after, 0], span_s[number, 0]), np.minimum(span_s[after, 1], span_s[number, 1])
    at_an_end = (begin_s <= 0.0) | (end_s >= flights.duration_s)
    applies = end_s - begin_s > np.where(at_an_end, 0.0, BRIEF_S)
    meets: np.ndarray = np.logical_and(flights.owner[after] != flights.owner[number], applies)
    meets &= bounds.perigee_m[after] <= bounds.apogee_m[number] + within_m
    meets &= bounds.apogee_m[after] >= bounds.perigee_m[number] - within_m
    never = np.asarray(bounds.never)
    selected: np.ndarray = after[meets & ~never[after] & ~never[number]]
    return selected


def _name_objects(pieces: Sequence[CloseApproach], pairs: np.ndarray, flights: ScheduledFleet) -> list[CloseApproach]:
    """Turn close approaches of pairs of sets into those of objects, and join those of successive sets.

    Parameters
    ----------
    pieces : close approaches, whose `which` is the number of the pair
    pairs : (pair, 2) numbers of the sets
    """
    of: dict[int, list[CloseApproach]] = {}
    for piece in pieces:
        first, second = pairs[piece.which].tolist()
        of.setdefault(int(flights.owner[first]), []).append(replace(piece, which=second))
    approaches: list[CloseApproach] = []
    for lead, lead_pieces in of.items():
        if flights.several.any():
            named = join_approaches(lead_pieces, _OneObject(flights, lead), flights)
        else:
            named = [replace(piece, which=int(flights.owner[piece.which])) for piece in lead_pieces]
        approaches += [replace(approach, lead=lead) for approach in named]
    return approaches


def _find_lost(
    bounds: OrbitBounds, position_m: np.ndarray, error: np.ndarray, instants: np.ndarray, span_s: np.ndarray
) -> dict[int, tuple[float, int]]:
    """Return the first instant [s] without a state, and SGP4's error code there, by number of the set.

    Parameters
    ----------
    position_m : (set, time, 3) on the coarse grid [m]
    error : (set, time) SGP4's codes
    instants : (time,) of the grid [s]
    span_s : (set, 2) when each set applies [s since the start]
    """
    step_s = instants[1] - instants[0]
    gone: np.ndarray = np.isnan(position_m[..., 0])
    gone &= (instants >= span_s[:, :1] - step_s) & (instants <= span_s[:, 1:] + step_s)
    lost = {int(k): (float(bounds.lost_s[k]), int(bounds.error[k])) for k in np.flatnonzero(bounds.lost)}
    for k in np.flatnonzero(gone.any(axis=1)).tolist():
        at = int(np.argmax(gone[k]))
        lost.setdefault(k, (float(instants[at]), int(error[k, at])))
    return lost
