"""Hinges of a target, completed by what its model declares."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from rso_lidar.errors import ScenarioError, add_place
from rso_lidar.motion import HingeAngle, HingeAxes
from rso_lidar.part import Direction, Name, Part, Text, Vector
from rso_lidar.records import Hinge
from rso_lidar.scene import body_from_mesh


class Joint(Part):
    """A hinge of a target: its `parts` turn right-handed about `axis` through `position_m`, both in body axes.

    Its axes, named ``<body>.<name>``, have their origin at `position_m` and coincide with the body's at angle zero. Fields
    that are left out come from the hinge of that name in the model's index. Without such a hinge, parts and axis are
    required, and the position defaults to the body's origin.
    """

    name: Name = Field(description="Name of the hinge; its axes are `<target>.<name>`.")
    parts: Annotated[tuple[Text, ...], Field(min_length=1)] | None = Field(
        default=None,
        description=(
            "Names of the model's parts that turn with the hinge. If omitted, those of the model's hinge of that name."
        ),
    )
    position_m: Vector | None = Field(
        default=None,
        description=(
            "A point on the hinge line in body axes, which is the origin of the hinge's axes [m]. If omitted, the "
            "model's, or the body's origin."
        ),
    )
    axis: Direction | None = Field(
        default=None,
        description=(
            "Direction of the hinge line in body axes, of any length; rotation is right-handed. If omitted, the "
            "model's."
        ),
    )
    angle: HingeAngle = Field(description="Law of the hinge angle.")


@dataclass(frozen=True)
class ModelPlacement:
    """Placement of a catalogue model in body axes: scale, centre of mass (xyz) [m] after scaling, and mesh axes."""

    scale: float
    center_of_mass_m: np.ndarray
    mesh_axes: str

    def point(self, position: tuple[float, float, float]) -> Vector:
        """Convert a point in the mesh's axes and unit to body axes [m]."""
        x, y, z = body_from_mesh(self.scale * np.array(position) - self.center_of_mass_m, self.mesh_axes).tolist()
        return x, y, z

    def direction(self, direction: tuple[float, float, float]) -> Vector:
        """Convert a direction in the mesh's axes to body axes."""
        x, y, z = body_from_mesh(np.array(direction), self.mesh_axes).tolist()
        return x, y, z


def complete_joint(
    joint: Joint,
    shape: str,
    declared: Mapping[str, Hinge] = MappingProxyType({}),
    placement: ModelPlacement | None = None,
) -> HingeAxes:
    """Complete a hinge in body axes: fields that the joint leaves out come from the model's hinge of the same name.

    Parameters
    ----------
    placement : of the model in body axes; required where it declares hinges
    """
    hinge, angle = declared.get(joint.name), joint.angle
    parts, position_m, axis = joint.parts, joint.position_m, joint.axis
    if hinge is not None and placement is not None:
        parts = parts or hinge.parts
        position_m = position_m or placement.point(hinge.position_m)
        axis = axis or placement.direction(hinge.axis)
        angle = angle.complete(None if hinge.normal is None else placement.direction(hinge.normal))
    with add_place(f"joint {joint.name}"):
        if parts is None or axis is None:
            what = " and ".join(name for name, value in (("parts", parts), ("axis", axis)) if value is None)
            known = f" ({shape} has {', '.join(declared)})" if declared else ""
            raise ScenarioError(f"{what} missing, and the model declares no such hinge{known}; give what is missing")
        fields: dict[str, Any] = {"name": joint.name, "parts": parts, "axis": axis, "angle": angle}
        return HingeAxes(position_m=position_m or (0.0, 0.0, 0.0), **fields)
