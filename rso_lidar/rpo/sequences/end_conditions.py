"""Conditions that end a leg of a sequence: a time, a range, an angle, the Sun, or passive safety."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import angle_rad, find_spans_below
from rso_lidar.part import Flag, Number, Part, Positive
from rso_lidar.rpo.limits import Duration, Wait
from rso_lidar.rpo.plans.plan import SAFE_REVOLUTIONS
from rso_lidar.rpo.relative.hill import clohessy_wiltshire
from rso_lidar.rpo.sequences.leg_flight import LegFlight

_WITHIN_S = 1e-3  # half width of the bracket about an instant that the search finds to 0.1 ms
_DRIFT_PER_REVOLUTION = 240  # samples of a drift before its least distance is refined
_AT_ONCE = 256  # drifts computed in one call
_SAME_TURN = 1e-9  # share of a turn within which a leg begins at the angle itself
_PLANES = {"radial_along": (0, 1), "radial_cross": (0, 2), "along_cross": (1, 2)}

Angle = Annotated[float, Field(strict=True, ge=0, le=180)]


class EndCondition(Part):
    """Base of conditions that end a leg: it ends at the first instant at which the condition holds."""

    @property
    def name(self) -> str:
        """Name of the condition: its `type`."""
        return str(type(self).model_fields["type"].default)

    @abstractmethod
    def margin(self, flight: LegFlight, time_s: np.ndarray) -> np.ndarray:
        """Return by how much the condition holds (time,), negative where it does not.

        Parameters
        ----------
        flight : path of the leg
        time_s : ascending instants since the begin of the leg (time,) [s]
        """

    def find_end_s(self, flight: LegFlight, until_s: float) -> float | None:
        """Find the first instant at which the condition holds.

        Parameters
        ----------
        flight : path of the leg
        until_s : end of the search since the begin of the leg [s]

        Returns
        -------
        instant since the begin of the leg [s], 0 if it holds there; None if it never holds
        """
        from scipy.optimize import brentq

        def lacking(time_s: np.ndarray) -> np.ndarray:
            return -self.margin(flight, time_s)

        spans = find_spans_below(lacking, 0.0, until_s, min(flight.step_s, max(until_s / 48.0, _WITHIN_S)))
        if not spans:
            return None
        begin_s = spans[0][0]
        if begin_s == -math.inf:
            return 0.0
        low, high = max(0.0, begin_s - _WITHIN_S), min(until_s, begin_s + _WITHIN_S)
        low_lacks, high_lacks = lacking(np.array([low, high]))
        if not low_lacks > 0.0 > high_lacks:
            return begin_s
        return float(brentq(lambda at_s: float(lacking(np.array([at_s]))[0]), low, high, xtol=1e-12, rtol=1e-14))


class AfterTime(EndCondition):
    """End of a leg after a time: of the leg itself, or since the start of the sequence."""

    type: Literal["time"] = "time"
    duration_s: Wait | None = Field(
        default=None, description="Time since the begin of the leg [s]; give exactly one of this and `at_s`."
    )
    at_s: Wait | None = Field(
        default=None, description="Time since the start of the sequence [s]; give exactly one of this and `duration_s`."
    )

    @model_validator(mode="after")
    def _one_time(self) -> Self:
        if (self.duration_s is None) == (self.at_s is None):
            raise ValueError("needs exactly one of duration_s and at_s; give one of them")
        return self

    def margin(self, flight: LegFlight, time_s: np.ndarray) -> np.ndarray:
        """Return the time since the end (time,) [s]; see `EndCondition`."""
        return time_s - self._length_s(flight)

    def find_end_s(self, flight: LegFlight, until_s: float) -> float | None:
        """Return the instant since the begin of the leg [s]; None if it is after the search; see `EndCondition`."""
        length_s = self._length_s(flight)
        if length_s < 0.0:
            raise ScenarioError(
                f"until.at_s: the leg begins at {flight.begin_s:.1f} s, after {self.at_s:g} s; give a later time, or "
                "shorten the legs before"
            )
        return length_s if length_s <= until_s * (1.0 + 1e-12) else None

    def _length_s(self, flight: LegFlight) -> float:
        return self.duration_s if self.duration_s is not None else (self.at_s or 0.0) - flight.begin_s


class _Bounds(EndCondition):
    """Base of conditions that a quantity is at most, or at least, some value."""

    def _check_one(self, most: float | None, least: float | None, unit: str) -> None:
        """Raise an error unless exactly one bound is given."""
        if (most is None) == (least is None):
            raise ValueError(f"needs exactly one of at_most_{unit} and at_least_{unit}; give one of them")


class AtRange(_Bounds):
    """End of a leg at a distance from the body's origin: as soon as it is at most, or at least, some value."""

    type: Literal["range"] = "range"
    at_most_m: Positive | None = Field(
        default=None, description="Distance that the path must come down to [m]; give exactly one of the two."
    )
    at_least_m: Positive | None = Field(
        default=None, description="Distance that the path must reach [m]; give exactly one of the two."
    )

    @model_validator(mode="after")
    def _one_bound(self) -> Self:
        self._check_one(self.at_most_m, self.at_least_m, "m")
        return self

    def margin(self, flight: LegFlight, time_s: np.ndarray) -> np.ndarray:
        """Return the distance on the side that is asked for (time,) [m]; see `EndCondition`."""
        position, _ = flight.path(time_s)
        distance: np.ndarray = np.sqrt(np.sum(position * position, axis=1))
        return distance - self.at_least_m if self.at_most_m is None else self.at_most_m - distance


