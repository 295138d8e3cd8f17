"""The hinges of a target: what the scenario says of them, completed by what its model declares."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from rso_lidar.craft import Hinge
from rso_lidar.errors import ScenarioError, placed
from rso_lidar.motion.bodies.hinge import Angle, FollowSun, HingeAxes
from rso_lidar.part import Direction, Name, Part, Text, Vector
from rso_lidar.scene.meshes.mesh import body_from_mesh


class Joint(Part):
    """A hinge of a target: its `parts` turn about `axis` through `position_m`, both in body axes, right-handed.

    Its axes, named ``<body>.<name>``, have their origin at `position_m` and are the body's at angle zero. Where the model's
    index declares a hinge of that name, what is left out here comes from there; else parts and axis are needed, and the
    hinge stands in the body's origin unless `position_m` says where.
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
    angle: Angle = Field(description="Law of the hinge angle.")


@dataclass(frozen=True)
class ModelPlacement:
    """How a catalogue model lies in its body's axes: scale, centre of mass (xyz) [m] after scaling, and mesh axes."""

    scale: float
    center_of_mass_m: np.ndarray
    mesh_axes: str

    def point(self, position: tuple[float, float, float]) -> Vector:
        """Return a point of the model, in the mesh's own axes and unit, in body axes [m]."""
        x, y, z = body_from_mesh(self.scale * np.array(position) - self.center_of_mass_m, self.mesh_axes).tolist()
        return x, y, z

    def direction(self, direction: tuple[float, float, float]) -> Vector:
        """Return a direction of the model, in the mesh's own axes, in body axes."""
        x, y, z = body_from_mesh(np.array(direction), self.mesh_axes).tolist()
        return x, y, z


def complete_joint(
    joint: Joint,
    shape: str,
    declared: Mapping[str, Hinge] = MappingProxyType({}),
    placement: ModelPlacement | None = None,
) -> HingeAxes:
    """Return a hinge in body axes; what the joint leaves out comes from the hinge of its name that the model declares.

    Parameters
    ----------
    joint : what the scenario says of the hinge.
    shape : name of the model, for the message of an error.
    declared : the model's hinges by name.
    placement : how the model lies in body axes; needed where it declares hinges.
    """
    hinge, angle = declared.get(joint.name), joint.angle
    parts, position_m, axis = joint.parts, joint.position_m, joint.axis
    if hinge is not None and placement is not None:
        parts = parts or hinge.parts
        position_m = position_m or placement.point(hinge.position_m)
        axis = axis or placement.direction(hinge.axis)
        if isinstance(angle, FollowSun) and angle.normal is None and hinge.normal is not None:
            angle = FollowSun(normal=placement.direction(hinge.normal))
    with placed(f"joint {joint.name}"):
        if parts is None or axis is None:
            what = " and ".join(name for name, value in (("parts", parts), ("axis", axis)) if value is None)
            known = f" ({shape} has {', '.join(declared)})" if declared else ""
            raise ScenarioError(f"{what} missing, and the model declares no such hinge{known}; give what is missing")
        fields: dict[str, Any] = {"name": joint.name, "parts": parts, "axis": axis, "angle": angle}
        return HingeAxes(position_m=position_m or (0.0, 0.0, 0.0), **fields)
