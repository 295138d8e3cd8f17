"""Forces on a body about the Earth: zonal harmonics, air drag, sunlight, Sun and Moon.

Left out, with their effect on a low orbit in a day: the Earth's other harmonics (J22 and on: hundreds of metres to a
kilometre), tides, light from the Earth, and relativity (metres). The atmosphere of the table is a mean one: above 300 km
the density varies by a factor of up to ten with solar activity.
"""

from __future__ import annotations

import datetime
import functools
import math
from bisect import bisect_right
from collections.abc import Callable
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, Strict, model_validator

from rso_lidar import units
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.propagation.facet_model import FacetForces
from rso_lidar.orbit.sky.almanac import Almanac
from rso_lidar.orbit.sky.eclipse import sunlit_fraction
from rso_lidar.part import Flag, Part, Positive

GM = units.EARTH_GM_M3_S2
_ZONALS = (units.EARTH_J2, units.EARTH_J3, units.EARTH_J4, units.EARTH_J5, units.EARTH_J6)
_CORE_M = 0.5 * units.EARTH_RADIUS_M  # below this radius the attraction is held constant, because no orbit is there
Vector3 = tuple[float, float, float]
ForceField = Callable[[float, Vector3, Vector3], tuple[Vector3, float]]

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


class Drag(Part):
    """Air drag in an exponential atmosphere that rotates with the Earth."""

    area_m2: Positive = Field(description="Cross-section in the flow [m²].")
    mass_kg: Positive = Field(description="Mass of the body [kg]; thrust does not change it here.")
    drag_coefficient: Positive = Field(default=2.2, description="Drag coefficient; 2.2 suits most satellites.")


class RadiationPressure(Part):
    """Pressure of sunlight on a sphere, in full light, penumbra or the Earth's shadow."""

    area_m2: Positive = Field(description="Cross-section in the sunlight [m²].")
    mass_kg: Positive = Field(description="Mass of the body [kg]; thrust does not change it here.")
    coefficient: Positive = Field(
        default=1.3,
        description="Radiation pressure coefficient: 1 for a black body, 2 for a flat mirror that faces the Sun.",
    )


