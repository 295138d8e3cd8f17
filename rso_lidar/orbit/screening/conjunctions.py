"""Close approaches of one object to many: every minimum of range below a limit, and when it is inside that.

**Shells.** Perigee and apogee of the osculating orbits at some instants of the span; what stays above the follower's
apogee or below its perigee by more than the margins cannot come near. The margins are 50 km (short periods and the
long-period terms of SGP4 change a radius by less than 25 km), the spread of the samples (drag), and for the apogee what
the J2 part of the energy at perigee does to it, 4 a^2 J2 R^2 / r_p^3.

**Coarse grid.** Every 300 s both are flown. Between two instants no two objects approach faster than the sum of their
speeds at perigee, which leaves few intervals. In those, the relative position is taken as the cubic H through positions
and velocities at both ends, which lies in the hull of its four Bezier points. Its error is at most h^4 / 384 times the
greatest fourth derivative (any component of a vector is a function of its own, so the length obeys the same bound), and
of an orbit about a point mass

    |r''''| <= mu^2 / r_p^5 (1 + 9 e + 12 e^2 / (1 + e)),

from r'' = -u r, u = mu / r^3, differentiated twice, |cos| and |sin| of the anomaly put to 1 and r to r_p; 1.3e-5 m/s^4
in low orbit, 0.22 km for h = 300 s, and just that is found. A quarter is added for what is not a point mass, and h/4 x 5
m/s because the velocities of SGP4 are not quite the derivative of its positions (2.2 m/s at worst in a catalogue of
15,000). An interval is dropped only where the hull, less that error, is beyond the limit; what is left is cut in eight
and judged again.

What may be inside then is asked of SGP4 itself (`stays`).

**Several element sets of one object.** Each is screened by itself for as long as it flies and the follower keeps to one
set, since the motion is smooth then; what touches is joined after. Spans under 1 ms, of epochs that two objects share but
for their last digit, are passed over.
"""

from __future__ import annotations

import datetime
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar.errors import PropagationError
from rso_lidar.orbit.epochs import format_utc
from rso_lidar.orbit.screening.close_approach import (
    BRIEF_S,
    CloseApproach,
    RelativePositions,
    SubIntervals,
    join_approaches,
    refine_approaches,
)
from rso_lidar.orbit.screening.orbit_bounds import OrbitBounds
from rso_lidar.orbit.sets.element_set import ElementSet
from rso_lidar.orbit.sets.fleet import Fleet, ScheduledFleet
from rso_lidar.orbit.sets.teme import describe_error

STEP_S = 300.0
CUT = 8  # sub-intervals of a step
_MOST_STATES = 400_000  # flown at a time: some 50 MB
_SPEED_OFF_M_S = 5.0


@dataclass(frozen=True, eq=False)
class ScreeningResult:
    """All stays of objects within a limit of one follower, by time; `near` of the objects shared its shell.

    `rejected` says of objects, by label, why they were not flown, or from when on they were not.
    """

    follower: ScheduledFleet
    objects: ScheduledFleet
    approaches: tuple[CloseApproach, ...]
    rejected: tuple[tuple[str, str], ...]
    near: int


def screen(
    follower: ElementSet | Sequence[ElementSet],
    objects: Sequence[ElementSet | Sequence[ElementSet]],
    start_utc: datetime.datetime,
    duration_s: float,
    within_m: float,
    step_s: float = STEP_S,
) -> ScreeningResult:
    """Return every stay of `objects` within `within_m` [m] of `follower` during `duration_s` [s] from `start_utc`.

    Whoever has several element sets flies at each instant by the one whose epoch is nearest.
    """
    lead, flights = ScheduledFleet([follower], start_utc, duration_s), ScheduledFleet(objects, start_utc, duration_s)
    near = np.zeros(len(flights), dtype=bool)
    rejected: dict[int, tuple[float, int]] = {}
    stays: list[CloseApproach] = []
    for one in range(len(lead.fleet)):
        stays += _screen_one_set(lead, one, flights, within_m, step_s, near, rejected)
    if lead.several.any() or flights.several.any():
        stays = join_approaches(stays, lead, flights)
    stays.sort(key=lambda stay: (stay.time_s, stay.which))
    return ScreeningResult(
        lead, flights, tuple(stays), tuple(_describe_rejected(flights.fleet, rejected)), int(near.sum())
    )


