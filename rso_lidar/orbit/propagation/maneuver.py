"""Maneuvers: impulses, which change the velocity instantaneously, and burns of finite duration.

Their axes apply at the instant itself: `rtn` (x radially outward, z along r x v, y = z x x), `vnc` (x along the velocity,
y along r x v, z = x x y, which is outward on a circle) or `inertial` (GCRS). A motion relative to another body also knows
`chief_rtn`: the rtn axes of that body, in which plans state their impulses.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.part import NotNegative, Part, Positive, Vector

Axes3 = Literal["rtn", "vnc", "inertial", "chief_rtn"]


class Impulse(Part):
    """Instantaneous change of velocity."""

    type: Literal["impulse"] = "impulse"
    at_s: NotNegative = Field(
        description="Time since `start_utc` [s]. An impulse at 0 changes the velocity that the motion starts with."
    )
    delta_v_m_s: Vector = Field(description="Change of velocity [m/s].")
    axes: Axes3 = Field(
        default="rtn",
        description=(
            "Axes of `delta_v_m_s` at that time. `rtn`: x radially outward, z along the orbit normal. `vnc`: x along "
            "the velocity, y along the orbit normal, z = x × y outward. `inertial`: GCRS. `chief_rtn`: the `rtn` axes of "
            "the body `relative_to`, for a motion that has one."
        ),
    )

    @property
    def size_m_s(self) -> float:
        """Delta-v [m/s]."""
        return math.hypot(*self.delta_v_m_s)

    @property
    def edges_s(self) -> tuple[float, ...]:
        """Instants at which velocity or acceleration is discontinuous [s]."""
        return (self.at_s,)

    def apply(self, state: np.ndarray, chief: np.ndarray | None = None) -> np.ndarray:
        """Return the state after the impulse.

        Parameters
        ----------
        state : (n,) a row that begins with position [m] and velocity [m/s]
        chief : (6,) the same of the chief at that time, for `chief_rtn`
        """
        after = np.array(state, dtype=float)
        values = (after if chief is None else chief).tolist()
        after[3:6] += rotate_to_inertial(self.delta_v_m_s, self.axes, values[:3], values[3:6])
        return after


class Burn(Part):
    """Burn of constant acceleration, or of constant thrust on a mass.

    With `isp_s` the mass decreases from `mass_kg` by thrust / (g0 isp) per second; without it the mass is constant. Thrust
    rises linearly during `rise_s` and falls linearly during `fall_s`, both within `duration_s`.
    """

    type: Literal["burn"] = "burn"
    from_s: NotNegative = Field(description="Start of the burn since `start_utc` [s].")
    duration_s: Positive = Field(description="Duration of the burn [s].")
    acceleration_m_s2: Vector | None = Field(
        default=None, description="Constant acceleration [m/s²]; give exactly one of this and `thrust_n`."
    )
    thrust_n: Vector | None = Field(
        default=None, description="Constant thrust on `mass_kg` [N]; give exactly one of this and `acceleration_m_s2`."
    )
    mass_kg: Positive | None = Field(default=None, description="Mass at ignition of this burn [kg].")
    isp_s: Positive | None = Field(
        default=None, description="Specific impulse, by which the mass decreases [s]. If omitted, the mass is constant."
    )
    axes: Axes3 = Field(
        default="rtn",
        description=(
            "Axes of the acceleration or thrust, as for an impulse. They rotate with the orbit during the burn."
        ),
    )
    rise_s: NotNegative = Field(default=0.0, description="Time in which thrust rises linearly at the start [s].")
    fall_s: NotNegative = Field(default=0.0, description="Time in which thrust falls linearly at the end [s].")

    @model_validator(mode="after")
    def _one_push(self) -> Self:
        if (self.acceleration_m_s2 is None) == (self.thrust_n is None):
            raise ValueError("needs exactly one of acceleration_m_s2 and thrust_n; give one of them")
        if (self.thrust_n is None) != (self.mass_kg is None):
            raise ValueError("mass_kg: belongs to thrust_n; give both, or neither")
        if self.isp_s is not None and self.thrust_n is None:
            raise ValueError("isp_s: belongs to thrust_n and mass_kg; give those, or leave it out")
        if self.rise_s + self.fall_s > self.duration_s:
            raise ValueError(
                f"rise_s: {self.rise_s:g} s of rise and {self.fall_s:g} s of fall are longer than the burn of "
                f"{self.duration_s:g} s; shorten them, or burn for longer"
            )
        if self.mass_kg is not None and self._flow_kg_s * self.full_thrust_s >= self.mass_kg:
            last = self.mass_kg / self._flow_kg_s
            raise ValueError(f"duration_s: all {self.mass_kg:g} kg are used up after {last:g} s; burn for less")
        return self

    @property
    def _flow_kg_s(self) -> float:
        if self.thrust_n is None or self.isp_s is None:
            return 0.0
        return math.hypot(*self.thrust_n) / (units.STANDARD_GRAVITY_M_S2 * self.isp_s)

    @property
    def until_s(self) -> float:
        """End of the burn since the start of the run [s]."""
        return self.from_s + self.duration_s

    @property
    def edges_s(self) -> tuple[float, ...]:
        """Instants at which the acceleration has a jump or a corner: begin, end of rise, begin of fall, end [s]."""
        corners = (self.from_s, self.from_s + self.rise_s, self.until_s - self.fall_s, self.until_s)
        return tuple(sorted(set(corners)))

    @property
    def full_thrust_s(self) -> float:
        """Duration at full thrust that gives the same impulse [s]."""
        return self.duration_s - 0.5 * (self.rise_s + self.fall_s)

    @property
    def size_m_s(self) -> float:
        """Delta-v [m/s], by Tsiolkovsky's equation where the mass decreases."""
        if self.acceleration_m_s2 is not None:
            return math.hypot(*self.acceleration_m_s2) * self.full_thrust_s
        assert self.thrust_n is not None
        assert self.mass_kg is not None
        if self.isp_s is None:
            return math.hypot(*self.thrust_n) / self.mass_kg * self.full_thrust_s
        left = 1.0 - self._flow_kg_s * self.full_thrust_s / self.mass_kg
        return -units.STANDARD_GRAVITY_M_S2 * self.isp_s * math.log(left)

    def acceleration(self, time_s: float, r: list[float], v: list[float]) -> tuple[float, float, float]:
        """Return the acceleration [m/s2] in inertial axes during the burn.

        Parameters
        ----------
        time_s : seconds since the start of the run
        r, v : position [m] and velocity [m/s] at that time, of the body whose axes these are
        """
        share, spent_s = self._throttle(min(max(time_s - self.from_s, 0.0), self.duration_s))
        if self.acceleration_m_s2 is not None:
            (x, y, z), mass = self.acceleration_m_s2, 1.0
        else:
            assert self.thrust_n is not None
            assert self.mass_kg is not None
            (x, y, z), mass = self.thrust_n, self.mass_kg - self._flow_kg_s * spent_s
        scale = share / mass
        return rotate_to_inertial((x * scale, y * scale, z * scale), self.axes, r, v)

    def _throttle(self, since_s: float) -> tuple[float, float]:
        """Return the share of full thrust, and the time at full thrust [s] that gives the impulse so far."""
        left_s = self.duration_s - since_s
        if since_s < self.rise_s:
            share = since_s / self.rise_s
            return share, 0.5 * since_s * share
        if left_s < self.fall_s:
            share = left_s / self.fall_s
            return share, self.full_thrust_s - 0.5 * left_s * share
        return 1.0, since_s - 0.5 * self.rise_s


