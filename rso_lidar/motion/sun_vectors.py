"""The position of the Sun during a run, and the fraction of it that is visible to a body."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs, sun_position_m, sunlit_fraction
from rso_lidar.records import BodyState


@dataclass(frozen=True, eq=False)
class SunVectors:
    """The Sun at some epochs, seen from the root's origin.

    Parameters
    ----------
    epochs : instants
    local : whether the world is local, without an Earth; it then has a Sun only if one is given
    given : direction to the Sun of a local world, of any length, in root axes; None where there is none
    """

    epochs: Epochs
    local: bool
    given: Sequence[float] | np.ndarray | None

    def __post_init__(self) -> None:
        if self.given is None:
            return
        if not self.local:
            raise ScenarioError(
                "sun_direction: in a world with an Earth, the date determines the Sun's position; leave it out"
            )
        direction = np.asarray(self.given, dtype=float)
        if direction.shape != (3,) or not 0.0 < np.linalg.norm(direction) < math.inf:
            raise ScenarioError("sun_direction: needs a vector of three finite numbers that are not all zero")

    @cached_property
    def position_m(self) -> np.ndarray | None:
        """Vectors (time, 3) from the root's origin to the Sun [m]; None without a Sun."""
        if not self.local:
            position_m = sun_position_m(self.epochs).view()
            position_m.setflags(write=False)  # a user's own attitude is given it
            return position_m
        if self.given is None:
            return None
        return np.broadcast_to(self._unit * units.ASTRONOMICAL_UNIT_M, (len(self.epochs), 3))

    @property
    def direction(self) -> np.ndarray:
        """Unit vectors (time, 3) from the root's origin to the Sun; NaN without one."""
        if self.position_m is None:
            return np.full((len(self.epochs), 3), np.nan)
        if self.given is not None:
            return np.broadcast_to(self._unit, self.position_m.shape)
        direction: np.ndarray = self.position_m / np.linalg.norm(self.position_m, axis=1, keepdims=True)
        return direction

    def visible_fraction(self, state: BodyState, moon: BodyState | None = None) -> np.ndarray:
        """Compute the fraction (time) of the Sun visible to a body; a local world has no eclipses.

        Parameters
        ----------
        moon : state of the Moon, for a body that orbits about it; for others its shadow is left out
        """
        if self.local or self.position_m is None:
            return np.ones(len(self.epochs))
        free = sunlit_fraction(state.position_m, self.position_m)
        if moon is None:
            return free
        beside = state.position_m - moon.position_m, self.position_m - moon.position_m
        both: np.ndarray = np.maximum(free + sunlit_fraction(*beside, units.MOON_RADIUS_M) - 1.0, 0.0)
        return both  # exact unless the disks of Earth and Moon overlap in front of the Sun

    @property
    def _unit(self) -> np.ndarray:
        given = np.asarray(self.given, dtype=float)
        unit: np.ndarray = given / np.linalg.norm(given)
        return unit
