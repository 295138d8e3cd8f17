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

from rso_lidar import units
from rso_lidar.errors import PropagationError
from rso_lidar.orbit.epochs import utc_text
from rso_lidar.orbit.screening.close_approach import BRIEF_S, Pair, Stay, Times, joined, refined
from rso_lidar.orbit.sets.element_set import ElementSet
from rso_lidar.orbit.sets.fleet import Fleet, Flights
from rso_lidar.orbit.sets.teme import reason

STEP_S = 300.0
CUT = 8  # sub-intervals of a step
_MOST_STATES = 400_000  # flown at a time: some 50 MB
_SHELL_INSTANTS = 13
_SHELL_MARGIN_M = 50e3
_J2_R2_M2 = units.EARTH_J2 * units.EARTH_RADIUS_M**2
_SPEED_OFF_M_S = 5.0


@dataclass(frozen=True, eq=False)
class Screened:
    """All stays of objects within a limit of one follower, by time; `near` of the objects shared its shell.

    `rejected` says of objects, by label, why they were not flown, or from when on they were not.
    """

    follower: Flights
    objects: Flights
    stays: tuple[Stay, ...]
    rejected: tuple[tuple[str, str], ...]
    near: int


def screen(
    follower: ElementSet | Sequence[ElementSet],
    objects: Sequence[ElementSet | Sequence[ElementSet]],
    start_utc: datetime.datetime,
    duration_s: float,
    within_m: float,
    step_s: float = STEP_S,
) -> Screened:
    """Return every stay of `objects` within `within_m` [m] of `follower` during `duration_s` [s] from `start_utc`.

    Whoever has several element sets flies at each instant by the one whose epoch is nearest.
    """
    lead, flights = Flights([follower], start_utc, duration_s), Flights(objects, start_utc, duration_s)
    near = np.zeros(len(flights), dtype=bool)
    rejected: dict[int, tuple[float, int]] = {}
    stays: list[Stay] = []
    for one in range(len(lead.fleet)):
        stays += _while_one_leads(lead, one, flights, within_m, step_s, near, rejected)
    if lead.several.any() or flights.several.any():
        stays = joined(stays, lead, flights)
    stays.sort(key=lambda stay: (stay.time_s, stay.which))
    return Screened(lead, flights, tuple(stays), tuple(_told(flights.fleet, rejected)), int(near.sum()))


