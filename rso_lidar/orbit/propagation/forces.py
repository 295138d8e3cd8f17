"""Forces on a body about the Earth: its gravity, air drag, sunlight, Sun and Moon.

Zonal harmonics alone leave out the Earth's other harmonics: hundreds of metres to a kilometre in a day of a low orbit.
Always left out are tides, light from the Earth, and relativity (metres).
"""

from __future__ import annotations

import datetime
import functools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, SerializerFunctionWrapHandler, Strict, model_serializer, model_validator

from rso_lidar import units
from rso_lidar.orbit.earth.earth_fixed import find_earth_fixed_axes
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.propagation.atmosphere import Atmosphere, ExponentialAtmosphere
from rso_lidar.orbit.propagation.facet_model import FacetForces
from rso_lidar.orbit.propagation.gravity import Gravity
from rso_lidar.orbit.sky.almanac import Almanac, Vector3
from rso_lidar.orbit.sky.eclipse import sunlit_fraction
from rso_lidar.part import Flag, Part, Positive
from rso_lidar.shipped import find

GM = units.EARTH_GM_M3_S2
_ZONALS = (units.EARTH_J2, units.EARTH_J3, units.EARTH_J4, units.EARTH_J5, units.EARTH_J6)
_CORE_M = 0.5 * units.EARTH_RADIUS_M  # below this radius the attraction is held constant, because no orbit is there
ForceField = Callable[[float, Vector3, Vector3], tuple[Vector3, float]]
Attraction = Callable[[float, Vector3], Vector3]
FileStamps = tuple[tuple[Path, int, int], ...]  # path, modification time [ns], size [bytes]


class Drag(Part):
    """Air drag in an atmosphere that rotates with the Earth."""

    area_m2: Positive = Field(description="Cross-section in the flow [m²].")
    mass_kg: Positive = Field(description="Mass of the body [kg]; thrust does not change it here.")
    drag_coefficient: Positive = Field(default=2.2, description="Drag coefficient; 2.2 suits most satellites.")
    atmosphere: Atmosphere = Field(
        default=ExponentialAtmosphere(), description="Density of the air: an `exponential` table, or `nrlmsis`."
    )


class RadiationPressure(Part):
    """Pressure of sunlight on a sphere, in full light, penumbra or the Earth's shadow."""

    area_m2: Positive = Field(description="Cross-section in the sunlight [m²].")
    mass_kg: Positive = Field(description="Mass of the body [kg]; thrust does not change it here.")
    coefficient: Positive = Field(
        default=1.3,
        description="Radiation pressure coefficient: 1 for a black body, 2 for a flat mirror that faces the Sun.",
    )


