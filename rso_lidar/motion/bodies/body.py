"""Bodies: a name, a motion, an attitude and extra axes."""

from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from rso_lidar.motion.attitudes.attitude_dynamics import StateSpaceAttitude
from rso_lidar.motion.attitudes.fmu_attitude import FmuAttitude
from rso_lidar.motion.attitudes.law import Law, refuse_bare_lvlh
from rso_lidar.motion.attitudes.situation import Attitude
from rso_lidar.motion.attitudes.slew import Slew
from rso_lidar.motion.attitudes.torqued import Torqued
from rso_lidar.motion.bodies.hinge import HingeAxes
from rso_lidar.motion.dynamics.commands import CommandedModel
from rso_lidar.motion.motions.motion import AnyMotion, has_orbit
from rso_lidar.motion.mount import Mount
from rso_lidar.part import Name, Part, Seam

RESERVED_AXES = ("inertial", "follower", "ptu", "lidar", "sun_direction")

DescribedAttitude = Annotated[
    Annotated[Law | Slew | Torqued | StateSpaceAttitude | FmuAttitude, Field(discriminator="type")],
    BeforeValidator(refuse_bare_lvlh),
]
AnyAttitude = Annotated[DescribedAttitude | Attitude, Seam(DescribedAttitude, Attitude)]


class Axes(Mount):
    """Further axes fixed to a body, such as those of a docking port; the mount gives their pose in body axes."""

    name: Name = Field(description="Name of these axes, by which others refer to them.")


class Body(Part):
    """A body that moves and turns: body axes x forward, y left, z up, origin in the centre of mass.

    Without an `attitude` a body follows the quaternions of its motion's table, if there are any. Otherwise its axes are
    inertial if it orbits, and those in which its motion is given if it does not.
    """

    name: Name = Field(
        description=(
            "Name of the body, by which others refer to it. `inertial`, `follower`, `ptu` and `lidar` are reserved."
        )
    )
    motion: AnyMotion = Field(description="Motion of the centre of mass.")
    attitude: AnyAttitude | None = Field(
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
        """Whether the body has an orbit, and therefore its own rtn axes."""
        return has_orbit(self.motion)

    @property
    def models(self) -> dict[str, CommandedModel]:
        """State-space models and FMUs of the body, by the names under which a `Command` gives them inputs."""
        moves, turns = (isinstance(part, CommandedModel) and part.is_commanded for part in (self.motion, self.attitude))
        named: dict[str, Any] = {self.name: self.motion} if moves else {}
        if turns:
            named[f"{self.name}.attitude" if moves else self.name] = self.attitude
        return named

    @property
    def joints(self) -> tuple[HingeAxes, ...]:
        """Hinges of the body; none unless a subclass has parts that turn."""
        return ()

    def joint_axes(self, joint: HingeAxes) -> str:
        """Return the name of the axes of a hinge, ``<body>.<hinge>``.

        Parameters
        ----------
        joint : a hinge of this body
        """
        return f"{self.name}.{joint.name}"

    @property
    def origin(self) -> str:
        """Name of the axes at the body's origin that do not turn with the body."""
        return f"{self.name}.rtn" if self.orbits else f"{self.name}.origin"
