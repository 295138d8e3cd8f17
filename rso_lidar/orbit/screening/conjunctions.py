"""Conjunction screening: every minimum of range below a limit between one object and many, and when each is inside it.

**Shells.** The osculating orbits at some instants of the span bound perigee and apogee (`orbit_bounds`). An object
above the follower's apogee, or below its perigee, by more than the limit cannot come near.

**Coarse grid.** Every 300 s both are propagated. Between two instants no two objects approach faster than the sum of
their speeds at perigee, which leaves few intervals. In those, a cubic through positions and velocities at both ends
approximates the relative position; it is inside the hull of its four Bezier points. Its error is at most h^4 / 384
times the greatest fourth derivative. (Any component of a vector is a scalar function, so the length has the same
bound.) About a point mass,

    |r''''| <= mu^2 / r_p^5 (1 + 9 e + 12 e^2 / (1 + e)).

This is r'' = -u r, u = mu / r^3, differentiated twice, with |cos| and |sin| of the anomaly set to 1 and r to r_p. In
low orbit it is 1.3e-5 m/s^4, which gives an error of 0.22 km for h = 300 s, as large as the errors found. A quarter is
added for forces beyond a point mass. Another h/4 x 5 m/s is added because the velocity of SGP4 is not quite the
derivative of its position: 2.2 m/s at worst in a catalogue of 15,000. An interval is dropped only if the
hull, less that error, is beyond the limit. The others are divided into eight and tested again.

Those that may be inside are evaluated by SGP4 itself (`close_approach`).

**Several element sets of one object.** Each set is screened separately while it applies and the follower does not
switch its own. The motion is then smooth; adjoining pieces are joined afterwards. Sets that apply for less than 1 ms,
because two epochs differ only in the last digit, are ignored.

**Trajectories.** Anything that answers `states` is screened in the same way, piece by piece (`trajectory_piece`). Its shell,
speed and error of the cubic are measured along each piece.
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
    CloseApproach,
    RelativePositions,
    SubIntervals,
    join_approaches,
    refine_approaches,
)
from rso_lidar.orbit.screening.mixed_fleet import MixedFleet
from rso_lidar.orbit.screening.orbit_bounds import OrbitBounds
from rso_lidar.orbit.screening.scheduled_fleet import STEP_S, ScheduledFleet, ScreenedObject, check_object
from rso_lidar.orbit.screening.trajectory_piece import BRIEF_S, CUT
from rso_lidar.orbit.sets.fleet import Fleet

_MOST_STATES = 400_000  # propagated at a time: some 50 MB
_SPEED_OFF_M_S = 5.0


@dataclass(frozen=True, eq=False)
class ScreeningResult:
    """All close approaches of objects to one follower, by time.

    Parameters
    ----------
    follower, objects : the follower, and the objects, over the span
    approaches : the close approaches, by time of the least range
    rejected : label of an object, and why it was not propagated, or not to the end
    near : number of objects whose shell overlaps the follower's
    """

    follower: ScheduledFleet
    objects: ScheduledFleet
    approaches: tuple[CloseApproach, ...]
    rejected: tuple[tuple[str, str], ...]
    near: int


def screen(
    follower: ScreenedObject,
    objects: Sequence[ScreenedObject],
    start_utc: datetime.datetime,
    duration_s: float,
    within_m: float,
    step_s: float = STEP_S,
) -> ScreeningResult:
    """Find every close approach of objects to one follower.

    An object with several element sets uses, at each instant, the one whose epoch is nearest. A trajectory is searched
    where it has states.

    Parameters
    ----------
    follower : its element set, several, or a trajectory: anything that answers `states`
    objects : the same for each object
    start_utc : start of the span
    duration_s : length of the span [s]
    within_m : limit of range [m]
    step_s : step of the coarse grid [s]

    Returns
    -------
    ScreeningResult

    Raises
    ------
    PropagationError
        if SGP4 has no state of the follower, or its trajectory has none in the whole span
    """
    check_object(follower, "follower")
    lead, flights = (ScheduledFleet(some, start_utc, duration_s, step_s) for some in ([follower], objects))
    if not len(lead.fleet):
        raise PropagationError(f"follower {lead.gaps[0][0]}: {lead.gaps[0][1]}; shift or shorten the span")
    near = np.zeros(len(flights), dtype=bool)
    rejected: dict[int, tuple[float, int]] = {}
    approaches: list[CloseApproach] = []
    for lead_number in range(len(lead.fleet)):
        approaches += _screen_one_set(lead, lead_number, flights, within_m, step_s, near, rejected)
    if lead.several.any() or flights.several.any():
        approaches = join_approaches(approaches, lead, flights)
    approaches.sort(key=lambda approach: (approach.time_s, approach.which))
    lost = (*lead.gaps, *flights.gaps, *describe_rejected(flights.fleet, rejected))
    return ScreeningResult(lead, flights, tuple(approaches), lost, int(near.sum()))


def _screen_one_set(
    lead: ScheduledFleet,
    lead_number: int,
    flights: ScheduledFleet,
    within_m: float,
    step_s: float,
    near: np.ndarray,
    rejected: dict[int, tuple[float, int]],
) -> list[CloseApproach]:
    """Find the close approaches of element sets while one set of the follower applies.

    Parameters
    ----------
    near : (object,) whose shells overlap; added to
    rejected : instant and error code by number of the set; added to

    Raises
    ------
    PropagationError
        if SGP4 has no state of the follower
    """
    begin_s, end_s = max(float(lead.from_s[lead_number]), 0.0), min(float(lead.to_s[lead_number]), lead.duration_s)
    steps = max(1, int(np.ceil((end_s - begin_s) / step_s)))
    instants = np.linspace(begin_s, end_s, steps + 1)
    position, velocity, error = lead.fleet.grid(np.array([lead_number]), instants)
    bad = np.isnan(position[0, :, 0])
    if bad.any():
        at = int(np.argmax(bad))
        instant, what = format_utc(lead.start_utc, float(instants[at])), int(error[0, at])
        reason = lead.fleet.describe_loss(lead_number, float(instants[at]), what)[1]
        why = f": {reason}; take an element set nearer to the span, or" if what > 0 else "; take"
        raise PropagationError(
            f"follower {lead.fleet.sets[lead_number].label}: {'SGP4 ' * (what > 0)}has no state at {instant}{why} a "
            "shorter span",
            bad,
        )
    span_s = np.stack([np.maximum(flights.from_s, begin_s), np.minimum(flights.to_s, end_s)], axis=1)
    at_an_end = (span_s[:, 0] <= 0.0) | (span_s[:, 1] >= lead.duration_s)
    sets = np.flatnonzero(span_s[:, 1] - span_s[:, 0] > np.where(at_an_end, 0.0, BRIEF_S))
    here = OrbitBounds(lead.fleet, np.array([lead_number]), np.array([[begin_s, end_s]]))
    there = OrbitBounds(flights.fleet, sets, span_s[sets])
    meets = np.flatnonzero(there.may_meet(here, within_m))
    meets = meets[np.argsort(span_s[sets[meets], 0], kind="stable")]  # sets that apply at similar times together
    near[flights.owner[sets[meets]]] = True
    pair = RelativePositions(lead.fleet, lead_number, flights.fleet, span_s)
    times = SubIntervals(begin_s, float(instants[-1] - begin_s) / (steps * CUT), steps * CUT)
    lost = {int(sets[k]): (float(there.lost_s[k]), int(there.error[k])) for k in np.flatnonzero(there.never)}
    approaches: list[CloseApproach] = []
    chunk = max(1, _MOST_STATES // len(instants))
    for begin in range(0, len(meets), chunk):
        rows = meets[begin : begin + chunk]
        first = max(int(np.searchsorted(instants, span_s[sets[rows], 0].min(), side="right")) - 1, 0)
        last = min(int(np.searchsorted(instants, span_s[sets[rows], 1].max())), steps)
        some = slice(first, last + 1)
        ends = instants[some], (position[0, some], velocity[0, some])
        cells, gone = _find_cells(
            flights.fleet, sets[rows], span_s[sets[rows]], *ends, here, there.select(rows), within_m
        )
        cells[:, 1] += first * CUT
        lost.update(gone)
        for lot in split_into_lots(cells):
            approaches += refine_approaches(pair, lot, times, within_m)
    for k in np.flatnonzero(there.lost):
        lost.setdefault(int(sets[k]), (float(there.lost_s[k]), int(there.error[k])))
    for number, when in lost.items():
        rejected.setdefault(number, when)
    return approaches


def describe_rejected(fleet: Fleet | MixedFleet, rejected: dict[int, tuple[float, int]]) -> list[tuple[str, str]]:
    """Describe the sets without a state, by number: label, and reason with its instant."""
    return [fleet.describe_loss(k, since_s, error) for k, (since_s, error) in sorted(rejected.items())]


def _find_cells(
    fleet: Fleet | MixedFleet,
    sets: np.ndarray,
    span_s: np.ndarray,
    instants: np.ndarray,
    lead: tuple[np.ndarray, np.ndarray],
    here: OrbitBounds,
    there: tuple[np.ndarray, np.ndarray, np.ndarray],
    within_m: float,
) -> tuple[np.ndarray, dict[int, tuple[float, int]]]:
    """Find the sub-intervals in which an object may be inside the limit.

    Parameters
    ----------
    sets : (set,) numbers of the sets
    span_s : (set, 2) when each applies [s]; nothing beyond counts
    instants : (time,) coarse grid [s]
    lead : position and velocity (time, 3) of the follower
    there : speeds [m/s], fourth derivatives [m/s4] and further errors of the cubic [m] of the sets

    Returns
    -------
    (cell, 2) number of the set and of the sub-interval; and instant and error code of the sets that were lost
    """
    position, velocity, error = fleet.grid(sets, instants)
    position -= lead[0]
    velocity -= lead[1]
    flies = (instants[1:] >= span_s[:, :1]) & (instants[:-1] <= span_s[:, 1:])  # (set, interval)
    gone = np.isnan(position[..., 0])
    gone[:, 1:-1] &= flies[:, 1:] | flies[:, :-1]
    gone[:, 0] &= flies[:, 0]
    gone[:, -1] &= flies[:, -1]
    lost = {
        int(sets[k]): (float(instants[at]), int(error[k, at]))
        for k, at in ((k, int(np.argmax(gone[k]))) for k in np.flatnonzero(gone.any(axis=1)))
    }
    bounds = here.speed_m_s[0] + there[0], here.fourth_m_s4[0] + there[1], here.off_m[0] + there[2]
    row, cut = find_near_cells(position, velocity, float(instants[1] - instants[0]), flies, bounds, within_m)
    return np.stack([sets[row], cut], axis=1), lost


def find_near_cells(
    position_m: np.ndarray,
    velocity_m_s: np.ndarray,
    step_s: float,
    flies: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray, np.ndarray],
    within_m: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Find the sub-intervals in which two objects may come within a limit, from relative states on the coarse grid.

    Parameters
    ----------
    position_m, velocity_m_s : (row, time, 3) relative states [m], [m/s]
    flies : (row, interval) whether an interval counts
    bounds : (row,) sums of both greatest speeds [m/s], of both fourth derivatives [m/s4] and of both further errors [m]

    Returns
    -------
    row, cut : (cell,) row, and number of the sub-interval since the begin of the grid
    """
    position, velocity = position_m, velocity_m_s
    apart = np.sqrt(np.einsum("...i,...i->...", position, position))
    speed, fourth, off = bounds
    limit = within_m + 1.25 * fourth * step_s**4 / 384.0 + off + _SPEED_OFF_M_S * step_s / 4.0
    reach = within_m + 1.02 * speed * step_s / 2.0
    with np.errstate(invalid="ignore"):
        row, k = np.nonzero((np.fmin(apart[:, :-1], apart[:, 1:]) <= reach[:, None]) & flies)
    known = ~(np.isnan(apart[row, k]) | np.isnan(apart[row, k + 1]))  # an interval needs a state at both ends
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
    return row[of], k[of] * CUT + cut


def _hull_inside(ends: Sequence[np.ndarray], step_s: float, limit: np.ndarray) -> np.ndarray:
    """Determine whether a cubic (n) through two positions and velocities may come within a limit of the origin.

    It cannot if all four Bezier points are beyond a plane that far from the origin. Two planes are tried: normal to the
    mean of the points, and normal to the part of it that is perpendicular to the chord.

    Parameters
    ----------
    ends : position and velocity at the begin and at the end, each (n, 3)
    limit : (n,) [m]

    Returns
    -------
    (n,) False where it cannot
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


def split_into_lots(cells: np.ndarray) -> list[np.ndarray]:
    """Split the (set, sub-interval) rows into lots of bounded size, all rows of one set in one lot."""
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
