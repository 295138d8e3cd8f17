"""Bodies: a name, a motion, an attitude and extra axes; and in which order they must be worked out."""

from typing import Annotated

from pydantic import BeforeValidator, Field

from rso_lidar.motion.attitudes.law import Law, no_bare_lvlh
from rso_lidar.motion.attitudes.slew import Slew
from rso_lidar.motion.bodies.hinge import HingeAxes
from rso_lidar.motion.bodies.prescribed import Fixed, Table
from rso_lidar.motion.dynamics.state_space import StateSpace, StateSpaceAttitude
from rso_lidar.motion.mount import Mount
from rso_lidar.orbit import J2, Ephemeris, Kepler, Numerical, Omm, State, Tle
from rso_lidar.part import Name, Part
from rso_lidar.rpo import (
    Circumnavigation,
    CoElliptic,
    ForcedCircumnavigation,
    Hill,
    Hop,
    Lambert,
    Nonlinear,
    RBarApproach,
    RelativeElements,
    RelativeMotion,
    Rendezvous,
    SafetyEllipse,
    StationKeeping,
    Teardrop,
    VBarApproach,
    Waypoints,
    YamanakaAnkersen,
)

RESERVED = ("inertial", "follower", "ptu", "lidar", "sun_direction")


Orbit = Tle | Omm | Kepler | State | J2 | Numerical | Ephemeris
Relative = Hill | YamanakaAnkersen | RelativeElements | Nonlinear
Operation = (
    StationKeeping
    | VBarApproach
    | RBarApproach
    | Hop
    | CoElliptic
    | Circumnavigation
    | SafetyEllipse
    | Teardrop
    | ForcedCircumnavigation
    | Waypoints
    | Rendezvous
    | Lambert
)
Motion = Annotated[Orbit | Relative | Operation | StateSpace | Fixed | Table, Field(discriminator="type")]
Attitude = Annotated[
    Annotated[Law | Slew | StateSpaceAttitude, Field(discriminator="type")],
    BeforeValidator(no_bare_lvlh),
]


class Axes(Mount):
    """Further axes fixed to a body, such as a docking port: the mount says how they stand in body axes."""

    name: Name = Field(description="Name of these axes, by which others refer to them.")


class Body(Part):
    """Something that moves and turns: body axes x forward, y left, z up, origin in the centre of mass.

    Without an `attitude` an orbiting body keeps inertial axes, another the axes its motion is given in, or follows its
    table's quaternions.
    """

    name: Name = Field(
        description=(
            "Name of the body, by which others refer to it. `inertial`, `follower`, `ptu` and `lidar` are reserved."
        )
    )
    motion: Motion = Field(description="Motion of the centre of mass.")
    attitude: Attitude | None = Field(
        default=None,
        description=(
            "Attitude of the body. If omitted, its axes are those in which its motion is given, or the quaternions of "
            "its table apply."
        ),
    )
    axes: tuple[Axes, ...] = Field(
        default=(), description="Further axes fixed to the body, for `look_at`, `track` and `truth.pose`."
    )

    @property
    def orbits(self) -> bool:
        """Return whether the body has an orbit, and so rtn axes of its own."""
        if isinstance(self.motion, StateSpace):
            return self.motion.axes != "local"
        return isinstance(self.motion, Orbit | RelativeMotion)

    @property
    def joints(self) -> tuple[HingeAxes, ...]:
        """Return the hinges of the body; what has parts says which."""
        return ()

    def joint_axes(self, joint: HingeAxes) -> str:
        """Return the name of a hinge's axes."""
        return f"{self.name}.{joint.name}"

    @property
    def origin(self) -> str:
        """Return the name of the axes at the body's origin that do not turn with it."""
        return f"{self.name}.rtn" if self.orbits else f"{self.name}.origin"