class AtAngle(EndCondition):
    """End of a leg when the craft, as seen from the body, next passes a polar angle in a plane of the rtn axes.

    At a leg that begins at this angle, it ends after a whole turn.
    """

    type: Literal["angle"] = "angle"
    angle_deg: Number = Field(
        description=(
            "Polar angle [deg]. In the orbital plane 0 is above the body, 90 ahead on the V-bar, 180 below and 270 "
            "behind."
        )
    )
    plane: Literal["radial_along", "radial_cross", "along_cross"] = Field(
        default="radial_along",
        description="Plane of the angle, which is counted from its first axis toward its second one.",
    )

    def margin(self, flight: LegFlight, time_s: np.ndarray) -> np.ndarray:
        """Return the angle beyond the next passage (time,), in turns; see `EndCondition`."""
        last_s = float(np.max(time_s, initial=0.0))
        dense = np.linspace(0.0, last_s, max(2, math.ceil(last_s / flight.step_s) + 1))
        every, back = np.unique(np.concatenate([dense, time_s]), return_inverse=True)
        position, _ = flight.path(every)
        first, second = _PLANES[self.plane]
        turns = np.unwrap(np.arctan2(position[:, second], position[:, first])) / math.tau
        turns -= self.angle_deg / 360.0
        up, down = math.floor(turns[0] + _SAME_TURN) + 1, math.ceil(turns[0] - _SAME_TURN) - 1
        beyond: np.ndarray = np.maximum(turns - up, down - turns)[back[len(dense) :]]
        return beyond


class AtSunAngle(_Bounds):
    """End of a leg by the angle at the craft between its line of sight to the body and the Sun.

    At 180 degrees the Sun is behind the craft and the body is fully lit, at 0 the Sun is behind the body.
    """

    type: Literal["sun_angle"] = "sun_angle"
    at_most_deg: Angle | None = Field(
        default=None, description="Angle that it must come down to [deg]; give exactly one of the two."
    )
    at_least_deg: Angle | None = Field(
        default=None, description="Angle that it must reach [deg]; give exactly one of the two."
    )

    @model_validator(mode="after")
    def _one_bound(self) -> Self:
        self._check_one(self.at_most_deg, self.at_least_deg, "deg")
        return self

    def margin(self, flight: LegFlight, time_s: np.ndarray) -> np.ndarray:
        """Return the angle on the side that is asked for (time,) [rad]; see `EndCondition`."""
        position, _ = flight.path(time_s)
        sun_angle_rad = angle_rad(-position, flight.sun.direction(flight.begin_s + time_s))
        if self.at_most_deg is None:
            return sun_angle_rad - (self.at_least_deg or 0.0) * units.DEG
        return self.at_most_deg * units.DEG - sun_angle_rad


