"""Laws by which values are drawn: each maps numbers from 0 to below 1, evenly distributed, to a value of a field.

A law says how many such numbers one value needs, so that the same laws serve pseudo-random and low-discrepancy points.
"""

from __future__ import annotations

import copy
import math
from abc import abstractmethod
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, Strict, model_validator

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.part import Direction, Number, Part, Positive, Whole

Bound = Number | Annotated[tuple[Number, ...], Field(min_length=1, max_length=16)]
_MOST_VALUES = 10_000


def _list_bounds(low: Bound, high: Bound) -> tuple[np.ndarray, np.ndarray]:
    """Return lower and upper bounds (component) of a law.

    Raises
    ------
    ValueError
        If their lengths differ, or a lower bound is not below its upper one.
    """
    lows, highs = np.atleast_1d(np.array(low, float)), np.atleast_1d(np.array(high, float))
    if len(lows) != len(highs):
        raise ValueError(f"low has {len(lows)} components and high {len(highs)}; give one bound of each for each")
    for lower, upper in zip(lows.tolist(), highs.tolist(), strict=True):
        if lower >= upper:
            raise ValueError(f"low ({lower:g}) is not below high ({upper:g}); exchange the two")
    return lows, highs


def _shorten(values: np.ndarray) -> list[float]:
    """Return values with the 12 digits that a TOML text shows."""
    return [float(f"{value:.12g}") for value in values.tolist()]


class _Law(Part):
    """How a value is drawn."""

    _DIMENSIONS: ClassVar[int] = 1

    @property
    def dimensions(self) -> int:
        """Count of even numbers that one value needs."""
        return self._DIMENSIONS

    @abstractmethod
    def at(self, share: np.ndarray) -> Any:
        """Return the value at a place of the unit cube.

        Parameters
        ----------
        share : (dimension), numbers from 0 to below 1
        """


