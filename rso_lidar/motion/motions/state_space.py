"""Motion by user-defined dynamics x' = f(t, x, u) (Fuller et al., eq. 6)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.motion.attitudes.situation import Orientation, Situation
from rso_lidar.motion.dynamics.attitude_state import (
    QUATERNION,
    AttitudeState,
    attitude_from_state,
    check_attitude,
    count_entries,
    matrix_from_state,
)
from rso_lidar.motion.dynamics.commands import CommandedFlight
from rso_lidar.motion.dynamics.flight import Flight, StateSpaceModel
from rso_lidar.motion.motions.placement import Place, PlacedMotion
from rso_lidar.orbit import Epochs
from rso_lidar.part import Name
from rso_lidar.pose import rotate_vectors

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

PLACE = 6  # number of entries of position and velocity


class StateSpace(StateSpaceModel, PlacedMotion):
    """Motion by user-defined dynamics: the state begins with position [m] and velocity [m/s].

    Both are in `axes`: "inertial" (GCRS; f includes gravity), "local" (a root without an Earth) or "rtn". The last are
    the rotating rtn axes of the body `relative_to`, and the velocity is relative to them. With `layout` "rigid_body"
    the state continues with the attitude axes_from_body, in the representation `attitude_state`, and the body rate
    [rad/s] in body axes. Further entries are free.

    `attitude_state` is "quaternion_xyzw", normalised when read, or three intrinsic Euler angles with order and unit.
    "euler_zyx_rad" means rotations about z, the new y and the new x. Angles about three different axes are singular at
    a middle angle of +-90 degrees, and angles such as x-y-x at 0 and 180 degrees. Within 1 degree of a singularity
    there is a warning, within 1e-6 rad an error.
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
            raise ValueError('axes = "rtn" and relative_to belong together; give both, or neither')
        if not self.turns and self.attitude_state != QUATERNION:
            raise ValueError(
                'attitude_state: a translation has no attitude; set layout = "rigid_body", or leave it out'
            )
        needs = PLACE + (count_entries(self.attitude_state) + 3 if self.turns else 0)
        if len(self.initial_state) < needs:
            raise ValueError(
                f"initial_state: has {len(self.initial_state)} entries, a {self.layout} needs at least {needs}"
            )
        if self.turns:
            check_attitude(self.initial_state[PLACE:], self.attitude_state)
        return self

    @property
    def turns(self) -> bool:
        """Whether the state includes the attitude of the body."""
        return self.layout == "rigid_body"

    @property
    def body_rate_entries(self) -> slice | None:
        """Entries of the state that are the body's angular velocity; None for a translation."""
        first = PLACE + count_entries(self.attitude_state)
        return slice(first, first + 3) if self.turns else None

    @property
    def orbits(self) -> bool:
        """Whether the body has an orbit, and therefore rtn axes."""
        return self.axes != "local"

    def place(self, epochs: Epochs, flight: CommandedFlight | None) -> Place:
        """Integrate position and velocity in `axes`. For an orbit the result includes their rates, which f gives."""
        assert isinstance(flight, Flight)
        state = flight(epochs.time_s)
        rates = flight.rates(epochs.time_s) if self.orbits else None
        known = None if rates is None else (rates[:, :3], rates[:, 3:PLACE])
        return Place(state[:, :3], state[:, 3:PLACE], known)

    def breaks_s(self, epochs: Epochs) -> np.ndarray:
        """Return the start of the run (1,) [s], because user-defined dynamics have no state before it.

        Parameters
        ----------
        epochs : not used
        """
        return np.zeros(1)

    def orient(self, situation: Situation) -> Orientation | None:
        """Return the attitude of a rigid body in root axes; a translation has none."""
        if not self.turns:
            return None
        rotation, rate = self.orientation(situation.flight_of(self), situation.epochs.time_s)
        if self.relative_to is None:
            return Orientation(rotation, rate)
        chief = situation.origin_of(self.relative_to)
        return Orientation(
            chief.rotation * rotation, rate + rotate_vectors(rotation.inv(), chief.angular_velocity_rad_s)
        )

    def orientation(self, flight: CommandedFlight, time_s: np.ndarray) -> tuple[Rotation, np.ndarray]:
        """Integrate the attitude of a rigid body.

        Parameters
        ----------
        flight : of this model
        time_s : instants (time,) [s]

        Returns
        -------
        axes_from_body (time), and the body rates (time, 3) [rad/s]
        """
        return attitude_from_state(flight(time_s)[:, PLACE:], self.attitude_state, self.label, time_s)

    def find_matrices(self, flight: CommandedFlight, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Integrate the attitude of a rigid body.

        Parameters
        ----------
        flight : of this model
        time_s : instants (time,) [s]

        Returns
        -------
        axes_from_body (time, 3, 3), and the body rates (time, 3) [rad/s]
        """
        return matrix_from_state(flight(time_s)[:, PLACE:], self.attitude_state, self.label, time_s)
