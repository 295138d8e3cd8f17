"""Motions and attitudes by a user's own x' = f(t, x, u) (seed eq. 6)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, Self

import numpy as np
from pydantic import model_validator

from rso_lidar.motion.dynamics import Flight, StateSpaceModel
from rso_lidar.part import UNIT_NORM_WITHIN, Name

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

PLACE, RIGID = 6, 13  # entries of a state: position and velocity; and quaternion and body rate


class StateSpace(StateSpaceModel):
    """Motion by a user's own dynamics: the state begins with position [m] and velocity [m/s].

    They are in `axes`: "inertial" (GCRS; f brings its own gravity), "local" (a root without an Earth) or "rtn", the
    rotating rtn axes of the body `relative_to`, the velocity as those axes see it. With `layout` "rigid_body" the state
    goes on with the quaternion x, y, z, w of axes_from_body, which is normalised when read, and the body rate [rad/s] in
    body axes, and so turns the body too. Further entries are the user's own.
    """

    type: Literal["state_space"] = "state_space"
    axes: Literal["inertial", "local", "rtn"] = "inertial"
    relative_to: Name | None = None
    layout: Literal["translation", "rigid_body"] = "translation"

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if (self.axes == "rtn") != (self.relative_to is not None):
            raise ValueError('axes = "rtn" and relative_to belong together: give both, or neither')
        needs = RIGID if self.layout == "rigid_body" else PLACE
        if len(self.initial_state) < needs:
            raise ValueError(
                f"initial_state: has {len(self.initial_state)} entries, a {self.layout} needs at least {needs}"
            )
        if self.layout == "rigid_body":
            _unit(self.initial_state[PLACE : PLACE + 4])
        return self

    @property
    def turns(self) -> bool:
        """Return whether the state turns the body too."""
        return self.layout == "rigid_body"

    def place(self, flight: Flight, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (time, 3) in `axes`."""
        state = flight(time_s)
        return state[:, :3], state[:, 3:PLACE]

    def place_rates(self, flight: Flight, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives of position [m/s] and velocity [m/s2] (time, 3) in `axes`: what f says."""
        rates = flight.rates(time_s)
        return rates[:, :3], rates[:, 3:PLACE]

    def orientation(self, flight: Flight, time_s: np.ndarray) -> tuple[Rotation, np.ndarray]:
        """Return axes_from_body (time) and the body rates (time, 3) [rad/s] of a rigid body."""
        return _turned(flight(time_s)[:, PLACE:RIGID])


class StateSpaceAttitude(StateSpaceModel):
    """Attitude by a user's own dynamics: the state begins with the quaternion x, y, z, w of inertial_from_body.

    It is normalised when read. The body rate [rad/s] in body axes follows; further entries are the user's own.
    """

    type: Literal["state_space"] = "state_space"

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if len(self.initial_state) < RIGID - PLACE:
            raise ValueError(f"initial_state: has {len(self.initial_state)} entries, an attitude needs at least 7")
        _unit(self.initial_state[:4])
        return self

    def orientation(self, flight: Flight, time_s: np.ndarray) -> tuple[Rotation, np.ndarray]:
        """Return inertial_from_body (time) and the body rates (time, 3) [rad/s]."""
        return _turned(flight(time_s)[:, : RIGID - PLACE])


def _turned(state: np.ndarray) -> tuple[Rotation, np.ndarray]:
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(state[:, :4]), state[:, 4:7]


def _unit(quaternion: tuple[float, ...]) -> None:
    norm = float(np.linalg.norm(quaternion))
    if abs(norm - 1.0) > UNIT_NORM_WITHIN:
        raise ValueError(f"initial_state: its quaternion x, y, z, w has the norm {norm:.6g}, not 1: divide by it")
