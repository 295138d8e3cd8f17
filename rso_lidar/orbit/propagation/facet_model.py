"""Sunlight and air on a body by its facets: the settings, and the acceleration from a table at a known attitude."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from typing import Annotated, NoReturn, Self

import numpy as np
from pydantic import Field, PrivateAttr, Strict, model_validator

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.propagation.atmosphere import Atmosphere, ExponentialAtmosphere
from rso_lidar.part import Flag, Fraction, Part, Positive, Text
from rso_lidar.records import FacetTable

Vector3 = tuple[float, float, float]
# of the start, seconds since it, position [m] and velocity [m/s] in GCRS axes: the matrix (3, 3) gcrs_from_body
AttitudeAlong = Callable[[datetime.datetime, float, Vector3, Vector3], np.ndarray]
FindTable = Callable[[], FacetTable]


class Finish(Part):
    """What a surface does with sunlight, over the whole solar spectrum; the rest is reflected by Lambert's law."""

    absorbed: Fraction = Field(description="Share of sunlight that is absorbed: the solar absorptance.")
    specular: Fraction = Field(default=0.0, description="Share of sunlight that is reflected as by a mirror.")

    @model_validator(mode="after")
    def _shares(self) -> Self:
        if self.absorbed + self.specular > 1.0 + 1e-9:
            raise ValueError(
                f"absorbed and specular: their sum {self.absorbed + self.specular:.4g} exceeds 1; lower one of them"
            )
        return self

    @property
    def diffuse(self) -> float:
        """Share of sunlight that is reflected by Lambert's law."""
        return max(1.0 - self.absorbed - self.specular, 0.0)


class FacetModel(Part):
    """How sunlight and air act on the facets of a target, with the shadows of its own parts."""

    sunlight: Flag = Field(default=True, description="Whether sunlight acts.")
    drag: Flag = Field(default=True, description="Whether air acts.")
    finish: Finish | None = Field(
        default=None,
        description="Finish of all parts. If omitted, that of each part's material in the catalogue, else assumed.",
    )
    part_finishes: dict[Text, Finish] = Field(
        default_factory=dict, description="Finishes of named parts; they override the others."
    )
    reradiated: Fraction = Field(
        default=0.0,
        description="Share of the absorbed sunlight that the lit side gives off as heat at once, by Lambert's law.",
    )
    atmosphere: Atmosphere = Field(
        default=ExponentialAtmosphere(), description="Density of the air: an `exponential` table, or `nrlmsis`."
    )
    speed_ratio: Annotated[float, Strict(), Field(ge=1.0, le=100.0)] = Field(
        default=7.5,
        description="Speed through the air over the most probable thermal speed of its molecules; 7.5 suits 400 km.",
    )
    wall_temperature_ratio: Positive = Field(
        default=0.3, description="Temperature of the surface over that of the air; 0.3 is 300 K in air of 1000 K."
    )
    accommodation: Fraction = Field(
        default=0.93, description="Energy accommodation: the share of their surplus that molecules leave at the wall."
    )
    step_deg: Annotated[float, Strict(), Field(ge=1.0, le=30.0)] = Field(
        default=7.5, description="Angle between the directions of the table [deg]."
    )
    points: Annotated[int, Strict(), Field(ge=64, le=1_000_000)] = Field(
        default=4096, description="Number of points on the facets that are asked whether Sun or air reach them, about."
    )


class FacetForces(FacetModel):
    """Acceleration by sunlight and air on the facets of the target that moves, at its attitude."""

    mass_kg: Positive = Field(description="Mass of the body [kg]; thrust does not change it here.")
    _find_table: FindTable | None = PrivateAttr(default=None)
    _attitude: AttitudeAlong | None = PrivateAttr(default=None)

    def __eq__(self, other: object) -> bool:
        """Compare settings, table and attitude: the orbits of two that are equal are equal."""
        return (
            super().__eq__(other)
            and isinstance(other, FacetForces)
            and self._find_table == other._find_table
            and self._attitude == other._attitude
        )

    def __hash__(self) -> int:
        shown = tuple(sorted((name, finish) for name, finish in self.part_finishes.items()))
        values = (getattr(self, name) for name in self._names() if name != "part_finishes")
        return hash((type(self), shown, *values, self._find_table))

    def with_table(self, find_table: FindTable, attitude: AttitudeAlong) -> Self:
        """Return these forces for a body whose facets and attitude are known.

        Parameters
        ----------
        find_table : returns the loads on the body, over directions in its body axes; it is called when they are needed
        attitude : called with the start of the run, seconds since it, position [m] and velocity [m/s] in GCRS axes, it
            returns the matrix (3, 3) gcrs_from_body
        """
        known = self.replace()
        known._find_table, known._attitude = find_table, attitude
        return known

    def check_known(self) -> None:
        """Raise `ScenarioError` if no table is known."""
        if self._find_table is None:
            self._refuse()

    def _refuse(self) -> NoReturn:
        raise ScenarioError(
            "forces.facets: needs a target with a mesh that moves by 'numerical'; for other bodies and motions give drag "
            "and radiation_pressure"
        )

    def accelerate(
        self,
        start_utc: datetime.datetime,
        time_s: float,
        position_m: Vector3,
        velocity_m_s: Vector3,
        light_n_m2: Vector3,
        air_n_m2: Vector3,
    ) -> Vector3:
        """Compute the acceleration by sunlight and air.

        Parameters
        ----------
        start_utc : start of the run
        time_s : seconds since then
        position_m, velocity_m_s : state in GCRS axes [m], [m/s]
        light_n_m2 : pressure of sunlight along the direction to the Sun, GCRS axes [N/m2]
        air_n_m2 : dynamic pressure of the air along the velocity through it, GCRS axes [N/m2]

        Returns
        -------
        (3,) [m/s2] in GCRS axes

        Raises
        ------
        ScenarioError
            If no table is known, because the body has no mesh
        """
        if self._find_table is None or self._attitude is None:
            self._refuse()
        gcrs_from_body = self._attitude(start_utc, time_s, position_m, velocity_m_s)
        light = np.array(light_n_m2) @ gcrs_from_body if self.sunlight else np.zeros(3)
        air = np.array(air_n_m2) @ gcrs_from_body if self.drag else np.zeros(3)
        force, _ = find_load(self._find_table(), light, air)
        x, y, z = (gcrs_from_body @ force / self.mass_kg).tolist()
        return x, y, z


def find_load(table: FacetTable, light_n_m2: np.ndarray, air_n_m2: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute force and torque on a body from its table.

    Parameters
    ----------
    table : of the body
    light_n_m2 : (3,) pressure of sunlight along the direction to the Sun, in body axes [N/m2]; zero in the dark
    air_n_m2 : (3,) dynamic pressure along the velocity through the air, in body axes [N/m2]

    Returns
    -------
    force (3,) [N], and torque (3,) about the body's origin [N m], in body axes
    """
    force, torque = np.zeros(3), np.zeros(3)
    for pressure, find in ((light_n_m2, table.find_light_load), (air_n_m2, table.find_air_load)):
        size = float(np.sqrt(pressure @ pressure))
        if size > 0.0:
            area, volume = find(pressure / size)
            force += size * area
            torque += size * volume
    return force, torque