def describe_late_maneuvers(maneuvers: Sequence[Impulse | Burn], end_s: float) -> list[str]:
    """Describe the maneuvers that come after the last frame.

    Parameters
    ----------
    maneuvers : impulses and burns
    end_s : time of the last frame [s]

    Returns
    -------
    list of str
        one line of advice; empty if there are none
    """
    late = [maneuver for maneuver in maneuvers if maneuver.edges_s[0] > end_s]
    if not late:
        return []
    return [f"{len(late)} of its {len(maneuvers)} maneuvers come after the last frame at {end_s:g} s; shift them"]


def rotate_to_inertial(vector: Vector, axes: Axes3, r: list[float], v: list[float]) -> tuple[float, float, float]:
    """Rotate a vector from the axes of a state to inertial axes.

    Parameters
    ----------
    vector : components in `axes`
    axes : "rtn", "vnc", "inertial" or "chief_rtn"
    r, v : position [m] and velocity [m/s] that define the axes; those of the chief for "chief_rtn"

    Returns
    -------
    components of the vector in inertial axes
    """
    if axes == "inertial":
        return vector
    h = (r[1] * v[2] - r[2] * v[1], r[2] * v[0] - r[0] * v[2], r[0] * v[1] - r[1] * v[0])
    first, second = (v, h) if axes == "vnc" else (r, h)
    x = _unit(first)
    normal = _unit(second)
    if axes != "vnc":  # x, y = z x x, z = normal
        y, z = _cross(normal, x), normal
    else:
        y, z = normal, _cross(x, normal)
    return (
        vector[0] * x[0] + vector[1] * y[0] + vector[2] * z[0],
        vector[0] * x[1] + vector[1] * y[1] + vector[2] * z[1],
        vector[0] * x[2] + vector[1] * y[2] + vector[2] * z[2],
    )


def _unit(a: list[float] | tuple[float, float, float]) -> tuple[float, float, float]:
    size = math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    return a[0] / size, a[1] / size, a[2] / size


def _cross(a: tuple[float, float, float], b: tuple[float, float, float]) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
