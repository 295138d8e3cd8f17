"""Pole, Sun and Moon tabulated for an integrator, which requests one instant at a time.

Positions are computed every quarter of an hour, one day at a time, and interpolated by a cubic through the four nearest
instants: within 1e-11 rad. The instants are counted from the start of the run, so a result has the same bits whichever
instants were requested before.
"""

from __future__ import annotations

import datetime
import math

import numpy as np

from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.sky.moon import moon_position_m
from rso_lidar.orbit.sky.precession import pole_direction
from rso_lidar.orbit.sky.sun import sun_position_m

_STEP_S = 900.0
_DAY = 96  # steps of a day
Vector3 = tuple[float, float, float]
_NOWHERE = (0.0, 0.0, 0.0)


class Almanac:
    """Pole, Sun and Moon at any instant of a run. A body that is not needed is at (0, 0, 0).

    Parameters
    ----------
    start_utc : start of the run
    sun : whether the Sun is needed
    moon : whether the Moon is needed
    """

    def __init__(self, start_utc: datetime.datetime, *, sun: bool, moon: bool) -> None:
        self.start_utc, self._sun, self._moon = start_utc, sun, moon
        self._days: dict[int, list[list[float]]] = {}
        self._last = (math.nan, (_NOWHERE, _NOWHERE, _NOWHERE))  # forces at one instant each request it

    def __call__(self, time_s: float) -> tuple[Vector3, Vector3, Vector3]:
        """Return the pole (unit vector), the Sun [m] and the Moon [m] in GCRS axes, `time_s` seconds after the start."""
        last_s, last = self._last
        if time_s == last_s:
            return last
        u = time_s / _STEP_S
        step = math.floor(u)
        day, row = divmod(step, _DAY)
        rows = self._days.get(day)
        if rows is None:
            rows = self._days[day] = self._tabulate(day)
        u -= step
        a, b, c, d = u + 1.0, u, u - 1.0, u - 2.0
        k0, k1, k2, k3 = -b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0
        values = [
            k0 * p + k1 * q + k2 * r + k3 * s
            for p, q, r, s in zip(rows[row], rows[row + 1], rows[row + 2], rows[row + 3], strict=True)
        ]
        sun = (values[3], values[4], values[5]) if self._sun else _NOWHERE
        moon = (values[-3], values[-2], values[-1]) if self._moon else _NOWHERE
        bodies = ((values[0], values[1], values[2]), sun, moon)
        self._last = (time_s, bodies)
        return bodies

    def _tabulate(self, day: int) -> list[list[float]]:
        times = _STEP_S * (day * _DAY + np.arange(-1, _DAY + 2))
        epochs = Epochs(self.start_utc, times)
        columns = [pole_direction(epochs)]
        if self._sun:
            columns.append(sun_position_m(epochs))
        if self._moon:
            columns.append(moon_position_m(epochs))
        rows: list[list[float]] = np.concatenate(columns, axis=1).tolist()
        return rows