class Forces(Part):
    """Forces besides the Earth's central attraction: its harmonics, drag, radiation pressure, Sun and Moon."""

    zonal_degree: Annotated[int, Strict(), Field(ge=0, le=6)] = Field(
        default=2,
        description="Highest degree of the zonal harmonics (EGM96) about the pole of date; 0 is a point mass.",
    )
    gravity: Gravity | None = Field(
        default=None,
        description=(
            "Gravity by harmonics of every order, which turn with the Earth and have a GM of their own. It takes the place "
            "of `zonal_degree`. If omitted, `zonal_degree` applies."
        ),
    )
    drag: Drag | None = Field(
        default=None,
        description="Drag in an atmosphere that rotates with the Earth. If omitted, there is none.",
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
        if self.gravity is not None and "zonal_degree" in self.model_fields_set:
            raise ValueError("gravity: takes the place of zonal_degree; leave zonal_degree out")
        if self.facets is not None:
            for name, acts in (("drag", self.facets.drag), ("radiation_pressure", self.facets.sunlight)):
                if acts and getattr(self, name) is not None:
                    raise ValueError(f"{name} and facets would both act; leave one out")
        return self

    @model_serializer(mode="wrap")
    def _leave_out_replaced(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Dump the fields without `zonal_degree` where `gravity` takes its place."""
        fields: dict[str, Any] = serialize(self)
        if self.gravity is not None:
            fields.pop("zonal_degree", None)
        return fields

    @property
    def _atmosphere(self) -> Atmosphere | None:
        """The air that acts, on a sphere or on facets; None where none does."""
        if self.drag is not None:
            return self.drag.atmosphere
        return self.facets.atmosphere if self.facets is not None and self.facets.drag else None

    @property
    def has_air(self) -> bool:
        """Whether air acts, on a sphere or on facets."""
        return self._atmosphere is not None

    def stamp_files(self) -> FileStamps:
        """Return path, modification time [ns] and size [bytes] of each file of the forces, as part of a cache's key.

        A file that is not there has no stamp: whoever reads it raises the error.
        """
        named = [] if self.gravity is None else [self.gravity.file, self.gravity.earth_orientation_file]
        named.append(getattr(self._atmosphere, "space_weather_file", None))
        places = [place for name in named if name is not None and (place := find(name)) is not None]
        return tuple((place, (status := place.stat()).st_mtime_ns, status.st_size) for place in places)

    def describe_gravity(self) -> str:
        """Describe the Earth's gravity in a few words; an empty text for a point mass."""
        if self.gravity is not None:
            return self.gravity.describe()
        return f"J2 to J{self.zonal_degree}" if self.zonal_degree > 2 else "J2" if self.zonal_degree else ""

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

    def attraction(self, start_utc: datetime.datetime) -> Callable[..., np.ndarray]:
        """Return the gravity of the Earth as a function of time and arrays of positions.

        Zonal harmonics have the pole of the start.

        Parameters
        ----------
        start_utc : start of the run

        Returns
        -------
        function of seconds since the start (a number or (point,)) and positions (3, point) [m] in GCRS axes
            it returns the accelerations (3, point) [m/s2]: the central attraction and the harmonics
        """
        if self.gravity is not None:
            return _attract_points(self.gravity, start_utc)
        zonals = _ZONALS[: max(self.zonal_degree - 1, 0)]
        pole = _find_almanac(start_utc, sun=False, moon=False)(0.0)[0]

        def accelerate(time_s: float | np.ndarray, r: np.ndarray) -> np.ndarray:
            square = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
            radius = np.sqrt(square)
            pull: np.ndarray = -GM / (square * radius) * r
            return pull + np.stack(_zonal_acceleration(zonals, r, radius, pole)) if zonals else pull

        return accelerate

    def phase(self, start_utc: datetime.datetime) -> Callable[[float, Vector3], tuple[int, int]] | None:
        """Return a function of time [s] and position [m] that changes where forces jump: at edges of the shadow, and
        where the atmosphere's data begin anew. None where there are no such instants.

        Parameters
        ----------
        start_utc : start of the run
        """
        lit = self.radiation_pressure is not None or (self.facets is not None and self.facets.sunlight)
        sky = _find_almanac(start_utc, sun=lit, moon=self.moon)
        air = self._atmosphere
        interval = None if air is None else air.interval_along(sky)
        if not lit and interval is None:
            return None
        return lambda t, r: (_light_phase(sky, t, r) if lit else 0, interval(t) if interval else 0)

    def field(self, start_utc: datetime.datetime) -> ForceField:
        """Return the acceleration as a function for an integrator.

        Parameters
        ----------
        start_utc : start of the run

        Returns
        -------
        function of seconds since the start, position [m] and velocity [m/s]
            its first value is the acceleration [m/s2]; its second is the magnitude [m/s2] of the forces with
            discontinuities: drag in rows of a table, and sunlight (shadow)
        """
        pressure, drag, facets = self.radiation_pressure, self.drag, self.facets
        if facets is not None:
            facets.check_known()
        sky = _find_almanac(start_utc, sun=self.sun or pressure is not None or facets is not None, moon=self.moon)
        zonals = _ZONALS[: max(self.zonal_degree - 1, 0)] if self.gravity is None else ()
        gm, perturb = (GM, None) if self.gravity is None else _perturb_earth_fixed(self.gravity, start_utc)
        needs_sky = bool(zonals or drag or pressure or facets or self.sun or self.moon)
        air = self._atmosphere
        density = None if air is None else air.density_along(sky)
        air_is_rough = air is not None and air.has_rows

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
            pull = -gm / (radius * radius * radius)
            total = (pull * x, pull * y, pull * z)
            if perturb is not None and radius > _CORE_M:
                total = _add(total, perturb(t, r))
            if not needs_sky:
                return total, 0.0
            rough = 0.0
            pole, sun, moon = sky(t)
            if zonals:
                total = _add(total, _zonal_acceleration(zonals, r, radius, pole))
            if drag and density:
                push = _drag_acceleration(drag, density(t, r), r, v, pole)
                total, rough = _add(total, push), math.hypot(*push) if air_is_rough else 0.0
            if pressure:
                push = _sunlight_acceleration(pressure, r, radius, sun)
                total, rough = _add(total, push), rough + math.hypot(*push)
            if facets:
                light = _find_light_pressure(r, radius, sun) if facets.sunlight else (0.0, 0.0, 0.0)
                flow = _find_air_pressure(density(t, r), r, v, pole) if facets.drag and density else (0.0, 0.0, 0.0)
                push = facets.accelerate(start_utc, t, r, v, light, flow)
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


def _perturb_earth_fixed(gravity: Gravity, start_utc: datetime.datetime) -> tuple[float, Attraction]:
    """Return GM [m3/s2] and the acceleration by harmonics [m/s2] as a function of time [s] and position [m]."""
    harmonics = gravity.load_harmonics()
    axes = find_earth_fixed_axes(start_utc, gravity.load_orientation())

    def perturb(time_s: float, r: Vector3) -> Vector3:
        x, y, z = axes(time_s)
        a, b, c = harmonics.perturb(
            x[0] * r[0] + x[1] * r[1] + x[2] * r[2],
            y[0] * r[0] + y[1] * r[1] + y[2] * r[2],
            z[0] * r[0] + z[1] * r[1] + z[2] * r[2],
        )
        return a * x[0] + b * y[0] + c * z[0], a * x[1] + b * y[1] + c * z[1], a * x[2] + b * y[2] + c * z[2]

    return harmonics.gm, perturb


def _attract_points(gravity: Gravity, start_utc: datetime.datetime) -> Callable[..., np.ndarray]:
    """Return the attraction as in `Forces.attraction`, by harmonics that turn with the Earth."""
    harmonics = gravity.load_harmonics()
    axes = find_earth_fixed_axes(start_utc, gravity.load_orientation())

    def accelerate(time_s: float | np.ndarray, r: np.ndarray) -> np.ndarray:
        turn = np.array([axes(t) for t in np.ravel(time_s).tolist()])  # (1 or point, 3, 3)
        fixed = np.einsum("pij,jp->pi", np.broadcast_to(turn, (r.shape[1], 3, 3)), r)
        more = np.einsum("pij,pi->jp", np.broadcast_to(turn, (r.shape[1], 3, 3)), harmonics.perturb_points(fixed))
        pulled: np.ndarray = more - harmonics.gm * r / np.sqrt((r * r).sum(axis=0)) ** 3
        return pulled

    return accelerate


def _zonal_acceleration(zonals: tuple[float, ...], r: Any, radius: Any, pole: Vector3) -> Any:
    """Return the acceleration by zonal harmonics [m/s2].

    GM/r^2 J_n (R/r)^n [P'_(n+1)(s) r^ - P'_n(s) k], s the sine of latitude: the gradient of -GM/r J_n (R/r)^n P_n(s)
    (Montenbruck & Gill eq. 3.27), with (n + 1) P_n + s P'_n = P'_(n+1).

    Parameters
    ----------
    zonals : J2 and on
    r, radius : position [m] and its length; components may be arrays of one shape
    pole : (3,) unit vector along the Earth's axis
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


def _drag_acceleration(drag: Drag, density: float, r: Vector3, v: Vector3, pole: Vector3) -> Vector3:
    """Return the acceleration by drag [m/s2].

    Parameters
    ----------
    density : of the air [kg/m3]
    r, v : position [m] and velocity [m/s]
    pole : (3,) unit vector along the Earth's axis
    """
    x, y, z = _find_air_pressure(density, r, v, pole)
    k = -drag.drag_coefficient * drag.area_m2 / drag.mass_kg
    return k * x, k * y, k * z


def _find_air_pressure(density: float, r: Vector3, v: Vector3, pole: Vector3) -> Vector3:
    """Return the dynamic pressure of the air along the velocity through it [N/m2].

    Parameters
    ----------
    density : of the air [kg/m3]
    r, v : position [m] and velocity [m/s]
    pole : (3,) unit vector along the Earth's axis
    """
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
    epochs: Epochs,
    position_m: np.ndarray,
    velocity_m_s: np.ndarray,
    atmosphere: Atmosphere = ExponentialAtmosphere(),  # noqa: B008 - a part is frozen
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the pressures of sunlight and of air on a body in orbit about the Earth, as vectors in GCRS axes.

    Parameters
    ----------
    epochs : instants
    position_m, velocity_m_s : (time, 3) states in GCRS axes [m], [m/s]
    atmosphere : density of the air

    Returns
    -------
    pressure of sunlight along the direction to the Sun (time, 3) [N/m2], and dynamic pressure of the air along the velocity
    through it (time, 3) [N/m2]
    """
    sky = _find_almanac(epochs.start_utc, sun=True, moon=False)
    density = atmosphere.density_along(sky)
    light, air = np.empty((len(epochs), 3)), np.empty((len(epochs), 3))
    rows = zip(epochs.time_s.tolist(), position_m.tolist(), velocity_m_s.tolist(), strict=True)
    for k, (t, r, v) in enumerate(rows):
        pole, sun, _ = sky(t)
        light[k] = _find_light_pressure(r, math.hypot(*r), sun)
        air[k] = _find_air_pressure(density(t, r), r, v, pole)
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
