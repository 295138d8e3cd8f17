"""Attitudes that are constant in root, host or orbital axes.

Body axes are x forward, y left, z up. Body rates are relative to the reference axes, expressed in body axes.
The result at one epoch has the same bits whichever other epochs are requested.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.motion.attitudes.situation import Orientation, Situation
from rso_lidar.orbit import rtn_from_lvlh_ccsds
from rso_lidar.part import Part, Quaternion, Vector
from rso_lidar.pose import build_rotation, euler_zyx

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


class FixedAttitude(Part):
    """Constant attitude in the axes in which the body's motion is given: those of the root or of the host body."""

    type: Literal["fixed"] = "fixed"
    quaternion_xyzw: Quaternion | None = Field(
        default=None, description="Unit quaternion axes_from_body; give at most one of this and `euler_zyx_deg`."
    )
    euler_zyx_deg: Vector | None = Field(
        default=None,
        description=(
            "Intrinsic rotations about z, then the new y, then the new x [deg]; give at most one of this and "
            "`quaternion_xyzw`."
        ),
    )

    @model_validator(mode="after")
    def _one_rotation(self) -> Self:
        if self.quaternion_xyzw is not None and self.euler_zyx_deg is not None:
            raise ValueError("quaternion_xyzw and euler_zyx_deg both state the rotation; give one")
        return self

    @property
    def rotation(self) -> Rotation:
        """Rotation axes_from_body; the identity by default."""
        return build_rotation(self.quaternion_xyzw, self.euler_zyx_deg)

    def orientation(self, time_s: np.ndarray | float) -> tuple[Rotation, np.ndarray]:
        """Return the constant attitude axes_from_body, a single rotation, and zero body rates (…, 3) [rad/s].

        Parameters
        ----------
        time_s : instants (…) [s]
        """
        return self.rotation, np.zeros((*np.shape(time_s), 3))

    def orient(self, situation: Situation) -> Orientation:
        """Return the attitude: in root axes for a body that orbits, in host axes for any other."""
        return Orientation(*self.orientation(situation.epochs.time_s), in_origin=not situation.orbits)


class Rtn(Part):
    """Constant attitude in the body's own rtn axes (x radially out, z along r x v, y = z x x), by `euler_zyx_deg`."""

    needs_orbit: ClassVar[bool] = True
    type: Literal["rtn"] = "rtn"
    euler_zyx_deg: Vector = Field(
        default=(0.0, 0.0, 0.0),
        description=(
            "Intrinsic rotations from the rtn axes about z, new y, new x [deg]; [90, 0, 0] turns body +x along-track."
        ),
    )

    def rtn_from_body(self) -> Rotation:
        """Return the constant rotation of the body in its rtn axes.

        Examples
        --------
        >>> Rtn(euler_zyx_deg=(90, 0, 0)).rtn_from_body().apply([1, 0, 0]).round(12)  # body +x along-track
        array([0., 1., 0.])
        """
        return euler_zyx(self.euler_zyx_deg)

    def orient(self, situation: Situation) -> Orientation:
        """Return the attitude, constant in orbital axes."""
        return Orientation(self.rtn_from_body(), np.zeros(3), in_origin=True)


class LvlhCcsds(Part):
    """Constant attitude in the CCSDS LVLH axes (z to nadir, y along -(r x v), x = y x z), by `euler_zyx_deg`."""

    needs_orbit: ClassVar[bool] = True
    type: Literal["lvlh_ccsds"] = "lvlh_ccsds"
    euler_zyx_deg: Vector = Field(
        default=(0.0, 0.0, 0.0), description="Intrinsic rotations from the CCSDS axes about z, new y, new x [deg]."
    )

    def rtn_from_body(self) -> Rotation:
        """Return the constant rotation of the body in its rtn axes.

        Examples
        --------
        >>> LvlhCcsds().rtn_from_body().apply([0, 0, 1]).round(12) + 0.0  # body +z to nadir
        array([-1.,  0.,  0.])
        """
        return rtn_from_lvlh_ccsds() * euler_zyx(self.euler_zyx_deg)

    def orient(self, situation: Situation) -> Orientation:
        """Return the attitude, constant in orbital axes."""
        return Orientation(self.rtn_from_body(), np.zeros(3), in_origin=True)
