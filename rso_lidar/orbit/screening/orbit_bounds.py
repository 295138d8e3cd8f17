"""Bounds of osculating orbits over a span: perigee and apogee shells, greatest speeds and fourth derivatives."""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.orbit.sets.fleet import Fleet

_SHELL_INSTANTS = 13
_SHELL_MARGIN_M = 50e3
_J2_R2_M2 = units.EARTH_J2 * units.EARTH_RADIUS_M**2


class OrbitBounds:
    """Bounds of osculating orbits (set), each over its own span (set, 2) [s]: shells, speeds, fourth derivatives."""

    def __init__(self, fleet: Fleet, sets: np.ndarray, span_s: np.ndarray) -> None:
        count = len(sets)
        instants = np.linspace(span_s[:, 0], span_s[:, 1], _SHELL_INSTANTS, axis=1)
        q, top, ecc = np.empty((3, count, _SHELL_INSTANTS))
        for rows in _group_by_span(span_s):
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
        # what is lost on the way may fall: its shell is not believed
        open_ = self.lost | ~np.isfinite(self.perigee_m) | ~np.isfinite(self.apogee_m) | (axis <= 0.0)
        self.perigee_m = np.where(open_, 0.0, self.perigee_m)
        self.apogee_m = np.where(open_, np.inf, self.apogee_m)

    def of(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return speed [m/s] and fourth derivative [m/s4] of some rows."""
        return self.speed_m_s[rows], self.fourth_m_s4[rows]

    def may_meet(self, one: OrbitBounds, within_m: float) -> np.ndarray:
        """Return whether each shell comes within a limit [m] of that of `one`, and there is anything to fly."""
        above = self.perigee_m > one.apogee_m[0] + within_m
        below = self.apogee_m < one.perigee_m[0] - within_m
        meets: np.ndarray = ~(above | below | self.never)
        return meets


def _group_by_span(span_s: np.ndarray) -> list[np.ndarray]:
    """Return rows in lots of bounded size: those of the widest span together, and the rest."""
    widest = (span_s == [span_s[:, 0].min(initial=np.inf), span_s[:, 1].max(initial=-np.inf)]).all(axis=1)
    lots = [np.flatnonzero(widest), np.flatnonzero(~widest)]
    return [lot[begin : begin + 20_000] for lot in lots for begin in range(0, len(lot), 20_000)]


def _propagate_sets(fleet: Fleet, sets: np.ndarray, instants: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return position [m] and velocity [m/s] (set, time, 3), each set at instants (set, time) of its own [s]."""
    if (instants == instants[0]).all():
        return fleet.grid(sets, instants[0])[:2]
    position, velocity = fleet.at(np.repeat(sets, instants.shape[1]), instants.ravel())
    return position.reshape(*instants.shape, 3), velocity.reshape(*instants.shape, 3)