class _Bounded(_Law):
    """A law of numbers between two bounds."""

    low: Bound = Field(description="Lowest value, in the unit of the field; for a vector, a list of one per component.")
    high: Bound = Field(description="Highest value, excluded; for a vector, a list of one per component.")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        _list_bounds(self.low, self.high)
        return self

    @property
    def dimensions(self) -> int:
        """Count of even numbers that one value needs."""
        return len(self.low) if isinstance(self.low, tuple) else 1

    def at(self, share: np.ndarray) -> Any:
        """Return the value at a place of the unit cube: a number, or a list of numbers."""
        values = _shorten(self.spread(share, *_list_bounds(self.low, self.high)))
        return values if isinstance(self.low, tuple) else values[0]

    def spread(self, share: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return the values (component) at `share`.

        Parameters
        ----------
        share : (component), from 0 to below 1
        low, high : (component) bounds
        """
        spread: np.ndarray = low + (high - low) * share
        return spread


class Uniform(_Bounded):
    """Uniform between two bounds, or in a box."""

    type: Literal["uniform"] = "uniform"


class _AboveZero(_Bounded):
    """A law of numbers between two bounds above 0."""

    type: str

    @model_validator(mode="after")
    def _positive(self) -> Self:
        least = np.min(self.low)
        if least <= 0.0:
            raise ValueError(f"a {self.type} law needs low above 0, not {least:g}")
        return self


class LogUniform(_AboveZero):
    """Uniform in the logarithm: each octave between the bounds is equally likely."""

    type: Literal["log_uniform"] = "log_uniform"

    def spread(self, share: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return the values (component) at `share`."""
        spread: np.ndarray = low * (high / low) ** share
        return spread


class PowerLaw(_AboveZero):
    """Power law of sizes, cut off at two bounds: the number of those larger than x is proportional to x^-exponent.

    The NASA Standard Breakup Model has the exponent 1.71 for fragments of collisions, and 1.6 for those of explosions.
    """

    type: Literal["power_law"] = "power_law"
    exponent: Positive = Field(description="Exponent of the cumulative number.")

    def spread(self, share: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return the values (component) at `share`."""
        least = (high / low) ** -self.exponent
        spread: np.ndarray = low * (1.0 - share * (1.0 - least)) ** (-1.0 / self.exponent)
        return spread


class Normal(_Bounded):
    """Normal distribution, cut off at two bounds."""

    type: Literal["normal"] = "normal"
    mean: Number = Field(description="Mean before the cut, in the unit of the field.")
    sigma: Positive = Field(description="Standard deviation before the cut, in the unit of the field.")

    @model_validator(mode="after")
    def _within(self) -> Self:
        lows, highs = _list_bounds(self.low, self.high)
        if np.any(lows > self.mean + 8.0 * self.sigma) or np.any(highs < self.mean - 8.0 * self.sigma):
            raise ValueError("low and high are over 8 sigma from the mean; no value would be between them")
        return self

    def spread(self, share: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return the values (component) at `share`."""
        from scipy.special import ndtr, ndtri

        below, above = ndtr((low - self.mean) / self.sigma), ndtr((high - self.mean) / self.sigma)
        drawn: np.ndarray = np.clip(self.mean + self.sigma * ndtri(below + (above - below) * share), low, high)
        return drawn


class WholeNumber(_Law):
    """Whole numbers between two bounds, all equally likely; for counts and for random seeds of shapes."""

    type: Literal["whole"] = "whole"
    low: Whole = Field(description="Lowest value.")
    high: Whole = Field(description="Highest value, included.")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.low > self.high:
            raise ValueError(f"low ({self.low}) is above high ({self.high}); exchange the two")
        if max(abs(self.low), abs(self.high)) >= 2**52:
            raise ValueError("low and high are below 2^52 in magnitude; take smaller ones")
        return self

    def at(self, share: np.ndarray) -> int:
        """Return the value at a place of the unit cube."""
        return self.low + int(share[0] * (self.high - self.low + 1))


class Choice(_Law):
    """One of several values: numbers, texts, lists or tables of the scenario."""

    type: Literal["choice"] = "choice"
    values: Annotated[tuple[Any, ...], Field(min_length=1, max_length=_MOST_VALUES)] = Field(
        description="The values, as the field of the scenario takes them."
    )
    weights: tuple[Positive, ...] = Field(
        default=(), description="Relative frequency of each value. If omitted, all are equally likely."
    )

    @model_validator(mode="after")
    def _one_each(self) -> Self:
        if self.weights and len(self.weights) != len(self.values):
            raise ValueError(f"{len(self.weights)} weights for {len(self.values)} values; give one for each")
        return self

    def at(self, share: np.ndarray) -> Any:
        """Return the value at a place of the unit cube."""
        weights = np.array(self.weights or [1.0] * len(self.values))
        ends = np.cumsum(weights) / weights.sum()
        chosen = min(int(np.searchsorted(ends, share[0], side="right")), len(self.values) - 1)
        return copy.deepcopy(self.values[chosen])  # a table that a later variable may change


class UniformRotation(_Law):
    """Uniform on SO(3): a unit quaternion x, y, z, w (Shoemake 1992, "Uniform random rotations", Graphics Gems III)."""

    _DIMENSIONS: ClassVar[int] = 3

    type: Literal["so3"] = "so3"

    def at(self, share: np.ndarray) -> list[float]:
        """Return the quaternion at a place of the unit cube."""
        first, second = math.sqrt(1.0 - share[0]), math.sqrt(share[0])
        a, b = 2.0 * math.pi * share[1], 2.0 * math.pi * share[2]
        quaternion = np.array([first * math.sin(a), first * math.cos(a), second * math.sin(b), second * math.cos(b)])
        return _shorten(quaternion if quaternion[3] >= 0.0 else -quaternion)


class UniformDirection(_Law):
    """Uniform on the sphere, or on a cap of it: a unit vector."""

    _DIMENSIONS: ClassVar[int] = 2

    type: Literal["direction"] = "direction"
    axis: Direction = Field(default=(0.0, 0.0, 1.0), description="Centre of the cap.")
    half_angle_deg: Annotated[float, Strict(), Field(gt=0, le=180)] = Field(
        default=180.0, description="Greatest angle from the axis [deg]; 180 is the whole sphere."
    )

    def at(self, share: np.ndarray) -> list[float]:
        """Return the unit vector at a place of the unit cube."""
        cosine = 1.0 - share[0] * (1.0 - math.cos(self.half_angle_deg * units.DEG))
        sine, around = math.sqrt(max(0.0, 1.0 - cosine * cosine)), 2.0 * math.pi * share[1]
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        across /= np.linalg.norm(across)
        other = np.cross(axis, across)
        return _shorten(cosine * axis + sine * (math.cos(around) * across + math.sin(around) * other))


class Shell(UniformDirection):
    """A position in a spherical shell, or in a cone of it: uniform in direction, and in volume, radius or its logarithm."""

    _DIMENSIONS: ClassVar[int] = 3

    type: Literal["shell"] = "shell"  # type: ignore[assignment]
    inner_m: Positive = Field(description="Inner radius [m].")
    outer_m: Positive = Field(description="Outer radius [m].")
    even_in: Literal["volume", "radius", "log_radius"] = Field(
        default="volume", description="In which measure of the radius positions are uniform."
    )

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.inner_m >= self.outer_m:
            raise ValueError(f"inner_m ({self.inner_m:g}) is not below outer_m ({self.outer_m:g}); exchange the two")
        return self

    def at(self, share: np.ndarray) -> list[float]:
        """Return the position [m] at a place of the unit cube."""
        inner, outer, s = self.inner_m, self.outer_m, float(share[2])
        if self.even_in == "volume":
            radius = (inner**3 + s * (outer**3 - inner**3)) ** (1.0 / 3.0)
        else:
            radius = inner + s * (outer - inner) if self.even_in == "radius" else inner * (outer / inner) ** s
        return _shorten(radius * np.array(super().at(share)))


Law = Annotated[
    Uniform | LogUniform | PowerLaw | Normal | WholeNumber | Choice | UniformRotation | UniformDirection | Shell,
    Field(discriminator="type"),
]
NumberLaw = Annotated[Uniform | LogUniform | PowerLaw | Normal | WholeNumber | Choice, Field(discriminator="type")]


def check_components(law: Any, count: int, place: str) -> None:
    """Check that a law draws a number, or a list of a given length.

    Parameters
    ----------
    count : of components that its field has; 1 is a number

    Raises
    ------
    ScenarioError
        If it draws something else.
    """
    drawn = law.values if isinstance(law, Choice) else (law.at(np.full(law.dimensions, 0.5)),)
    for value in drawn:
        length = len(value) if isinstance(value, list | tuple) else 1
        numbers = value if isinstance(value, list | tuple) else [value]
        if length != count or any(type(number) not in (int, float) or not math.isfinite(number) for number in numbers):
            needs = "a number" if count == 1 else f"{count} numbers"
            raise ScenarioError(f"{place}: draws {value!r:.60}, and the field needs {needs}; choose another law")


def check_range(law: Any) -> None:
    """Check that a law draws ranges: numbers above 0, so that no body is in the lidar or behind it.

    Raises
    ------
    ScenarioError
        If it draws something else.
    """
    check_components(law, 1, "range_m")
    least = min(law.values) if isinstance(law, Choice) else float(np.min(law.low))
    if least <= 0.0:
        raise ScenarioError(f"range_m: draws {least:g} m, and a range is above 0; raise its lower bound")
