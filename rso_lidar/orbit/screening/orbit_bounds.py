"""Bounds of osculating orbits over a span: perigee and apogee shells, greatest speeds and fourth derivatives.

A shell has three margins. 50 km cover short periods and the long-period terms of SGP4, which change a radius by less than
25 km. The spread of the samples covers drag. The apogee is raised by the effect of the J2 part of the energy at perigee,
4 a^2 J2 R^2 / r_p^3. Bounds of pieces of trajectories are measured instead (`trajectory_piece`).
"""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.orbit.screening.mixed_fleet import MixedFleet
from rso_lidar.orbit.sets.fleet import Fleet

_SHELL_INSTANTS = 13
_SHELL_MARGIN_M = 50e3
_J2_R2_M2 = units.EARTH_J2 * units.EARTH_RADIUS_M**2


class OrbitBounds:
    """Bounds of the orbits of some element sets, each over its own span, and of pieces of trajectories.

    Parameters
    ----------
    fleet : the element sets and pieces
    sets : (set,) numbers of the sets
    span_s : (set, 2) span of each [s since the start]

    Attributes
    ----------
    perigee_m, apogee_m : (set,) bounds of the distance from the Earth's centre [m]
    speed_m_s : (set,) greatest speed [m/s]
    fourth_m_s4 : (set,) bound of the fourth derivative of position [m/s4]
    off_m : (set,) further error of the cubic, which does not shrink with the step [m]
    never, lost : (set,) whether there is a state at no instant, and whether one is missing at some
    lost_s, error : (set,) the first such instant [s], and SGP4's error code there
    """

    def __init__(self, fleet: Fleet | MixedFleet, sets: np.ndarray, span_s: np.ndarray) -> None:
        count = len(sets)
        measured = fleet.find_measured_bounds(sets)
        of_orbit = np.ones(count, dtype=bool) if measured is None else np.isnan(measured[:, 0])
        instants = np.linspace(span_s[:, 0], span_s[:, 1], _SHELL_INSTANTS, axis=1)
        q, top, ecc = np.ones((3, count, _SHELL_INSTANTS))
        for rows in (rows[of_orbit[rows]] for rows in _group_by_span(span_s)):
            if not len(rows):
                continue
            position, velocity = _propagate_sets(fleet, sets[rows], instants[rows])
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
        # an object lost on the way may be decaying, so its shell is not used
        open_ = self.lost | ~np.isfinite(self.perigee_m) | ~np.isfinite(self.apogee_m) | (axis <= 0.0)
        self.perigee_m = np.where(open_, 0.0, self.perigee_m)
        self.apogee_m = np.where(open_, np.inf, self.apogee_m)
        self.off_m = np.zeros(count)
        if measured is not None:
            own = ~of_orbit
            self.perigee_m[own], self.apogee_m[own], self.speed_m_s[own], self.off_m[own] = measured[own].T
            self.fourth_m_s4[own] = 0.0  # the error of the cubic is measured as a whole

    def select(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return speed [m/s], fourth derivative [m/s4] and further error [m] of some rows."""
        return self.speed_m_s[rows], self.fourth_m_s4[rows], self.off_m[rows]

    def may_meet(self, other: OrbitBounds, within_m: float) -> np.ndarray:
        """Return whether each shell comes within a limit [m] of that of `other`, and has any state at all."""
        above = self.perigee_m > other.apogee_m[0] + within_m
        below = self.apogee_m < other.perigee_m[0] - within_m
        meets: np.ndarray = ~(above | below | self.never)
        return meets


def _group_by_span(span_s: np.ndarray) -> list[np.ndarray]:
    """Group rows into lots of bounded size: those of the widest span, and the others."""
    widest = (span_s == [span_s[:, 0].min(initial=np.inf), span_s[:, 1].max(initial=-np.inf)]).all(axis=1)
    lots = [np.flatnonzero(widest), np.flatnonzero(~widest)]
    return [lot[begin : begin + 20_000] for lot in lots for begin in range(0, len(lot), 20_000)]


def _propagate_sets(fleet: Fleet | MixedFleet, sets: np.ndarray, instants: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Propagate element sets, each to its own instants: position [m] and velocity [m/s] (set, time, 3) in TEME axes.

    Parameters
    ----------
    sets : (set,) numbers of the sets
    instants : (set, time) [s since the start]
    """
    if (instants == instants[0]).all():
        return fleet.grid(sets, instants[0])[:2]
    position, velocity = fleet.at(np.repeat(sets, instants.shape[1]), instants.ravel())
    return position.reshape(*instants.shape, 3), velocity.reshape(*instants.shape, 3)
