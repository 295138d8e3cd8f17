"""The hinges of a target: what the scenario says of them, completed by what its model declares."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from rso_lidar.craft import Hinge
from rso_lidar.errors import ScenarioError, placed
from rso_lidar.motion.joint import Angle, FollowSun, HingeAxes
from rso_lidar.part import Direction, Name, Part, Text, Vector
from rso_lidar.scene.library.catalogue import model
from rso_lidar.scene.meshes.mesh import body_from_mesh

if TYPE_CHECKING:
    from rso_lidar.scenario.tables.target import Target


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


def joints_of(target: Target) -> tuple[HingeAxes, ...]:
    """Return the hinges of a target in body axes, those that its model declares completed."""
    if not target.joint:
        return ()
    complete = target.is_path or target.library is not None  # a recording has written out what its library declared
    declared = {} if complete else {hinge.name: hinge for hinge in model(target.shape).hinges}
    return tuple(_completed(joint, declared, target) for joint in target.joint)


def _completed(joint: Joint, declared: dict[str, Hinge], target: Target) -> HingeAxes:
    """Return a joint with what it leaves out taken from the hinge of its name."""
    hinge, angle = declared.get(joint.name), joint.angle
    parts, position_m, axis = joint.parts, joint.position_m, joint.axis
    if hinge is not None:
        scale, center_of_mass_m = placed_as(target)
        place = body_from_mesh(scale * np.array(hinge.position_m) - center_of_mass_m, target.mesh_axes)
        parts = parts or hinge.parts
        position_m = position_m or (float(place[0]), float(place[1]), float(place[2]))
        axis = axis or _direction(hinge.axis, target)
        if isinstance(angle, FollowSun) and angle.normal is None and hinge.normal is not None:
            angle = FollowSun(normal=_direction(hinge.normal, target))
    with placed(f"joint {joint.name}"):
        if parts is None or axis is None:
            what = " and ".join(name for name, value in (("parts", parts), ("axis", axis)) if value is None)
            known = f" ({target.shape} has {', '.join(declared)})" if declared else ""
            raise ScenarioError(f"{what} missing, and the model declares no such hinge{known}; give what is missing")
        fields: dict[str, Any] = {"name": joint.name, "parts": parts, "axis": axis, "angle": angle}
        return HingeAxes(position_m=position_m or (0.0, 0.0, 0.0), **fields)


def _direction(direction: tuple[float, float, float], target: Target) -> tuple[float, float, float]:
    x, y, z = body_from_mesh(np.array(direction), target.mesh_axes).tolist()
    return x, y, z


def placed_as(target: Target) -> tuple[float, np.ndarray]:
    """Return scale and centre of mass (xyz) [m, after scaling] of a target whose model is in the catalogue."""
    entry = model(target.shape)
    scale = target.scale or (target.size_m / max(entry.size_m) if target.size_m else 1.0)
    center = target.center_of_mass_m
    return scale, np.array(center if center is not None else [scale * x for x in entry.center_of_mass_m])
