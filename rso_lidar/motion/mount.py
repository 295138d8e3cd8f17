"""Mounts: the constant pose of a PTU on the follower, of the lidar on the PTU, or of further axes on a body."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.part import Part, Quaternion, Vector
from rso_lidar.pose import Link, build_rotation, pose

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


class Mount(Part):
    """Constant pose of a child in the axes of its parent: parent_from_child."""

    position_m: Vector = Field(
        default=(0.0, 0.0, 0.0), description="Position of the child's origin in parent axes [m]."
    )
    quaternion_xyzw: Quaternion | None = Field(
        default=None, description="Unit quaternion parent_from_child; give at most one of this and `euler_zyx_deg`."
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
        """Rotation parent_from_child; the identity by default."""
        return build_rotation(self.quaternion_xyzw, self.euler_zyx_deg)

    @cached_property
    def link(self) -> Link:
        """Constant link of the child in its parent."""
        return Link.still(pose(np.asarray(self.position_m, dtype=float), self.rotation))
