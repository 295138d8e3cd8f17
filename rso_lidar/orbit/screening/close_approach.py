"""Close approaches refined by SGP4 itself: entry, every minimum of range, and exit.

Where an object may be inside the limit, SGP4 is evaluated every 37.5 s. The range rate is the central difference of
positions over 1 s, because a minimum of range is one of positions. Each change of its sign is a minimum or a maximum. Each
turn of it toward zero is sampled more finely, and roots are found to 0.1 ms. Between two neighbours of all these the range
is monotonic, so that entry and exit are bracketed too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rso_lidar.orbit.screening.mixed_fleet import MixedFleet
from rso_lidar.orbit.screening.scheduled_fleet import InTeme, ScheduledFleet
from rso_lidar.orbit.screening.trajectory_piece import BRIEF_S, SWITCH_S
from rso_lidar.orbit.sets.fleet import Fleet

ROOT_S = 1e-4
# Minima that differ by less are equal: rounding in SGP4 alone moves a position by some 1e-7 m after days.
EQUAL_M = 1e-4
_MOST_TURNS = 80
_DIFFERENCE_S = 0.5


@dataclass(frozen=True, eq=False)
class CloseApproach:
    """One interval during which an object is inside the limit, with the minima of range in it.

    A minimum may be at an end of the interval, and where an object switches between element sets and jumps.

    Parameters
    ----------
    which : number of the object
    enter_s, leave_s : begin and end [s since the start]
    entered, left : False where the span, or what SGP4 can propagate, begins or ends inside the limit
    minima_s, minima_m : (minimum,) instants [s since the start] and ranges [m] of the minima
    lead : number of the other object, where there are several
    """

    which: int
    enter_s: float
    leave_s: float
    entered: bool
    left: bool
    minima_s: np.ndarray
    minima_m: np.ndarray
    lead: int = 0

    @property
    def time_s(self) -> float:
        """Time of closest approach [s since the start]; of equal minima, as in a formation, the first."""
        return float(self.minima_s[np.argmax(self.minima_m <= self.minima_m.min() + EQUAL_M)])

    @property
    def range_m(self) -> float:
        """Least range [m]."""
        return float(self.minima_m.min())


class RelativePositions:
    """Positions of element sets relative to one set of the follower.

    Parameters
    ----------
    lead : element sets of the follower
    one : number of its set
    fleet : element sets of the objects
    span_s : (set, 2) when each of these applies [s since the start]
    """

    def __init__(self, lead: Fleet | MixedFleet, one: int, fleet: Fleet | MixedFleet, span_s: np.ndarray) -> None:
        self._lead, self._one, self._fleet, self.span_s = lead, one, fleet, span_s

    def relative(self, which: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Return positions (pair, 3) [m] of the sets ``which[k]`` from the follower at ``time_s[k]``."""
        instants, place = np.unique(time_s, return_inverse=True)  # propagate the follower once for all objects
        lead = self._lead.at(np.full(len(instants), self._one), instants)[0]
        position: np.ndarray = self._fleet.at(which, time_s)[0] - lead[place]
        return position

    def square(self, which: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Return the squared range (pair,) [m2]."""
        rho = self.relative(which, time_s)
        square: np.ndarray = np.einsum("ni,ni->n", rho, rho)
        return square

    def closing(self, which: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Return half the rate of the squared range (pair,) [m2/s], a central difference of positions."""
        after = self.relative(which, time_s + _DIFFERENCE_S)
        before = self.relative(which, time_s - _DIFFERENCE_S)
        rate: np.ndarray = np.einsum("ni,ni->n", after - before, after + before) / (4.0 * _DIFFERENCE_S)
        return rate


@dataclass(frozen=True)
class SubIntervals:
    """Equal intervals of `sub_s` [s] from `begin_s` on, `last` of them."""

    begin_s: float
    sub_s: float
    last: int


@dataclass(eq=False)
class _Nodes:
    """Instants at which SGP4 was evaluated, by object and time; `window` numbers the runs of consecutive instants."""

    which: np.ndarray
    window: np.ndarray
    time_s: np.ndarray
    square: np.ndarray
    closing: np.ndarray

    def with_more(self, pair: RelativePositions, near: np.ndarray, time_s: np.ndarray) -> _Nodes:
        """Return these nodes and others.

        Parameters
        ----------
        near : (new,) existing nodes whose windows the new ones belong to
        time_s : (new,) instants [s]
        """
        which = self.which[near]
        parts = (
            (self.which, which),
            (self.window, self.window[near]),
            (self.time_s, time_s),
            (self.square, pair.square(which, time_s)),
            (self.closing, pair.closing(which, time_s)),
        )
        merged = [np.concatenate(part) for part in parts]
        order = np.lexsort((merged[2], merged[1]))
        return _Nodes(*(part[order] for part in merged))

    @property
    def follows(self) -> np.ndarray:
        """Whether each node but the last is followed by another of its window."""
        after: np.ndarray = self.window[1:] == self.window[:-1]
        return after


def refine_approaches(
    pair: RelativePositions, cells: np.ndarray, times: SubIntervals, within_m: float
) -> list[CloseApproach]:
    """Find the close approaches of some sets in the sub-intervals that may hold one.

    Parameters
    ----------
    cells : (cell, 2) number of the set, and of the sub-interval

    Returns
    -------
    list of CloseApproach, whose `which` is the number of the set, cut to when each set applies
    """
    nodes = _sample(pair, cells, times)
    if not len(nodes.time_s):
        return []
    nodes = _add_dips(pair, nodes, times.sub_s)
    extrema = []
    for sign in (1.0, -1.0):  # minima, maxima
        rate = sign * nodes.closing
        left = np.flatnonzero(nodes.follows & (rate[:-1] < 0.0) & (rate[1:] >= 0.0))
        extrema.append((left, _find_roots(pair.closing, nodes, left, nodes.closing)))
    (at_min, minima), (at_max, maxima) = extrema
    nodes = nodes.with_more(pair, np.concatenate([at_min, at_max]), np.concatenate([minima, maxima]))
    beyond = nodes.square - within_m**2
    inside = beyond <= 0.0
    crossing = np.flatnonzero(nodes.follows & (inside[:-1] != inside[1:]))
    crossed = _find_roots(lambda which, time_s: pair.square(which, time_s) - within_m**2, nodes, crossing, beyond)
    edge = dict(zip(crossing.tolist(), crossed.tolist(), strict=True))
    linked = np.concatenate([[False], nodes.follows])  # whether each node follows the one before
    begins = np.flatnonzero(inside & ~(linked & np.concatenate([[False], inside[:-1]])))
    ends = np.flatnonzero(inside & ~np.concatenate([linked[1:] & inside[1:], [False]]))
    before = np.where(linked, np.concatenate([[np.inf], nodes.square[:-1]]), np.inf)
    after = np.where(np.concatenate([linked[1:], [False]]), np.concatenate([nodes.square[1:], [np.inf]]), np.inf)
    lower = (nodes.square < before) & (nodes.square <= after)
    approaches = []
    for first, end in zip(begins.tolist(), ends.tolist(), strict=True):
        of = slice(first, end + 1)
        # two objects with the same elements have no minimum; then the first of the least ranges counts
        low = np.flatnonzero(lower[of]) if lower[of].any() else np.argmin(nodes.square[of], keepdims=True)
        at = first + (select_distinct_minima(np.sqrt(nodes.square[of]), low) if len(low) > 1 else low)
        approaches.append(
            CloseApproach(
                which=int(nodes.which[first]),
                enter_s=edge.get(first - 1, float(nodes.time_s[first])),
                leave_s=edge.get(end, float(nodes.time_s[end])),
                entered=first - 1 in edge,
                left=end in edge,
                minima_s=nodes.time_s[at],
                minima_m=np.sqrt(nodes.square[at]),
            )
        )
    return approaches


def select_distinct_minima(range_m: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the minima that a rise of more than `EQUAL_M` separates from the one before; of others the first least one.

    Two bodies on one circle have a constant distance, and many minima of rounding, of which one is left.

    Parameters
    ----------
    range_m : (node,) range at ascending instants [m]
    at : (minimum,) ascending indices of its minima, one or more
    """
    kept = [int(at[0])]
    for minimum in at[1:].tolist():
        rise_m = range_m[kept[-1] : minimum + 1].max() - max(range_m[kept[-1]], range_m[minimum])
        if rise_m > EQUAL_M:
            kept.append(minimum)
        elif range_m[minimum] < range_m[kept[-1]] - EQUAL_M:
            kept[-1] = minimum
    return np.array(kept)


def join_approaches(pieces: Sequence[CloseApproach], lead: InTeme, flights: ScheduledFleet) -> list[CloseApproach]:
    """Join the close approaches of element sets to those of objects.

    Where one set stops and the next takes over inside the limit, it is one close approach. The range jumps there. A
    minimum at the jump counts if the course with the jump has one. So the least range is always among the minima.

    Returns
    -------
    list of CloseApproach, whose `which` is the number of the object
    """
    approaches: list[CloseApproach] = []
    last: dict[int, int] = {}  # index of the last close approach of each object
    for piece in sorted(pieces, key=lambda piece: piece.enter_s):
        own = replace(piece, which=int(flights.owner[piece.which]))
        k = last.get(own.which)
        before = None if k is None else approaches[k]
        if before is None or before.left or own.entered or own.enter_s - before.leave_s > 2.0 * BRIEF_S:
            last[own.which] = len(approaches)
            approaches.append(own)
        elif k is not None:
            approaches[k] = _merge(before, own, *_ranges_m(lead, flights, own.which, (before.leave_s, own.enter_s)))
    return [_mark_jumps(approach, lead, flights) for approach in approaches]


def _ranges_m(lead: InTeme, flights: ScheduledFleet, which: int, time_s: tuple[float, ...]) -> list[float]:
    """Return the ranges [m] of an object at some instants."""
    times = np.array(time_s)
    apart = flights.at(np.full(len(times), which), times)[0] - lead.at(np.zeros(len(times), dtype=int), times)[0]
    ranges: list[float] = np.sqrt(np.einsum("ti,ti->t", apart, apart)).tolist()
    return ranges


def _merge(before: CloseApproach, after: CloseApproach, end_m: float, begin_m: float) -> CloseApproach:
    """Merge two close approaches into one, by the ranges on both sides of the jump between them [m]."""
    kept_before = (before.minima_s < before.leave_s) | (end_m <= begin_m)
    kept_after = (after.minima_s > after.enter_s) | (begin_m < end_m)
    return replace(
        before,
        leave_s=after.leave_s,
        left=after.left,
        minima_s=np.concatenate([before.minima_s[kept_before], after.minima_s[kept_after]]),
        minima_m=np.concatenate([before.minima_m[kept_before], after.minima_m[kept_after]]),
    )


def _mark_jumps(approach: CloseApproach, lead: InTeme, flights: ScheduledFleet) -> CloseApproach:
    """Mark a close approach as entered or left where the object jumps in or out."""
    beside_s = (approach.enter_s - 1.5 * SWITCH_S, approach.leave_s + 1.5 * SWITCH_S)
    if (approach.entered or beside_s[0] < 0.0) and (approach.left or beside_s[1] > flights.duration_s):
        return approach
    known = np.isfinite(_ranges_m(lead, flights, approach.which, beside_s))
    return replace(
        approach,
        entered=approach.entered or bool(beside_s[0] >= 0.0 and known[0]),
        left=approach.left or bool(beside_s[1] <= flights.duration_s and known[1]),
    )


def _sample(pair: RelativePositions, cells: np.ndarray, times: SubIntervals) -> _Nodes:
    """Sample the ends of sub-intervals (set, number) and of those beside them, both ends of the span included."""
    span_s, begin_s = pair.span_s[cells[:, 0]], times.begin_s + times.sub_s * cells[:, 1]
    cells = cells[(begin_s + times.sub_s >= span_s[:, 0]) & (begin_s <= span_s[:, 1])]
    width = times.last + 1
    keys = cells[:, 0] * width
    shifted = [keys + np.clip(cells[:, 1] + shift, 0, times.last) for shift in (-1, 0, 1, 2)]
    numbers = np.unique(np.concatenate(shifted))
    which, number = numbers // width, numbers % width
    window = np.cumsum((np.diff(numbers, prepend=-2) != 1) | (np.diff(which, prepend=-1) != 0))
    time_s = np.clip(times.begin_s + number * times.sub_s, *pair.span_s[which].T)
    fresh = (np.diff(time_s, prepend=-np.inf) != 0.0) | (np.diff(window, prepend=0) != 0)
    which, window, time_s = which[fresh], window[fresh], time_s[fresh]
    square, closing = pair.square(which, time_s), pair.closing(which, time_s)
    good = np.isfinite(square) & np.isfinite(closing)
    if not good.all():  # decayed on the way, so the nodes before and after are not consecutive
        window = window + np.cumsum(~good)
    return _Nodes(*(part[good] for part in (which, window, time_s, square, closing)))


def _add_dips(pair: RelativePositions, nodes: _Nodes, sub_s: float) -> _Nodes:
    """Add nodes where the range rate turns back near zero, because it may cross zero twice there."""
    if len(nodes.time_s) < 3:
        return nodes
    before, rate, after = nodes.closing[:-2], nodes.closing[1:-1], nodes.closing[2:]
    sign = np.sign(rate)
    turned = nodes.follows[:-1] & nodes.follows[1:] & (sign != 0)
    turned &= (sign * before >= sign * rate) & (sign * after >= sign * rate)
    curve = before - 2.0 * rate + after
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = np.clip(np.where(curve != 0.0, 0.5 * (before - after) / curve, 0.0), -1.0, 1.0)
        vertex = rate - 0.125 * (after - before) ** 2 / np.where(curve != 0.0, curve, np.inf)
    uneven = np.abs(np.diff(nodes.time_s, 2)) > 1e-6 * sub_s  # at the end of a set's span
    k = np.flatnonzero(turned & (uneven | (sign * vertex < 0.5 * np.abs(rate)))) + 1
    parts = np.concatenate(
        [np.tile([-0.75, -0.5, -0.25, 0.25, 0.5, 0.75], (len(k), 1)), offset[k - 1][:, None]], axis=1
    )
    near = np.repeat(k, parts.shape[1])
    times = nodes.time_s[near] + sub_s * parts.ravel()
    first, last = pair.span_s[nodes.which[near]].T
    new = (parts.ravel() != 0.0) & (times >= first) & (times <= last)
    return nodes.with_more(pair, near[new], times[new]) if len(k) else nodes


def _find_roots(
    f: Callable[[np.ndarray, np.ndarray], np.ndarray], nodes: _Nodes, left: np.ndarray, value: np.ndarray
) -> np.ndarray:
    """Find the roots (root,) [s] of f(which, time) between nodes, to 0.1 ms (regula falsi, Illinois variant).

    Parameters
    ----------
    f : function of number (pair,) and time (pair,) [s] that returns (pair,)
    left : (root,) nodes before each root
    value : (node,) values of f
    """
    which = nodes.which[left]
    a, b, fa, fb = nodes.time_s[left], nodes.time_s[left + 1], value[left], value[left + 1]
    root: np.ndarray = np.where(fa == 0.0, a, b)
    side = np.zeros(len(left))  # the end that the last step kept, +1 for the left one
    live = np.flatnonzero((fa != 0.0) & (fb != 0.0))
    for turn in range(_MOST_TURNS):
        if not len(live):
            break
        la, lb, lfa, lfb = a[live], b[live], fa[live], fb[live]
        with np.errstate(divide="ignore", invalid="ignore"):
            c = lb - lfb * (lb - la) / (lfb - lfa)
        c = np.where((c > la) & (c < lb) & (turn % 8 != 7), c, 0.5 * (la + lb))
        fc = f(which[live], c)
        keeps_left = np.sign(fc) == np.sign(lfb)
        moved = np.abs(c - root[live])
        root[live] = c
        fa[live] = np.where(keeps_left, np.where(side[live] > 0, 0.5 * lfa, lfa), fc)
        fb[live] = np.where(keeps_left, fc, np.where(side[live] < 0, 0.5 * lfb, lfb))
        a[live], b[live] = np.where(keeps_left, la, c), np.where(keeps_left, c, lb)
        side[live] = np.where(keeps_left, 1.0, -1.0)
        live = live[~((fc == 0.0) | (b[live] - a[live] < ROOT_S) | (moved < 0.01 * ROOT_S))]
    return root
