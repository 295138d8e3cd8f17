"""Density of the air about the Earth, as a function of time and position that forces on a body call."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from typing import Literal

from rso_lidar import units
from rso_lidar.orbit.sky.almanac import Almanac, Vector3
from rso_lidar.part import Part

Density = Callable[[float, Vector3], float]  # of seconds since the start and a position [m] in GCRS axes: [kg/m3]

# Vallado 4th ed. table 8-4: height [km], density there [kg/m3], scale height [km], up to the next row
_AIR = (
    (0.0, 1.225, 7.249),
    (25.0, 3.899e-2, 6.349),
    (30.0, 1.774e-2, 6.682),
    (40.0, 3.972e-3, 7.554),
    (50.0, 1.057e-3, 8.382),
    (60.0, 3.206e-4, 7.714),
    (70.0, 8.770e-5, 6.549),
    (80.0, 1.905e-5, 5.799),
    (90.0, 3.396e-6, 5.382),
    (100.0, 5.297e-7, 5.877),
    (110.0, 9.661e-8, 7.263),
    (120.0, 2.438e-8, 9.473),
    (130.0, 8.484e-9, 12.636),
    (140.0, 3.845e-9, 16.149),
    (150.0, 2.070e-9, 22.523),
    (180.0, 5.464e-10, 29.740),
    (200.0, 2.789e-10, 37.105),
    (250.0, 7.248e-11, 45.546),
    (300.0, 2.418e-11, 53.628),
    (350.0, 9.518e-12, 53.298),
    (400.0, 3.725e-12, 58.515),
    (450.0, 1.585e-12, 60.828),
    (500.0, 6.967e-13, 63.822),
    (600.0, 1.454e-13, 71.835),
    (700.0, 3.614e-14, 88.667),
    (800.0, 1.170e-14, 124.64),
    (900.0, 5.245e-15, 181.05),
    (1000.0, 3.019e-15, 268.00),
)
_FLOORS_KM = [row[0] for row in _AIR]


class ExponentialAtmosphere(Part):
    """Mean atmosphere without seasons, days or solar activity (Vallado 4th ed. table 8-4), zero above 2500 km."""

    type: Literal["exponential"] = "exponential"

    def density_along(self, sky: Almanac) -> Density:
        """Return the density [kg/m3] as a function of time [s] and position [m].

        The altitude above the ellipsoid is of first order in the flattening, within 50 m (Vallado eq. 8-28).

        Parameters
        ----------
        sky : pole of the run; time counts from its start
        """

        def density(time_s: float, r: Vector3) -> float:
            pole = sky(time_s)[0]
            radius = math.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
            s = (r[0] * pole[0] + r[1] * pole[1] + r[2] * pole[2]) / radius
            return air_density_kg_m3(radius - units.EARTH_RADIUS_M * (1.0 - units.EARTH_FLATTENING * s * s))

        return density


def air_density_kg_m3(height_m: float) -> float:
    """Return the density of Vallado's mean exponential atmosphere (4th ed. table 8-4) [kg/m3], zero above 2500 km."""
    height_km = height_m / units.KM
    if height_km > 2500.0:
        return 0.0
    floor_km, density, scale_km = _AIR[max(bisect_right(_FLOORS_KM, height_km) - 1, 0)]
    return density * math.exp(-(max(height_km, 0.0) - floor_km) / scale_km)