def _while_one_leads(
    lead: Flights,
    one: int,
    flights: Flights,
    within_m: float,
    step_s: float,
    near: np.ndarray,
    rejected: dict[int, tuple[float, int]],
) -> list[Stay]:
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
            f"{utc_text(lead.start_utc, float(instants[at]))}: {reason(int(error[0, at]))}; take an element set nearer to "
            "the span, or a shorter span",
            bad,
        )
    span_s = np.stack([np.maximum(flights.from_s, begin_s), np.minimum(flights.to_s, end_s)], axis=1)
    at_an_end = (span_s[:, 0] <= 0.0) | (span_s[:, 1] >= lead.duration_s)
    sets = np.flatnonzero(span_s[:, 1] - span_s[:, 0] > np.where(at_an_end, 0.0, BRIEF_S))
    here = Orbits(lead.fleet, np.array([one]), np.array([[begin_s, end_s]]))
    there = Orbits(flights.fleet, sets, span_s[sets])
    meets = np.flatnonzero(there.may_meet(here, within_m))
    meets = meets[np.argsort(span_s[sets[meets], 0], kind="stable")]  # sets that fly at about one time together
    near[flights.owner[sets[meets]]] = True
    pair = Pair(lead.fleet, one, flights.fleet, span_s)
    times = Times(begin_s, float(instants[-1] - begin_s) / (steps * CUT), steps * CUT)
    lost = {int(sets[k]): (float(there.lost_s[k]), int(there.error[k])) for k in np.flatnonzero(there.never)}
    stays: list[Stay] = []
    chunk = max(1, _MOST_STATES // len(instants))
    for begin in range(0, len(meets), chunk):
        rows = meets[begin : begin + chunk]
        first = max(int(np.searchsorted(instants, span_s[sets[rows], 0].min(), side="right")) - 1, 0)
        last = min(int(np.searchsorted(instants, span_s[sets[rows], 1].max())), steps)
        some = slice(first, last + 1)
        ends = instants[some], (position[0, some], velocity[0, some])
        cells, gone = _may_be_inside(
            flights.fleet, sets[rows], span_s[sets[rows]], *ends, here, there.of(rows), within_m
        )
        cells[:, 1] += first * CUT
        lost.update(gone)
        for lot in _in_lots(cells):
            stays += refined(pair, lot, times, within_m)
    for k in np.flatnonzero(there.lost):
        lost.setdefault(int(sets[k]), (float(there.lost_s[k]), int(there.error[k])))
    for number, when in lost.items():
        rejected.setdefault(number, when)
    return stays


def _told(fleet: Fleet, rejected: dict[int, tuple[float, int]]) -> list[tuple[str, str]]:
    return [
        (
            fleet.sets[k].label,
            f"{reason(error)}, by {utc_text(fleet.start_utc, since_s)} (elements of "
            f"{fleet.sets[k].epoch_utc:%Y-%m-%dT%H:%MZ})",
        )
        for k, (since_s, error) in sorted(rejected.items())
    ]


class Orbits:
    """Bounds of osculating orbits (set), each over its own span (set, 2) [s]: shells, speeds, fourth derivatives."""

    def __init__(self, fleet: Fleet, sets: np.ndarray, span_s: np.ndarray) -> None:
        count = len(sets)
        instants = np.linspace(span_s[:, 0], span_s[:, 1], _SHELL_INSTANTS, axis=1)
        q, top, ecc = np.empty((3, count, _SHELL_INSTANTS))
        for rows in _alike(span_s):
            position, velocity = _flown(fleet, sets[rows], instants[rows])
            radius = np.sqrt(np.einsum("...i,...i->...", position, position))
            speed2 = np.einsum("...i,...i->...", velocity, velocity)
            radial = np.einsum("...i,...i->...", position, velocity) / radius
            axis = 1.0 / (2.0 / radius - speed2 / units.EARTH_GM_M3_S2)
            latus = radius**2 * (speed2 - radial**2) / units.EARTH_GM_M3_S2
            ecc[rows] = np.sqrt(np.maximum(1.0 - latus / axis, 0.0))
            q[rows], top[rows] = axis * (1.0 - ecc[rows]), axis * (1.0 + ecc[rows])
        gone = np.isnan(q)
        self.never, self.lost = gone.all(axis=1), gone.any(axis=1)
        first = gone.argmax(axis=1)
        self.lost_s = instants[np.arange(count), first]
        self.error = np.zeros(count, dtype=int)
        for k in np.flatnonzero(self.lost):
            self.error[k] = fleet.grid(sets[k : k + 1], self.lost_s[k : k + 1])[2][0, 0]
        with np.errstate(all="ignore"):
            least, most = np.fmin.reduce(q, axis=1), np.fmax.reduce(top, axis=1)
            axis = 0.5 * (least + most)
            self.perigee_m = least - _SHELL_MARGIN_M - (np.fmax.reduce(q, axis=1) - least)
            spread = most - np.fmin.reduce(top, axis=1)
            self.apogee_m = most + _SHELL_MARGIN_M + spread + 4.0 * axis**2 * _J2_R2_M2 / least**3
            e = np.clip(np.fmax.reduce(ecc, axis=1) + 0.01, 0.0, 1.0)
            low = np.maximum(np.where(np.isnan(least), 0.0, least) - 0.5 * _SHELL_MARGIN_M, units.EARTH_RADIUS_M)
        self.speed_m_s = np.sqrt(units.EARTH_GM_M3_S2 * (1.0 + e) / low)
        self.fourth_m_s4 = units.EARTH_GM_M3_S2**2 / low**5 * (1.0 + 9.0 * e + 12.0 * e**2 / (1.0 + e))
        # what is lost on the way may fall: its shell is not believed
        open_ = self.lost | ~np.isfinite(self.perigee_m) | ~np.isfinite(self.apogee_m) | (axis <= 0.0)
        self.perigee_m = np.where(open_, 0.0, self.perigee_m)
        self.apogee_m = np.where(open_, np.inf, self.apogee_m)

    def of(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return speed [m/s] and fourth derivative [m/s4] of some rows."""
        return self.speed_m_s[rows], self.fourth_m_s4[rows]

    def may_meet(self, one: Orbits, within_m: float) -> np.ndarray:
        """Return whether each shell comes within a limit [m] of that of `one`, and there is anything to fly."""
        above = self.perigee_m > one.apogee_m[0] + within_m
        below = self.apogee_m < one.perigee_m[0] - within_m
        meets: np.ndarray = ~(above | below | self.never)
        return meets


def _alike(span_s: np.ndarray) -> list[np.ndarray]:
    """Return rows in lots of bounded size: those of the widest span together, and the rest."""
    widest = (span_s == [span_s[:, 0].min(initial=np.inf), span_s[:, 1].max(initial=-np.inf)]).all(axis=1)
    lots = [np.flatnonzero(widest), np.flatnonzero(~widest)]
    return [lot[begin : begin + 20_000] for lot in lots for begin in range(0, len(lot), 20_000)]


def _flown(fleet: Fleet, sets: np.ndarray, instants: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return position [m] and velocity [m/s] (set, time, 3), each set at instants (set, time) of its own [s]."""
    if (instants == instants[0]).all():
        return fleet.grid(sets, instants[0])[:2]
    position, velocity = fleet.at(np.repeat(sets, instants.shape[1]), instants.ravel())
    return position.reshape(*instants.shape, 3), velocity.reshape(*instants.shape, 3)


def _may_be_inside(
    fleet: Fleet,
    sets: np.ndarray,
    span_s: np.ndarray,
    instants: np.ndarray,
    lead: tuple[np.ndarray, np.ndarray],
    here: Orbits,
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


def _in_lots(cells: np.ndarray) -> list[np.ndarray]:
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