class Forces(Part):
    """Forces besides the Earth's central attraction: zonal harmonics, drag, radiation pressure, Sun and Moon."""

    zonal_degree: Annotated[int, Strict(), Field(ge=0, le=6)] = Field(
        default=2,
        description="Highest degree of the zonal harmonics (EGM96) about the pole of date; 0 is a point mass.",
    )
    drag: Drag | None = Field(
        default=None,
        description="Drag in a mean exponential atmosphere that rotates with the Earth. If omitted, there is none.",
    )
    radiation_pressure: RadiationPressure | None = Field(
        default=None,
        description="Solar radiation pressure, with the Earth's conical shadow. If omitted, there is none.",
    )
    facets: FacetForces | None = Field(
        default=None,
        description="Sunlight and air on the facets of a target that moves by `numerical`, at its attitude, in place of "
        "`drag` and `radiation_pressure`. If omitted, there is none.",
    )
    sun: Flag = Field(default=False, description="Whether the Sun's gravity acts.")
    moon: Flag = Field(default=False, description="Whether the Moon's gravity acts.")

    @model_validator(mode="after")
    def _degree(self) -> Self:
        if self.zonal_degree == 1:
            raise ValueError(
                "zonal_degree: must be 0 for a point mass, or 2 to 6, because J1 does not exist; use 0 or 2"
            )
        if self.facets is not None:
            for name, acts in (("drag", self.facets.drag), ("radiation_pressure", self.facets.sunlight)):
                if acts and getattr(self, name) is not None:
                    raise ValueError(f"{name} and facets would both act; leave one out")
        return self

    def acceleration(self, epochs: Epochs, position_m: np.ndarray, velocity_m_s: np.ndarray) -> np.ndarray:
        """Return the acceleration (time, 3) [m/s2] of states, central attraction included.

        Parameters
        ----------
        epochs : instants
        position_m, velocity_m_s : (time, 3) states in GCRS axes [m], [m/s]
        """
        field = self.field(epochs.start_utc)
        rows = zip(
            epochs.time_s.tolist(), np.asarray(position_m).tolist(), np.asarray(velocity_m_s).tolist(), strict=True
        )
        return np.array([field(t, tuple(r), tuple(v))[0] for t, r, v in rows]).reshape(-1, 3)

    def gravity(self, start_utc: datetime.datetime) -> Callable[..., tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Return the gravity of the Earth as a function of arrays of positions; its pole is that of the start.

        Parameters
        ----------
        start_utc : start of the run

        Returns
        -------
        function of the components x, y and z of positions [m], arrays of one shape, GCRS axes
            it returns those of the acceleration [m/s2]: the central attraction and the zonal harmonics
        """
        zonals = _ZONALS[: max(self.zonal_degree - 1, 0)]
        pole = _find_almanac(start_utc, sun=False, moon=False)(0.0)[0]

        def accelerate(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            """Compute the components of the acceleration [m/s2] from those of the position [m]."""
            square = x * x + y * y + z * z
            radius = np.sqrt(square)
            pull = -GM / (square * radius)
            more = _zonal_acceleration(zonals, (x, y, z), radius, pole) if zonals else (0.0, 0.0, 0.0)
            return pull * x + more[0], pull * y + more[1], pull * z + more[2]

        return accelerate

    def light_phase(self, start_utc: datetime.datetime) -> Callable[[float, Vector3], int] | None:
        """Return a function of time [s] and position [m] that changes at the edges of the shadow; None without sunlight.

        Parameters
        ----------
        start_utc : start of the run
        """
        if self.radiation_pressure is None and not (self.facets is not None and self.facets.sunlight):
            return None
        return functools.partial(_light_phase, _find_almanac(start_utc, sun=True, moon=self.moon))

    def field(self, start_utc: datetime.datetime) -> ForceField:
        """Return the acceleration as a function for an integrator.

        Parameters
        ----------
        start_utc : start of the run

        Returns
        -------
        function of seconds since the start, position [m] and velocity [m/s]
            its first value is the acceleration [m/s2]; its second is the magnitude [m/s2] of the forces with
            discontinuities: drag (rows of its table) and sunlight (shadow)
        """
        pressure, facets = self.radiation_pressure, self.facets
        if facets is not None:
            facets.check_known()
        lit = pressure is not None or facets is not None
        sky = _find_almanac(start_utc, sun=self.sun or lit, moon=self.moon)
        zonals, drag = _ZONALS[: max(self.zonal_degree - 1, 0)], self.drag
        needs_sky = bool(zonals or drag or lit or self.sun or self.moon)

        def acceleration(t: float, r: Vector3, v: Vector3) -> tuple[Vector3, float]:
            """Return the acceleration [m/s2] of a body, and the magnitude of its discontinuous part [m/s2].

            Parameters
            ----------
            t : time since the first epoch [s]
            r : position (3) [m]
            v : velocity (3) [m/s]
            """
            x, y, z = r
            radius = max(math.sqrt(x * x + y * y + z * z), _CORE_M)
            pull = -GM / (radius * radius * radius)
            total = (pull * x, pull * y, pull * z)
            if not needs_sky:
                return total, 0.0
            rough = 0.0
            pole, sun, moon = sky(t)
            if zonals:
                total = _add(total, _zonal_acceleration(zonals, r, radius, pole))
            if drag:
                push = _drag_acceleration(drag, r, radius, v, pole)
                total, rough = _add(total, push), math.hypot(*push)
            if pressure:
                push = _sunlight_acceleration(pressure, r, radius, sun)
                total, rough = _add(total, push), rough + math.hypot(*push)
            if facets:
                light = _find_light_pressure(r, radius, sun) if facets.sunlight else (0.0, 0.0, 0.0)
                air = _find_air_pressure(r, radius, v, pole) if facets.drag else (0.0, 0.0, 0.0)
                push = facets.accelerate(start_utc, t, r, v, light, air)
                total, rough = _add(total, push), rough + math.hypot(*push)
            if self.sun:
                total = _add(total, _third_body_acceleration(units.SUN_GM_M3_S2, r, sun))
            if self.moon:
                total = _add(total, _third_body_acceleration(units.MOON_GM_M3_S2, r, moon))
            return total, rough

        return acceleration


def _light_phase(sky: Almanac, time_s: float, r: Vector3) -> int:
    """Return 2 in full sunlight, 1 in the penumbra, 0 in the umbra, at a position [m]."""
    share = float(sunlit_fraction(np.array([r]), np.array([sky(time_s)[1]]))[0])
    return 2 if share >= 1.0 else 1 if share > 0.0 else 0


_find_almanac = functools.lru_cache(maxsize=8)(Almanac)  # a flight with guidance integrates hundreds of arcs of one run


def air_density_kg_m3(height_m: float) -> float:
    """Return the density of Vallado's mean exponential atmosphere (4th ed. table 8-4) [kg/m3], zero above 2500 km."""
    height_km = height_m / units.KM
    if height_km > 2500.0:
        return 0.0
    floor_km, density, scale_km = _AIR[max(bisect_right(_FLOORS_KM, height_km) - 1, 0)]
    return density * math.exp(-(max(height_km, 0.0) - floor_km) / scale_km)


def _zonal_acceleration(zonals: tuple[float, ...], r: Any, radius: Any, pole: Vector3) -> Any:
    """Return the acceleration by zonal harmonics [m/s2].

    GM/r^2 J_n (R/r)^n [P'_(n+1)(s) r^ - P'_n(s) k], s the sine of latitude: the gradient of -GM/r J_n (R/r)^n P_n(s)
    (Montenbruck & Gill eq. 3.27), with (n + 1) P_n + s P'_n = P'_(n+1).

    Parameters
    ----------
    zonals : J2 and on
    r, radius : position [m] and its length; components may be arrays of one shape
    pole : unit vector along the Earth's axis
    """
    s = (r[0] * pole[0] + r[1] * pole[1] + r[2] * pole[2]) / radius
    ratio = units.EARTH_ZONAL_RADIUS_M / radius
    before, here = s, 1.5 * s * s - 0.5  # P1, P2
    slope_before, slope = 1.0, 3.0 * s  # P1', P2'
    power = ratio
    outward = along = 0.0
    for n, j in enumerate(zonals, start=2):
        power *= ratio
        slope_next = slope_before + (2 * n + 1) * here
        outward += j * power * slope_next
        along += j * power * slope
        before, here = here, ((2 * n + 1) * s * here - n * before) / (n + 1)
        slope_before, slope = slope, slope_next
    g = GM / (radius * radius)
    out, up = g * outward / radius, -g * along
    return out * r[0] + up * pole[0], out * r[1] + up * pole[1], out * r[2] + up * pole[2]


def _drag_acceleration(drag: Drag, r: Vector3, radius: float, v: Vector3, pole: Vector3) -> Vector3:
    """Return the acceleration by drag [m/s2].

    Parameters
    ----------
    r, radius, v : position [m], its length, and velocity [m/s]
    pole : unit vector along the Earth's axis
    """
    x, y, z = _find_air_pressure(r, radius, v, pole)
    k = -drag.drag_coefficient * drag.area_m2 / drag.mass_kg
    return k * x, k * y, k * z


def _find_air_pressure(r: Vector3, radius: float, v: Vector3, pole: Vector3) -> Vector3:
    """Return the dynamic pressure of the air along the velocity through it [N/m2].

    The altitude above the ellipsoid is of first order in the flattening, within 50 m (Vallado eq. 8-28).

    Parameters
    ----------
    r, radius, v : position [m], its length, and velocity [m/s]
    pole : unit vector along the Earth's axis
    """
    s = (r[0] * pole[0] + r[1] * pole[1] + r[2] * pole[2]) / radius
    density = air_density_kg_m3(radius - units.EARTH_RADIUS_M * (1.0 - units.EARTH_FLATTENING * s * s))
    if density == 0.0:
        return 0.0, 0.0, 0.0
    w = units.EARTH_ROTATION_RAD_S
    x = v[0] - w * (pole[1] * r[2] - pole[2] * r[1])
    y = v[1] - w * (pole[2] * r[0] - pole[0] * r[2])
    z = v[2] - w * (pole[0] * r[1] - pole[1] * r[0])
    k = 0.5 * density * math.sqrt(x * x + y * y + z * z)
    return k * x, k * y, k * z


def _sunlight_acceleration(pressure: RadiationPressure, r: Vector3, radius: float, sun: Vector3) -> Vector3:
    """Return the acceleration by sunlight [m/s2] (Montenbruck & Gill eq. 3.75), with the conical shadow of the Earth.

    Parameters
    ----------
    r, radius : position [m] and its length
    sun : position of the Sun [m]
    """
    x, y, z = _find_light_pressure(r, radius, sun)
    k = -pressure.coefficient * pressure.area_m2 / pressure.mass_kg
    return k * x, k * y, k * z


def _find_light_pressure(r: Vector3, radius: float, sun: Vector3) -> Vector3:
    """Return the pressure of sunlight along the direction to the Sun [N/m2], with the conical shadow of the Earth.

    Parameters
    ----------
    r, radius : position [m] and its length
    sun : position of the Sun [m]
    """
    to_sun = (sun[0] - r[0], sun[1] - r[1], sun[2] - r[2])
    distance = math.sqrt(to_sun[0] ** 2 + to_sun[1] ** 2 + to_sun[2] ** 2)
    lit = 1.0
    ahead = (r[0] * to_sun[0] + r[1] * to_sun[1] + r[2] * to_sun[2]) / distance
    aside = math.sqrt(max(radius * radius - ahead * ahead, 0.0))
    # the penumbra widens by at most a hundredth of the distance behind the Earth
    if ahead < 0.1 * radius and aside < 1.01 * units.EARTH_RADIUS_M - 0.01 * ahead:
        lit = float(sunlit_fraction(np.array([r]), np.array([sun]))[0])
    k = lit * units.SOLAR_PRESSURE_N_M2 * (units.ASTRONOMICAL_UNIT_M / distance) ** 2 / distance
    return k * to_sun[0], k * to_sun[1], k * to_sun[2]


def find_pressures_n_m2(
    epochs: Epochs, position_m: np.ndarray, velocity_m_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the pressures of sunlight and of air on a body in orbit about the Earth, as vectors in GCRS axes.

    Parameters
    ----------
    epochs : instants
    position_m, velocity_m_s : (time, 3) states in GCRS axes [m], [m/s]

    Returns
    -------
    pressure of sunlight along the direction to the Sun (time, 3) [N/m2], and dynamic pressure of the air along the velocity
    through it (time, 3) [N/m2]
    """
    sky = _find_almanac(epochs.start_utc, sun=True, moon=False)
    light, air = np.empty((len(epochs), 3)), np.empty((len(epochs), 3))
    rows = zip(epochs.time_s.tolist(), position_m.tolist(), velocity_m_s.tolist(), strict=True)
    for k, (t, r, v) in enumerate(rows):
        pole, sun, _ = sky(t)
        light[k] = _find_light_pressure(r, math.hypot(*r), sun)
        air[k] = _find_air_pressure(r, math.hypot(*r), v, pole)
    return light, air


def _third_body_acceleration(gm: float, r: Vector3, body: Vector3) -> Vector3:
    """Return the tidal acceleration by a third body [m/s2]: at r, less that at the Earth (Montenbruck & Gill eq. 3.37).

    Parameters
    ----------
    gm : of the third body [m3/s2]
    r, body : positions of the spacecraft and the third body [m]
    """
    x, y, z = body[0] - r[0], body[1] - r[1], body[2] - r[2]
    near, far = x * x + y * y + z * z, body[0] ** 2 + body[1] ** 2 + body[2] ** 2
    a, b = gm / (near * math.sqrt(near)), gm / (far * math.sqrt(far))
    return a * x - b * body[0], a * y - b * body[1], a * z - b * body[2]


def _add(a: Vector3, b: Vector3) -> Vector3:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]
