"""Orbits about the Moon: two-body motion about its centre, whose position a user's kernel of the JPL gives.

States are in GCRS axes from the Earth's centre, as everywhere. The Moon's own gravity field, the Earth and the Sun are left
out. In a low orbit the field changes the height of periapsis by kilometres within days. The Earth's attraction matters for
high orbits.
"""

from __future__ import annotations

import datetime
from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.errors import add_place
from rso_lidar.orbit.central_body import MOON, CentralBody
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.sky.jpl_ephemeris import JplEphemeris
from rso_lidar.orbit.two_body.kepler import ClassicalElements, check_start, propagate_two_body
from rso_lidar.part import Instant, Part, Text, Vector
from rso_lidar.records import BodyState

_MOON_DISTANCE_M = 384.4e6  # mean
_MOST_TIDE = 0.01  # share of the Moon's attraction, reached at 15,200 km, above which two-body motion is questioned


class MoonCentered(Part):
    """Base of motions about the Moon's centre, whose position and velocity come from a kernel."""

    central_body: ClassVar[CentralBody] = MOON

    if TYPE_CHECKING:  # a field of every subclass, at its own place among them
        epoch_utc: Instant

    kernel_file: Text | None = Field(
        default=None,
        description=(
            'Kernel of the JPL with the Moon (SPK, .bsp), such as "de440s.bsp"; required. None is shipped and nothing is '
            "downloaded."
        ),
    )

    @model_validator(mode="after")
    def _has_kernel(self) -> Self:
        if self.kernel_file is None:
            raise ValueError(
                "kernel_file: an orbit about the Moon needs the Moon's position; name a kernel of the JPL that you have "
                'fetched, such as kernel_file = "de440s.bsp"'
            )
        return self

    @property
    def kernel(self) -> JplEphemeris:
        """The kernel, opened."""
        with add_place("kernel_file"):
            return JplEphemeris(str(self.kernel_file))

    def check(self, start_utc: datetime.datetime) -> None:
        """Check that the kernel knows the Moon at the start; raise `ScenarioError` or `PropagationError` if not.

        Parameters
        ----------
        start_utc : start of the run
        """
        self.center_states(Epochs(start_utc, np.zeros(1)))

    def center_states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) of the Moon's centre in GCRS axes, without light time.

        Parameters
        ----------
        epochs : instants

        Raises
        ------
        PropagationError
            if epochs are outside the kernel; its `bad` masks them
        """
        kernel = self.kernel
        with add_place("kernel_file"):
            return kernel.states("moon", epochs)

    @abstractmethod
    def start_about_moon(self) -> BodyState:
        """Return the state (3,) about the Moon's centre at `epoch_utc`, in GCRS axes."""

    def states_about_moon(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) about the Moon's centre, in GCRS axes.

        Parameters
        ----------
        epochs : instants
        """
        start, since_s = self.start_about_moon(), epochs.since(self.epoch_utc)
        return BodyState(*propagate_two_body(start.position_m, start.velocity_m_s, since_s, MOON.gm_m3_s2))

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes from the Earth's centre."""
        about, moon = self.states_about_moon(epochs), self.center_states(epochs)
        return BodyState(about.position_m + moon.position_m, about.velocity_m_s + moon.velocity_m_s)

    def validity(self, epochs: Epochs) -> list[str]:
        """Return a sentence if the Earth's tide, which is left out, is more than 1 % of the Moon's attraction.

        Parameters
        ----------
        epochs : instants
        """
        position = self.states_about_moon(epochs).position_m
        farthest_m = float(np.sqrt(np.sum(position * position, axis=-1)).max(initial=0.0))
        tide = 2.0 * units.EARTH_GM_M3_S2 / units.MOON_GM_M3_S2 * (farthest_m / _MOON_DISTANCE_M) ** 3
        if tide <= _MOST_TIDE:
            return []
        return [
            f"it reaches {farthest_m / units.KM:.0f} km from the Moon, where the Earth's tide, which is left out, is "
            f"{tide:.0%} of the Moon's attraction; use an ephemeris of another tool"
        ]


class LunarKepler(MoonCentered, ClassicalElements):
    """Two-body motion about the Moon from osculating elements in axes parallel to GCRS at `epoch_utc`.

    Inclination and node refer to the Earth's equator of GCRS, not to the Moon's. The perigee is the point nearest to the
    Moon.
    """

    type: Literal["lunar_kepler"] = "lunar_kepler"

    def start_about_moon(self) -> BodyState:
        """Return the state (3,) about the Moon's centre at `epoch_utc`, in GCRS axes."""
        return self.at_epoch()


class LunarState(MoonCentered):
    """Two-body motion about the Moon from a position and a velocity relative to its centre at `epoch_utc`."""

    type: Literal["lunar_state"] = "lunar_state"
    epoch_utc: Instant = Field(description="Time at which the state applies.")
    position_m: Vector = Field(description="Position from the Moon's centre, in axes parallel to GCRS [m].")
    velocity_m_s: Vector = Field(description="Velocity relative to the Moon's centre, in those axes [m/s].")

    @model_validator(mode="after")
    def _in_space(self) -> Self:
        check_start(self.position_m, self.velocity_m_s, MOON)
        return self

    def start_about_moon(self) -> BodyState:
        """Return the state (3,) about the Moon's centre at `epoch_utc`, in GCRS axes."""
        return BodyState(np.array(self.position_m), np.array(self.velocity_m_s))
