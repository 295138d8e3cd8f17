"""Earth-fixed axes tabulated for an integrator, which requests one instant at a time."""

from __future__ import annotations

import datetime
import functools
import math

import numpy as np

from rso_lidar import units
from rso_lidar.orbit.earth.earth_orientation import EarthOrientation
from rso_lidar.orbit.earth.earth_rotation import itrs_from_gcrs
from rso_lidar.orbit.epochs import Epochs

_STEP_S = 900.0
_HOUR = 4  # steps of an hour
Rows3 = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]


class EarthFixedAxes:
    """Rotation from GCRS to Earth-fixed axes at any instant of a run, within 1e-10 radian of `itrs_from_gcrs`.

    The rotation less the mean turn of the Earth changes slowly: by precession, nutation and, once a day, the pole's
    place. It is computed every quarter of an hour and interpolated by a cubic through the four nearest instants. These are
    counted from the start of the run, so a result has the same bits whichever instants were requested before.

    Parameters
    ----------
    start_utc : start of the run
    orientation : polar motion and UT1, see `itrs_from_gcrs`
    """

    def __init__(self, start_utc: datetime.datetime, orientation: EarthOrientation | None = None) -> None:
        self._start, self._orientation = start_utc, orientation
        self._hours: dict[int, list[list[float]]] = {}

    def __call__(self, time_s: float) -> Rows3:
        """Return the rows of itrs_from_gcrs `time_s` seconds after the start."""
        u = time_s / _STEP_S
        step = math.floor(u)
        hour, row = divmod(step, _HOUR)
        nodes = self._hours.get(hour)
        if nodes is None:
            nodes = self._hours[hour] = self._tabulate(hour)
        u -= step
        a, b, c, d = u + 1.0, u, u - 1.0, u - 2.0
        k0, k1, k2, k3 = -b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0
        x0, x1, x2, y0, y1, y2, z0, z1, z2 = [
            k0 * p + k1 * q + k2 * r + k3 * s
            for p, q, r, s in zip(nodes[row], nodes[row + 1], nodes[row + 2], nodes[row + 3], strict=True)
        ]
        turn = units.EARTH_ROTATION_RAD_S * time_s
        cos, sin = math.cos(turn), math.sin(turn)
        return (
            (cos * x0 + sin * y0, cos * x1 + sin * y1, cos * x2 + sin * y2),
            (cos * y0 - sin * x0, cos * y1 - sin * x1, cos * y2 - sin * x2),
            (z0, z1, z2),
        )

    def _tabulate(self, hour: int) -> list[list[float]]:
        times = _STEP_S * (hour * _HOUR + np.arange(-1, _HOUR + 2))
        x, y, z = np.moveaxis(itrs_from_gcrs(Epochs(self._start, times), self._orientation), 1, 0)
        turn = units.EARTH_ROTATION_RAD_S * times
        cos, sin = np.cos(turn)[:, None], np.sin(turn)[:, None]
        rows: list[list[float]] = np.concatenate([cos * x - sin * y, sin * x + cos * y, z], axis=1).tolist()
        return rows


find_earth_fixed_axes = functools.lru_cache(maxsize=8)(EarthFixedAxes)  # all forces of a run share one table
