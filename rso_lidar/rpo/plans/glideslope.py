"""Approach or retreat along any straight line by free arcs between equal times, with a commanded speed: the glideslope."""

from __future__ import annotations

import math
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.part import Flag, Positive, Vector
from rso_lidar.rpo.limits import Pieces
from rso_lidar.rpo.plans.operation import ProximityOperation
from rso_lidar.rpo.plans.plan import Plan
from rso_lidar.rpo.plans.two_impulse import plan_arcs

_UNIFORM = 1e-6  # difference of the speeds, over their size, below which the motion is uniform


class Glideslope(ProximityOperation):
    """A straight line flown by free arcs between `pulses` impulses at equal times, from rest at `from_m`.

    The commanded speed falls, or grows, linearly with the distance to go, from `initial_speed_m_s` to
    `final_speed_m_s`. Impulses are given on the line: from each place two-impulse guidance leads to the next (Hablani,
    Tapper & Dana-Bashian, J. Guid. Control Dyn. 25 (2002) 553). Between them the path bends off the line.
    """

    type: Literal["glideslope"] = "glideslope"
    from_m: Vector = Field(description="Initial position at rest, in the body's rtn axes [m].")
    to_m: Vector = Field(description="Position of arrival, in the body's rtn axes [m].")
    initial_speed_m_s: Positive = Field(description="Commanded speed along the line at its begin [m/s].")
    final_speed_m_s: Positive = Field(description="Commanded speed along the line at its end [m/s].")
    pulses: Pieces = Field(description="Number of free arcs, each begun by an impulse.")
    stop: Flag = Field(
        default=True,
        description="Whether a last impulse stops the craft, which then holds its position. If false, it flies on.",
    )

    @model_validator(mode="after")
    def _some_length(self) -> Self:
        if self.from_m == self.to_m:
            raise ValueError("to_m: is the same position as from_m, so the line has no length; change one of the two")
        return self

    @property
    def length_m(self) -> float:
        """Length of the line [m]."""
        return math.dist(self.from_m, self.to_m)

    @property
    def line_s(self) -> float:
        """Time of flight along the line [s]."""
        if self._is_uniform:
            return 2.0 * self.length_m / (self.initial_speed_m_s + self.final_speed_m_s)
        return math.log(self.final_speed_m_s / self.initial_speed_m_s) / self._slope_per_s

    def distance_to_go_m(self, time_s: np.ndarray) -> np.ndarray:
        """Return the commanded distance from the end of the line (time,) [m].

        Parameters
        ----------
        time_s : instants since the begin of the line (time,) [s]
        """
        if self._is_uniform:
            return self.length_m * (1.0 - time_s / self.line_s)
        slope = self._slope_per_s
        distance: np.ndarray = self.length_m * np.exp(slope * time_s) - self.final_speed_m_s / slope * np.expm1(
            slope * time_s
        )
        return distance

    @property
    def _slope_per_s(self) -> float:
        """Slope of the speed of closing over the distance to go [1/s], negative on an approach that slows down."""
        return (self.final_speed_m_s - self.initial_speed_m_s) / self.length_m

    @property
    def _is_uniform(self) -> bool:
        return abs(self.final_speed_m_s - self.initial_speed_m_s) <= _UNIFORM * self.final_speed_m_s

    def make_plan(self, mean_motion_rad_s: float) -> Plan:
        """Return the plan about a body of this mean motion [rad/s]."""
        start, end = np.array(self.from_m), np.array(self.to_m)
        times_s = np.linspace(0.0, self.line_s, self.pulses + 1)
        to_go = self.distance_to_go_m(times_s) / self.length_m
        to_go[0], to_go[-1] = 1.0, 0.0
        places = end + to_go[:, None] * (start - end)
        return plan_arcs(self.name, mean_motion_rad_s, times_s, places, self.stop)
