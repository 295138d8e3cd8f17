"""Motions and attitudes by a user's own x' = f(t, x, u) (Fuller et al., eq. 6)."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from rso_lidar import units
from rso_lidar.errors import PropagationError, warn
from rso_lidar.motion.dynamics.flight import Flight, StateSpaceModel
from rso_lidar.part import UNIT_NORM_WITHIN, Name, Text

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

PLACE = 6  # entries of position and velocity
QUATERNION = "quaternion_xyzw"
NEAR_RAD = 1.0 * units.DEG  # of the singularity: the rates of two angles are over 57 times the body rate
SINGULAR_RAD = 1e-6


def _attitude_state(text: str) -> str:
    """Check the name of an attitude representation and return it."""
    found = re.fullmatch(r"euler_([xyz])([xyz])([xyz])_(?:rad|deg)", text)
    if text != QUATERNION and not (found and found[1] != found[2] != found[3]):
        raise ValueError(
            f"'{text}' names no attitude: write {QUATERNION}, or Euler angles with their order and unit such as "
            "euler_zyx_rad (intrinsic: about z, the new y, the new x)"
        )
    return text


AttitudeState = Annotated[Text, AfterValidator(_attitude_state)]


class StateSpace(StateSpaceModel):
    """Motion by a user's own dynamics: the state begins with position [m] and velocity [m/s].

    They are in `axes`: "inertial" (GCRS; f brings its own gravity), "local" (a root without an Earth) or "rtn", the
    rotating rtn axes of the body `relative_to`, the velocity as those axes see it. With `layout` "rigid_body" the state
    continues with the attitude axes_from_body, in the representation `attitude_state`, and the body rate [rad/s] in body
    axes. Further entries are the user's own.

    `attitude_state` is "quaternion_xyzw", normalised when read, or three intrinsic Euler angles with order and unit, such
    as "euler_zyx_rad" (as `euler_zyx_deg` elsewhere: about z, the new y, the new x). Three different axes are singular at a
    middle angle of +-90 degrees, x-y-x and the like at 0 and 180: within 1 degree of that there is a warning, within 1e-6
    rad an error.
    """

    type: Literal["state_space"] = "state_space"
    axes: Literal["inertial", "local", "rtn"] = Field(
        default="inertial",
        description=(
            "Axes of position and velocity in x: `inertial`, `local` (a world without an Earth), or `rtn` of "
            "`relative_to`."
        ),
    )
    relative_to: Name | None = Field(default=None, description="Body in whose rotating rtn axes x is given.")
    layout: Literal["translation", "rigid_body"] = Field(
        default="translation",
        description=(
            "Layout of x. `translation`: x starts with position and velocity; `rigid_body`: attitude and body rate "
            "follow them."
        ),
    )
    attitude_state: AttitudeState = Field(
        default=QUATERNION,
        description=(
            "Attitude parameters in x: `quaternion_xyzw`, or intrinsic Euler angles such as `euler_zyx_rad` or "
            "`euler_zxz_deg`."
        ),
    )

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if (self.axes == "rtn") != (self.relative_to is not None):
            raise ValueError('axes = "rtn" and relative_to belong together: give both, or neither')
        if not self.turns and self.attitude_state != QUATERNION:
            raise ValueError(
                'attitude_state: a translation has no attitude: set layout = "rigid_body", or leave it out'
            )
        needs = PLACE + (_width(self.attitude_state) + 3 if self.turns else 0)
        if len(self.initial_state) < needs:
            raise ValueError(
                f"initial_state: has {len(self.initial_state)} entries, a {self.layout} needs at least {needs}"
            )
        if self.turns:
            _possible(self.initial_state[PLACE:], self.attitude_state)
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
        return _turned(flight(time_s)[:, PLACE:], self.attitude_state, self.label, time_s)


class StateSpaceAttitude(StateSpaceModel):
    """Attitude by a user's own dynamics: the state begins with inertial_from_body in the representation `attitude_state`.

    The body rate [rad/s] in body axes follows; further entries are the user's own. `attitude_state` is "quaternion_xyzw",
    normalised when read, or Euler angles such as "euler_zyx_rad", as for the motion `state_space`.
    """

    type: Literal["state_space"] = "state_space"
    attitude_state: AttitudeState = Field(
        default=QUATERNION,
        description=(
            "Attitude parameters at the start of x: `quaternion_xyzw`, or intrinsic Euler angles such as "
            "`euler_zyx_rad`."
        ),
    )

    @model_validator(mode="after")
    def _whole(self) -> Self:
        needs = _width(self.attitude_state) + 3
        if len(self.initial_state) < needs:
            raise ValueError(
                f"initial_state: has {len(self.initial_state)} entries, an attitude needs at least {needs}"
            )
        _possible(self.initial_state, self.attitude_state)
        return self

    def orientation(self, flight: Flight, time_s: np.ndarray) -> tuple[Rotation, np.ndarray]:
        """Return inertial_from_body (time) and the body rates (time, 3) [rad/s]."""
        return _turned(flight(time_s), self.attitude_state, self.label, time_s)


def _width(attitude_state: str) -> int:
    """Return how many numbers represent the attitude."""
    return 4 if attitude_state == QUATERNION else 3


def _turned(state: np.ndarray, attitude_state: str, label: str, time_s: np.ndarray) -> tuple[Rotation, np.ndarray]:
    """Return axes_from_body (time) and the body rates (time, 3) of rows that begin with an attitude and its rate."""
    from scipy.spatial.transform import Rotation

    width = _width(attitude_state)
    numbers, rates = state[:, :width], state[:, width : width + 3]
    if attitude_state == QUATERNION:
        return Rotation.from_quat(numbers), rates
    order, angles = _angles(numbers, attitude_state)
    away = _from_singular_rad(angles, order)
    near = int(np.argmin(away)) if len(away) else 0
    where = "a middle angle of +-90 deg" if len(set(order)) == 3 else "a middle angle of 0 or 180 deg"
    if (away < SINGULAR_RAD).any():
        raise PropagationError(
            f"{label}: its Euler angles are singular ({order}: {where}) at time_s = {time_s[near]:g}; use another order, or "
            f"attitude_state = {QUATERNION}",
            away < SINGULAR_RAD,
        )
    if (away < NEAR_RAD).any():
        warn(
            f"{label}: its Euler angles come within {away[near] / units.DEG:.2g} deg of their singularity "
            f"({order}: {where}) at time_s = {time_s[near]:g}, where they change fast: use another order, or "
            f"attitude_state = {QUATERNION}"
        )
    return Rotation.from_euler(order.upper(), angles), rates


def _angles(numbers: np.ndarray, attitude_state: str) -> tuple[str, np.ndarray]:
    """Return the order of Euler angles, in small letters, and the angles (…, 3) [rad]."""
    _, order, unit = attitude_state.split("_")
    return order, numbers * (units.DEG if unit == "deg" else 1.0)


def _from_singular_rad(angles: np.ndarray, order: str) -> np.ndarray:
    """Return how far (…) [rad] the middle of Euler angles (…, 3) [rad] is from where the other two turn about one axis."""
    across = np.cos(angles[..., 1]) if len(set(order)) == 3 else np.sin(angles[..., 1])
    away: np.ndarray = np.abs(np.arcsin(np.clip(across, -1.0, 1.0)))
    return away


def _possible(state: tuple[float, ...], attitude_state: str) -> None:
    """Refuse an initial state whose first numbers are no valid attitude."""
    numbers = state[: _width(attitude_state)]
    if attitude_state == QUATERNION:
        norm = float(np.linalg.norm(numbers))
        if abs(norm - 1.0) > UNIT_NORM_WITHIN:
            raise ValueError(f"initial_state: its quaternion x, y, z, w has the norm {norm:.6g}, not 1: divide by it")
        return
    order, angles = _angles(np.array(numbers), attitude_state)
    if _from_singular_rad(angles, order) < SINGULAR_RAD:
        raise ValueError(
            f"initial_state: its Euler angles {order} begin where they are singular; use another order, or {QUATERNION}"
        )
