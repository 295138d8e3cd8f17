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
"""

from __future__ import annotations

import datetime
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.errors import PropagationError
from rso_lidar.orbit.element_set import ElementSet
from rso_lidar.orbit.epochs import utc_text
from rso_lidar.orbit.fleet import Fleet, reason
from rso_lidar.orbit.stays import Pair, Stay, refined

STEP_S = 300.0
CUT = 8  # sub-intervals of a step
_MOST_STATES = 400_000  # flown at a time: some 50 MB
_SHELL_INSTANTS = 13
_SHELL_MARGIN_M = 50e3
_J2_R2_M2 = units.EARTH_J2 * units.EARTH_RADIUS_M**2
_SPEED_OFF_M_S = 5.0


@dataclass(frozen=True, eq=False)
class Screened:
    """All stays of a fleet within a limit of one follower, by time; `near` of the objects shared its shell.

    `rejected` says of objects, by label, why they were not flown, or from when on they were not.
    """

    follower: Fleet
    fleet: Fleet
    stays: tuple[Stay, ...]
    rejected: tuple[tuple[str, str], ...]
    near: int


def screen(
    follower: ElementSet,
    objects: Sequence[ElementSet],
    start_utc: datetime.datetime,
    duration_s: float,
    within_m: float,
    step_s: float = STEP_S,
) -> Screened:
    """Return every stay of `objects` within `within_m` [m] of `follower` during `duration_s` [s] from `start_utc`."""
    lead, fleet = Fleet([follower], start_utc), Fleet(objects, start_utc)
    steps = max(1, int(np.ceil(duration_s / step_s)))
    instants = np.linspace(0.0, duration_s, steps + 1)
    position, velocity, error = lead.grid(np.zeros(1, dtype=int), instants)
    bad = np.isnan(position[0, :, 0])
    if bad.any():
        at = int(np.argmax(bad))
        raise PropagationError(
            f"follower {follower.label}: SGP4 has no state at {utc_text(start_utc, float(instants[at]))}: "
            f"{reason(int(error[0, at]))}; take an element set nearer to the span, or a shorter span",
            bad,
        )
    here = Orbits(lead, duration_s)
    there = Orbits(fleet, duration_s)
    near = np.flatnonzero(there.may_meet(here, within_m))
    pair = Pair(lead, fleet)
    rejected = {int(k): (0.0, int(there.error[k])) for k in np.flatnonzero(there.never)}
    stays: list[Stay] = []
    chunk = max(1, _MOST_STATES // len(instants))
    for begin in range(0, len(near), chunk):
        which = near[begin : begin + chunk]
        cells, lost = _may_be_inside(fleet, which, instants, (position[0], velocity[0]), here, there, within_m)
        rejected.update(lost)
        for some in _in_lots(cells):
            stays += refined(pair, some, instants[-1] / (steps * CUT), steps * CUT, within_m)
    for k in np.flatnonzero(there.lost & ~np.isin(np.arange(len(fleet)), list(rejected))):
        rejected[int(k)] = (float(there.lost_s[k]), int(there.error[k]))
    stays.sort(key=lambda stay: (stay.time_s, stay.which))
    return Screened(lead, fleet, tuple(stays), tuple(_told(fleet, rejected)), len(near))


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
    """Bounds of the osculating orbits of a fleet over a span: shells, speeds, fourth derivatives."""

    def __init__(self, fleet: Fleet, duration_s: float) -> None:
        instants = np.linspace(0.0, duration_s, _SHELL_INSTANTS)
        perigee, apogee, eccentricity, lost, code = ([] for _ in range(5))
        for begin in range(0, len(fleet), 20_000):
            some = np.arange(begin, min(begin + 20_000, len(fleet)))
            position, velocity, error = fleet.grid(some, instants)
            radius = np.sqrt(np.einsum("...i,...i->...", position, position))
            speed2 = np.einsum("...i,...i->...", velocity, velocity)
            radial = np.einsum("...i,...i->...", position, velocity) / radius
            axis = 1.0 / (2.0 / radius - speed2 / units.EARTH_GM_M3_S2)
            latus = radius**2 * (speed2 - radial**2) / units.EARTH_GM_M3_S2
            ecc = np.sqrt(np.maximum(1.0 - latus / axis, 0.0))
            perigee.append(axis * (1.0 - ecc))
            apogee.append(axis * (1.0 + ecc))
            eccentricity.append(ecc)
            lost.append(np.isnan(radius))
            code.append(error)
        gone = np.concatenate(lost) if lost else np.zeros((0, _SHELL_INSTANTS), dtype=bool)
        self.never, self.lost = gone.all(axis=1), gone.any(axis=1)
        first = gone.argmax(axis=1)
        self.lost_s = instants[first]
        codes = np.concatenate(code) if code else np.zeros(gone.shape, dtype=int)
        self.error = codes[np.arange(len(codes)), first]
        if not len(gone):
            self.perigee_m = self.apogee_m = self.speed_m_s = self.fourth_m_s4 = np.zeros(0)
            return
        q, top, ecc = (np.concatenate(entry) for entry in (perigee, apogee, eccentricity))
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

    def may_meet(self, one: Orbits, within_m: float) -> np.ndarray:
        """Return whether each shell comes within a limit [m] of that of `one`, and there is anything to fly."""
        above = self.perigee_m > one.apogee_m[0] + within_m
        below = self.apogee_m < one.perigee_m[0] - within_m
        meets: np.ndarray = ~(above | below | self.never)
        return meets


def _may_be_inside(
    fleet: Fleet,
    which: np.ndarray,
    instants: np.ndarray,
    lead: tuple[np.ndarray, np.ndarray],
    here: Orbits,
    there: Orbits,
    within_m: float,
) -> tuple[np.ndarray, dict[int, tuple[float, int]]]:
    """Return (object, sub-interval) rows in which something may be inside, and what was lost when (time, error code)."""
    step_s = instants[1] - instants[0]
    position, velocity, error = fleet.grid(which, instants)
    position -= lead[0]
    velocity -= lead[1]
    apart = np.sqrt(np.einsum("...i,...i->...", position, position))
    gone = np.isnan(apart)
    lost = {
        int(which[k]): (float(instants[at]), int(error[k, at]))
        for k, at in ((k, int(np.argmax(gone[k]))) for k in np.flatnonzero(gone.any(axis=1)))
    }
    fourth = here.fourth_m_s4[0] + there.fourth_m_s4[which]
    limit = within_m + 1.25 * fourth * step_s**4 / 384.0 + _SPEED_OFF_M_S * step_s / 4.0
    reach = within_m + 1.02 * (here.speed_m_s[0] + there.speed_m_s[which]) * step_s / 2.0
    with np.errstate(invalid="ignore"):
        row, k = np.nonzero(np.fmin(apart[:, :-1], apart[:, 1:]) <= reach[:, None])
    known = ~(gone[row, k] | gone[row, k + 1])  # an interval without one end is not flown
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
    return np.stack([which[row[of]], k[of] * CUT + cut], axis=1), lost


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
    """Return the (object, sub-interval) rows in lots of bounded size, all of one object in one."""
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