def _screen_one_set(
    lead: ScheduledFleet,
    one: int,
    flights: ScheduledFleet,
    within_m: float,
    step_s: float,
    near: np.ndarray,
    rejected: dict[int, tuple[float, int]],
) -> list[CloseApproach]:
    """Return the stays of element sets while the follower flies by its set `one`; `near`, `rejected` are added to."""
    begin_s, end_s = max(float(lead.from_s[one]), 0.0), min(float(lead.to_s[one]), lead.duration_s)
    steps = max(1, int(np.ceil((end_s - begin_s) / step_s)))
    instants = np.linspace(begin_s, end_s, steps + 1)
    position, velocity, error = lead.fleet.grid(np.array([one]), instants)
    bad = np.isnan(position[0, :, 0])
    if bad.any():
        at = int(np.argmax(bad))
        raise PropagationError(
            f"follower {lead.fleet.sets[one].label}: SGP4 has no state at "
            f"{format_utc(lead.start_utc, float(instants[at]))}: {describe_error(int(error[0, at]))}; "
            "take an element set nearer to the span, or a shorter span",
            bad,
        )
    span_s = np.stack([np.maximum(flights.from_s, begin_s), np.minimum(flights.to_s, end_s)], axis=1)
    at_an_end = (span_s[:, 0] <= 0.0) | (span_s[:, 1] >= lead.duration_s)
    sets = np.flatnonzero(span_s[:, 1] - span_s[:, 0] > np.where(at_an_end, 0.0, BRIEF_S))
    here = OrbitBounds(lead.fleet, np.array([one]), np.array([[begin_s, end_s]]))
    there = OrbitBounds(flights.fleet, sets, span_s[sets])
    meets = np.flatnonzero(there.may_meet(here, within_m))
    meets = meets[np.argsort(span_s[sets[meets], 0], kind="stable")]  # sets that fly at about one time together
    near[flights.owner[sets[meets]]] = True
    pair = RelativePositions(lead.fleet, one, flights.fleet, span_s)
    times = SubIntervals(begin_s, float(instants[-1] - begin_s) / (steps * CUT), steps * CUT)
    lost = {int(sets[k]): (float(there.lost_s[k]), int(there.error[k])) for k in np.flatnonzero(there.never)}
    stays: list[CloseApproach] = []
    chunk = max(1, _MOST_STATES // len(instants))
    for begin in range(0, len(meets), chunk):
        rows = meets[begin : begin + chunk]
        first = max(int(np.searchsorted(instants, span_s[sets[rows], 0].min(), side="right")) - 1, 0)
        last = min(int(np.searchsorted(instants, span_s[sets[rows], 1].max())), steps)
        some = slice(first, last + 1)
        ends = instants[some], (position[0, some], velocity[0, some])
        cells, gone = _find_cells(flights.fleet, sets[rows], span_s[sets[rows]], *ends, here, there.of(rows), within_m)
        cells[:, 1] += first * CUT
        lost.update(gone)
        for lot in _split_into_lots(cells):
            stays += refine_approaches(pair, lot, times, within_m)
    for k in np.flatnonzero(there.lost):
        lost.setdefault(int(sets[k]), (float(there.lost_s[k]), int(there.error[k])))
    for number, when in lost.items():
        rejected.setdefault(number, when)
    return stays


def _describe_rejected(fleet: Fleet, rejected: dict[int, tuple[float, int]]) -> list[tuple[str, str]]:
    return [
        (
            fleet.sets[k].label,
            f"{describe_error(error)}, by {format_utc(fleet.start_utc, since_s)} (elements of "
            f"{fleet.sets[k].epoch_utc:%Y-%m-%dT%H:%MZ})",
        )
        for k, (since_s, error) in sorted(rejected.items())
    ]


def _find_cells(
    fleet: Fleet,
    sets: np.ndarray,
    span_s: np.ndarray,
    instants: np.ndarray,
    lead: tuple[np.ndarray, np.ndarray],
    here: OrbitBounds,
    there: tuple[np.ndarray, np.ndarray],
    within_m: float,
) -> tuple[np.ndarray, dict[int, tuple[float, int]]]:
    """Return (set, sub-interval) rows in which something may be inside, and what was lost when (time, error code).

    `there` are the speeds [m/s] and fourth derivatives [m/s4] of the sets; what is beyond their spans does not count.
    """
    step_s = instants[1] - instants[0]
    position, velocity, error = fleet.grid(sets, instants)
    position -= lead[0]
    velocity -= lead[1]
    apart = np.sqrt(np.einsum("...i,...i->...", position, position))
    flies = (instants[1:] >= span_s[:, :1]) & (instants[:-1] <= span_s[:, 1:])  # (set, interval)
    gone = np.isnan(apart)
    gone[:, 1:-1] &= flies[:, 1:] | flies[:, :-1]
    gone[:, 0] &= flies[:, 0]
    gone[:, -1] &= flies[:, -1]
    lost = {
        int(sets[k]): (float(instants[at]), int(error[k, at]))
        for k, at in ((k, int(np.argmax(gone[k]))) for k in np.flatnonzero(gone.any(axis=1)))
    }
    speed, fourth = there[0], there[1] + here.fourth_m_s4[0]
    limit = within_m + 1.25 * fourth * step_s**4 / 384.0 + _SPEED_OFF_M_S * step_s / 4.0
    reach = within_m + 1.02 * (here.speed_m_s[0] + speed) * step_s / 2.0
    with np.errstate(invalid="ignore"):
        row, k = np.nonzero((np.fmin(apart[:, :-1], apart[:, 1:]) <= reach[:, None]) & flies)
    known = ~(np.isnan(apart[row, k]) | np.isnan(apart[row, k + 1]))  # an interval without one end is not flown
    row, k = row[known], k[known]
    ends = position[row, k], velocity[row, k], position[row, k + 1], velocity[row, k + 1]
    alive = _hull_inside(ends, step_s, limit[row])
    row, k = row[alive], k[alive]
    p0, v0, p1, v1 = (part[alive][:, None] for part in ends)
    u = (np.arange(CUT + 1) / CUT)[:, None]
    p = (1 + 2 * u) * (1 - u) ** 2 * p0 + u**2 * (3 - 2 * u) * p1
    p += step_s * (u * (1 - u) ** 2 * v0 - u**2 * (1 - u) * v1)
    v = 6 * u * (1 - u) * (p1 - p0) / step_s + (1 - u) * (1 - 3 * u) * v0 + u * (3 * u - 2) * v1
    flat = [part.reshape(-1, 3) for part in (p[:, :-1], v[:, :-1], p[:, 1:], v[:, 1:])]
    inside = _hull_inside(flat, step_s / CUT, np.repeat(limit[row], CUT)).reshape(-1, CUT)
    of, cut = np.nonzero(inside)
    return np.stack([sets[row[of]], k[of] * CUT + cut], axis=1), lost


def _hull_inside(ends: Sequence[np.ndarray], step_s: float, limit: np.ndarray) -> np.ndarray:
    """Return whether a cubic (n) through two positions and velocities may come within `limit` [m] of the origin.

    It cannot where all four Bezier points are beyond a plane that far off: planes across their mean, and across the part
    of it that is square to the chord.
    """
    p0, v0, p1, v1 = ends
    second, third = p0 + v0 * (step_s / 3.0), p1 - v1 * (step_s / 3.0)
    mean, chord = 0.25 * (p0 + second + third + p1), p1 - p0
    along = np.einsum("ni,ni->n", mean, chord) / np.maximum(np.einsum("ni,ni->n", chord, chord), 1e-12)
    inside = np.ones(len(p0), dtype=bool)
    for across in (mean, mean - along[:, None] * chord):
        length = np.sqrt(np.einsum("ni,ni->n", across, across))
        nearest = np.min([np.einsum("ni,ni->n", point, across) for point in (p0, second, third, p1)], axis=0)
        inside &= ~(nearest > limit * length * (1.0 + 1e-9))
    return inside


def _split_into_lots(cells: np.ndarray) -> list[np.ndarray]:
    """Return the (set, sub-interval) rows in lots of bounded size, all of one set in one."""
    if not len(cells):
        return []
    cells = cells[np.lexsort((cells[:, 1], cells[:, 0]))]
    edges = [0, *(np.flatnonzero(np.diff(cells[:, 0])) + 1).tolist(), len(cells)]
    cuts, last = [], 0
    for begin, end in itertools.pairwise(edges):
        if end - last > _MOST_STATES // 4 and begin > last:
            cuts.append(begin)
            last = begin
    return np.split(cells, cuts)
