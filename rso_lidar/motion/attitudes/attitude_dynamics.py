"""Attitude by user-defined dynamics x' = f(t, x, u) (Fuller et al., eq. 6)."""

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
)
from rso_lidar.motion.dynamics.commands import CommandedFlight
from rso_lidar.motion.dynamics.flight import StateSpaceModel

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


class StateSpaceAttitude(StateSpaceModel):
    """Attitude by user-defined dynamics.

    The state begins with inertial_from_body in the representation `attitude_state` and the body rate [rad/s] in body
    axes. Further entries are free. `attitude_state` is "quaternion_xyzw", normalised when read, or Euler angles such as
    "euler_zyx_rad", as for the motion `state_space`.
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
        needs = count_entries(self.attitude_state) + 3
        if len(self.initial_state) < needs:
            raise ValueError(
                f"initial_state: has {len(self.initial_state)} entries, an attitude needs at least {needs}"
            )
        check_attitude(self.initial_state, self.attitude_state)
        return self

    @property
    def body_rate_entries(self) -> slice | None:
        """Entries of the state that are the body's angular velocity."""
        first = count_entries(self.attitude_state)
        return slice(first, first + 3)

    def orientation(self, flight: CommandedFlight, time_s: np.ndarray) -> tuple[Rotation, np.ndarray]:
        """Integrate the attitude.

        Parameters
        ----------
        flight : of this model
        time_s : instants (time,) [s]

        Returns
        -------
        inertial_from_body (time), and the body rates (time, 3) [rad/s]
        """
        return attitude_from_state(flight(time_s), self.attitude_state, self.label, time_s)

    def orient(self, situation: Situation) -> Orientation:
        """Return the attitude in root axes."""
        return Orientation(*self.orientation(situation.flight_of(self), situation.epochs.time_s))
