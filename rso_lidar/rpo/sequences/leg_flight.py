"""The flight of one leg of a sequence, as the conditions that end it see it."""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import (
    Epochs,
    equator_axes,
    mean_from_osculating,
    osculating_from_mean,
    propagate_j2_secular,
    rtn_matrix,
    sun_position_m,
    sunlit_fraction,
)
from rso_lidar.pose import rotate_vectors
from rso_lidar.records import BodyState
from rso_lidar.rpo.plans.plan import Path
from rso_lidar.rpo.relative.relative_elements import rotate_to_equator


@dataclass(frozen=True, eq=False)
class SunOverChief:
    """The Sun in the rtn axes of a chief whose orbit is propagated with J2 from its state at the start.

    The axes are good to 0.01 degree a day, which is the error of the Sun's position too.

    Parameters
    ----------
    start_utc : instant of the state; None where the date is unknown
    chief : state of the chief then, (3,) inertial
    """

    start_utc: datetime.datetime | None
    chief: BodyState

    def direction(self, time_s: np.ndarray) -> np.ndarray:
        """Return unit vectors (time, 3) to the Sun in rtn axes, at seconds since the start."""
        there, sun_m = self._states(time_s)
        toward = sun_m - there.position_m
        axes, _ = rtn_matrix(there.position_m, there.velocity_m_s)
        unit: np.ndarray = toward / np.linalg.norm(toward, axis=1, keepdims=True)
        return rotate_vectors(np.swapaxes(axes, -1, -2), unit)

    def sunlit(self, time_s: np.ndarray) -> np.ndarray:
        """Return the visible fraction of the Sun's disc (time,) at the chief, at seconds since the start."""
        there, sun_m = self._states(time_s)
        return sunlit_fraction(there.position_m, sun_m)

    @cached_property
    def _mean_elements(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean elements (6,) of the chief at the start, and the rotation (3, 3) from their axes to GCRS."""
        assert self.start_utc is not None
        first = Epochs(self.start_utc, np.zeros(1))
        state = rotate_to_equator(self.chief, first)
        return mean_from_osculating(state.position_m, state.velocity_m_s), equator_axes(first)[0].T

    def _states(self, time_s: np.ndarray) -> tuple[BodyState, np.ndarray]:
        """Return the states of the chief and the positions of the Sun (time, 3), inertial."""
        if self.start_utc is None:
            raise ScenarioError("needs the date for the Sun; use plan(start_utc, chief) instead of make_plan")
        mean, back = self._mean_elements
        flown = osculating_from_mean(propagate_j2_secular(mean, np.asarray(time_s, dtype=float)))
        there = BodyState(*(rotate_vectors(back, vectors) for vectors in flown))
        return there, sun_position_m(Epochs(self.start_utc, time_s))


@dataclass(frozen=True, eq=False)
class LegFlight:
    """The path of a leg, from its own begin.

    Parameters
    ----------
    path : function of time since the begin of the leg (time,) [s] that returns position [m] and velocity [m/s] (time, 3)
    begin_s : begin of the leg since the start of the sequence [s]
    mean_motion_rad_s : mean motion of the body that is approached [rad/s]
    step_s : greatest step at which the path is sampled [s]
    sun : the Sun over that body
    """

    path: Path
    begin_s: float
    mean_motion_rad_s: float
    step_s: float
    sun: SunOverChief