class InSunlight(EndCondition):
    """End of a leg when the body comes into full sunlight, or into the Earth's shadow."""

    type: Literal["sunlight"] = "sunlight"
    lit: Flag = Field(
        default=True,
        description="Whether the leg ends in full sunlight. If false, it ends when none of the Sun is visible.",
    )

    def margin(self, flight: LegFlight, time_s: np.ndarray) -> np.ndarray:
        """Return how far the body is in light or shadow (time,), as a share of the Sun's disc; see `EndCondition`."""
        visible = flight.sun.sunlit(flight.begin_s + time_s)
        return visible - (1.0 - 1e-9) if self.lit else 1e-9 - visible


class AtPassiveSafety(_Bounds):
    """End of a leg by its passive safety: the least distance to the body if thrust stops at that instant for good.

    The drift follows Clohessy-Wiltshire's equations.
    """

    type: Literal["passive_safety"] = "passive_safety"
    at_most_m: Positive | None = Field(
        default=None, description="Least distance that it must come down to [m]; give exactly one of the two."
    )
    at_least_m: Positive | None = Field(
        default=None, description="Least distance that it must reach [m]; give exactly one of the two."
    )
    horizon_s: Duration | None = Field(
        default=None, description="Time for which the drift is followed [s]. If omitted, two revolutions of the body."
    )

    @model_validator(mode="after")
    def _one_bound(self) -> Self:
        self._check_one(self.at_most_m, self.at_least_m, "m")
        return self

    def margin(self, flight: LegFlight, time_s: np.ndarray) -> np.ndarray:
        """Return the least distance on the side that is asked for (time,) [m]; see `EndCondition`."""
        position, velocity = flight.path(time_s)
        blocks = range(0, len(time_s), _AT_ONCE)
        least = np.concatenate(
            [self._least_m(flight, position[k : k + _AT_ONCE], velocity[k : k + _AT_ONCE]) for k in blocks]
        )
        return least - self.at_least_m if self.at_most_m is None else self.at_most_m - least

    def _least_m(self, flight: LegFlight, position_m: np.ndarray, velocity_m_s: np.ndarray) -> np.ndarray:
        """Return the least distance (time,) [m] of drifts that begin at states (time, 3)."""
        n = flight.mean_motion_rad_s
        revolution_s = math.tau / n
        horizon_s = self.horizon_s or SAFE_REVOLUTIONS * revolution_s
        count = max(48, math.ceil(_DRIFT_PER_REVOLUTION * horizon_s / revolution_s))
        drift = np.linspace(0.0, horizon_s, count + 1)
        away, _ = clohessy_wiltshire(position_m[:, None], velocity_m_s[:, None], drift, n)
        squared = np.sum(away * away, axis=-1)
        k = np.argmin(squared, axis=1)
        rows, inner = np.arange(len(k)), np.clip(k, 1, count - 1)
        before, here, after = (squared[rows, inner + step] for step in (-1, 0, 1))
        # the bottom of a parabola through the lowest sample and its neighbours
        curve = before - 2.0 * here + after
        slope = 0.5 * (after - before)
        ahead = np.clip(-slope / np.where(curve > 0.0, curve, np.inf), -1.0, 1.0)
        at_s = np.clip((inner + ahead) * drift[1], 0.0, horizon_s)
        away, _ = clohessy_wiltshire(position_m, velocity_m_s, at_s, n)
        refined = np.minimum(squared[rows, k], np.sum(away * away, axis=-1))
        least: np.ndarray = np.sqrt(refined)
        return least


Until = Annotated[
    AfterTime | AtRange | AtAngle | AtSunAngle | InSunlight | AtPassiveSafety, Field(discriminator="type")
]
