"""Density of the air about the Earth, as a function of time and position that forces on a body call."""

from __future__ import annotations

import datetime
import importlib.util
import math
from bisect import bisect_right
from collections.abc import Callable
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.earth.earth_fixed import find_earth_fixed_axes
from rso_lidar.orbit.earth.ellipsoid import geodetic_from_itrs
from rso_lidar.orbit.propagation.space_weather import INTERVALS, Activity, SpaceWeather
from rso_lidar.orbit.sky.almanac import Almanac, Vector3
from rso_lidar.part import NotNegative, Part, Positive, Text

Density = Callable[[float, Vector3], float]  # of seconds since the start and a position [m] in GCRS axes: [kg/m3]
_HIGHEST_M = 2_500.0 * units.KM  # the density is zero above
_INTERVAL_S = units.DAY_S / INTERVALS
Flux = Annotated[Positive, Field(ge=20, le=1000)]  # at 10.7 cm: 64 to some 400 was measured since 1947

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
    has_rows: ClassVar[bool] = True  # whether the density jumps where a row of a table ends

    def interval_along(self, sky: Almanac) -> Callable[[float], int] | None:
        """Return None: the density does not depend on time.

        Parameters
        ----------
        sky : of the run; not used
        """
        return None

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


class NrlmsisAtmosphere(Part):
    """NRLMSISE-00 or NRLMSIS 2 by pymsis, with days, seasons, the Sun's and the magnetic field's activity.

    Requires the extra `atmosphere`. With a file of space weather the magnetic activity is that of each three hours and of
    the 57 hours before, else that of the day. The density is zero above 2500 km.
    """

    type: Literal["nrlmsis"] = "nrlmsis"
    has_rows: ClassVar[bool] = False
    version: Literal["00", "2.0", "2.1"] = Field(
        default="2.1", description="Version: `00` for NRLMSISE-00 (2002), `2.0` (2020) or `2.1` (2022) for NRLMSIS."
    )
    space_weather_file: Text | None = Field(
        default=None,
        description=(
            "Path of CelesTrak's SW-All.csv or SW-All.txt, with flux and ap day by day. If omitted, `f107`, `f107a` and "
            "`ap` apply all the time."
        ),
    )
    f107: Flux | None = Field(
        default=None, description="Observed solar flux at 10.7 cm of the day before [10⁻²² W m⁻² Hz⁻¹]: some 70 to 250."
    )
    f107a: Flux | None = Field(
        default=None, description="Mean of `f107` over 81 days about the day [10⁻²² W m⁻² Hz⁻¹]."
    )
    ap: Annotated[NotNegative, Field(le=400)] | None = Field(
        default=None, description="Daily geomagnetic index ap: 4 in quiet days, 100 and more in storms."
    )

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        constants = {name: getattr(self, name) for name in ("f107", "f107a", "ap")}
        given = [name for name, value in constants.items() if value is not None]
        if self.space_weather_file is not None and given:
            raise ValueError(f"{given[0]}: space_weather_file has it; leave one of them out")
        if self.space_weather_file is None and len(given) < len(constants):
            missing = next(name for name in constants if name not in given)
            raise ValueError(f"{missing}: is missing; give f107, f107a and ap, or a space_weather_file")
        return self

    def density_along(self, sky: Almanac) -> Density:
        """Return the density [kg/m3] as a function of time [s] and position [m].

        pymsis computes in single precision, so the density has a noise of 1e-6 of its value.

        Parameters
        ----------
        sky : of the run; time counts from its start

        Raises
        ------
        ScenarioError
            if the extra `atmosphere` is not installed, or the file of space weather is none
        """
        msis = _import_pymsis()
        axes, find_activity = find_earth_fixed_axes(sky.start_utc), self._load_activity(sky.start_utc)
        # -1: the magnetic activity of the last 57 hours; 1: that of the day
        options = msis.msis.create_options(geomagnetic_activity=1 if self.space_weather_file is None else -1)
        start = np.datetime64(sky.start_utc.astimezone(datetime.UTC).replace(tzinfo=None), "us")

        def density(time_s: float, r: Vector3) -> float:
            place = geodetic_from_itrs(np.array(axes(time_s)) @ r)
            if place.height_m > _HIGHEST_M:
                return 0.0
            activity = find_activity(time_s)
            row = msis.calculate(
                [start + np.timedelta64(round(time_s * 1e6), "us")],
                [float(place.longitude_rad) / units.DEG],
                [float(place.latitude_rad) / units.DEG],
                [float(place.height_m) / units.KM],
                [activity.f107],
                [activity.f107a],
                [activity.ap],
                version=self.version,
                options=options,
            )
            return float(row[0, msis.Variable.MASS_DENSITY])

        return density

    def interval_along(self, sky: Almanac) -> Callable[[float], int] | None:
        """Return the number of the three hours as a function of time [s]: the density jumps where it changes.

        Parameters
        ----------
        sky : of the run; time counts from its start
        """
        begin_s = _second_of_day(sky.start_utc)
        return lambda time_s: math.floor((begin_s + time_s) / _INTERVAL_S)

    def _load_activity(self, start_utc: datetime.datetime) -> Callable[[float], Activity]:
        """Return the activity as a function of seconds since the start."""
        if self.f107 is not None and self.f107a is not None and self.ap is not None:
            constant = Activity(self.f107, self.f107a, (self.ap,) * 7)
            return lambda time_s: constant
        assert self.space_weather_file is not None, "checked by _one_source"
        weather = SpaceWeather.from_file(self.space_weather_file)
        first_day, begin_s = start_utc.astimezone(datetime.UTC).toordinal(), _second_of_day(start_utc)

        def find(time_s: float) -> Activity:
            days, interval = divmod(math.floor((begin_s + time_s) / _INTERVAL_S), INTERVALS)
            return weather.find_activity(first_day + days, interval)

        return find


Atmosphere = Annotated[ExponentialAtmosphere | NrlmsisAtmosphere, Field(discriminator="type")]


def _second_of_day(start_utc: datetime.datetime) -> float:
    """Return the seconds since midnight UTC; a leap second later in the run is left out."""
    utc = start_utc.astimezone(datetime.UTC)
    return (utc - utc.replace(hour=0, minute=0, second=0, microsecond=0)).total_seconds()


def _import_pymsis() -> Any:
    """Import the library of the model; a `ScenarioError` names the extra where it is not installed."""
    if importlib.util.find_spec("pymsis") is None:
        raise ScenarioError("atmosphere nrlmsis: needs the extra 'atmosphere' (pip install 'rso-lidar[atmosphere]')")
    import pymsis

    return pymsis


def air_density_kg_m3(height_m: float) -> float:
    """Return the density of Vallado's mean exponential atmosphere (4th ed. table 8-4) [kg/m3], zero above 2500 km."""
    height_km = height_m / units.KM
    if height_m > _HIGHEST_M:
        return 0.0
    floor_km, density, scale_km = _AIR[max(bisect_right(_FLOORS_KM, height_km) - 1, 0)]
    return density * math.exp(-(max(height_km, 0.0) - floor_km) / scale_km)
