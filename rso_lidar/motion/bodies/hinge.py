"""Hinges: parts of a body that turn in its axes, such as a solar array that follows the Sun."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.part import Direction, Name, NotNegative, Number, Part, Text, Vector
from rso_lidar.pose import Link, cross, dot, rotate_vectors

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


class _AngleLaw(Part):
    """Base of all laws of a hinge angle."""

    follows_sun: ClassVar[bool] = False

    @property
    def turns(self) -> bool:
        """Whether the angle changes."""
        return True

    def complete(self, normal: Vector | None) -> Self:
        """Complete the law by what the model's index declares for the hinge.

        Parameters
        ----------
        normal : normal of the model's hinge in body axes; None if the model has none

        Returns
        -------
        the law with this normal, if it needs one and has none; otherwise itself
        """
        return self


class FixedAngle(_AngleLaw):
    """A hinge at a fixed angle, or one that turns from it at a constant rate."""

    type: Literal["fixed"] = "fixed"
    angle_deg: Number = Field(default=0.0, description="Hinge angle at `start_utc` [deg].")
    rate_deg_s: Number = Field(default=0.0, description="Constant rate of the hinge angle [deg/s].")

    @property
    def turns(self) -> bool:
        """Whether the angle changes."""
        return self.rate_deg_s != 0.0


class FollowSun(_AngleLaw):
    """A hinge that turns `normal` (body axes, at angle zero) as close to the Sun as its axis allows, also in eclipse.

    If the Sun is along the axis, the angle is undetermined and the hinge is at zero. `normal` may be left out if the
    model's index declares one for this hinge.
    """

    follows_sun: ClassVar[bool] = True
    type: Literal["follow_sun"] = "follow_sun"
    normal: Direction | None = Field(
        default=None,
        description=(
            "Direction, in body axes at angle zero, that is turned as close to the Sun as the axis allows. If "
            "omitted, the model's."
        ),
    )

    def complete(self, normal: Vector | None) -> Self:
        """Take the normal of the model's hinge [body axes] unless there is one already."""
        return self if normal is None or self.normal is not None else self.replace(normal=normal)


class PlannedAngle(_AngleLaw):
    """A hinge that interpolates planned angles linearly, and does not move before the first or after the last."""

    type: Literal["planned"] = "planned"
    time_s: tuple[NotNegative, ...] = Field(
        description="Times since `start_utc`, ascending [s]; outside them the hinge does not move."
    )
    angle_deg: tuple[Number, ...] = Field(description="Hinge angle at each time [deg]; interpolation is linear.")

    @model_validator(mode="after")
    def _check_pairs(self) -> Self:
        if len(self.time_s) != len(self.angle_deg) or not self.time_s:
            raise ValueError(
                "time_s and angle_deg: must have the same number of entries, at least one; add those missing"
            )
        if any(after <= before for before, after in zip(self.time_s, self.time_s[1:], strict=False)):
            raise ValueError("time_s: must ascend; sort it")
        return self


HingeAngle = Annotated[FixedAngle | FollowSun | PlannedAngle, Field(discriminator="type")]


class HingeAxes(Part):
    """A hinge of a body: its `parts` turn right-handed about `axis` through `position_m`, both in body axes.

    The axes of the hinge, named ``<body>.<name>``, have their origin at `position_m`. At angle zero they are parallel
    to the body axes.
    """

    name: Name = Field(description="Name of the hinge; its axes are `<body>.<name>`.")
    parts: Annotated[tuple[Text, ...], Field(min_length=1)] = Field(
        description="Names of the parts that turn with the hinge."
    )
    position_m: Vector = Field(
        default=(0.0, 0.0, 0.0),
        description="A point on the hinge line, in body axes [m]; it is the origin of the hinge's axes.",
    )
    axis: Direction = Field(
        description="Direction of the hinge line, in body axes, of any length; rotation is right-handed."
    )
    angle: HingeAngle = Field(description="Law of the hinge angle.")

    @model_validator(mode="after")
    def _check_name_and_normal(self) -> Self:
        if self.name in ("rtn", "origin"):
            raise ValueError(f"name: '{self.name}' is the name of a body's own axes; choose another")
        if isinstance(self.angle, FollowSun):
            if self.angle.normal is None:
                raise ValueError(
                    "angle.normal: is missing; give the direction, body axes at angle zero, that follows the Sun"
                )
            across = np.cross(self.axis, self.angle.normal)
            if np.linalg.norm(across) < 1e-6 * np.linalg.norm(self.axis) * np.linalg.norm(self.angle.normal):
                raise ValueError("angle.normal: is parallel to the hinge's axis; give another")
        return self

    def link(self, time_s: np.ndarray, to_sun: np.ndarray | None, sun_rate: np.ndarray | None) -> Link:
        """Return the link of the hinge's axes in body axes (time), with the rate of the hinge [rad/s].

        Parameters
        ----------
        time_s : instants (time,) [s]
        to_sun : unit vectors (time, 3) to the Sun in body axes; None without a Sun
        sun_rate : rates (time, 3) of these vectors in body axes [1/s]; None without a Sun

        Raises
        ------
        ScenarioError
            If the hinge follows the Sun and there is none
        """
        from scipy.spatial.transform import Rotation

        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        angle, rate = self._angle(np.asarray(time_s, dtype=float), axis, to_sun, sun_rate)
        rotation = Rotation.from_rotvec(angle[:, None] * axis)
        return Link((np.array(self.position_m), rotation.as_matrix()), np.zeros(3), rate[:, None] * axis)

    def _angle(
        self, time_s: np.ndarray, axis: np.ndarray, to_sun: np.ndarray | None, sun_rate: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Evaluate the angle [rad] and rate [rad/s] (time,) of the hinge.

        Parameters
        ----------
        time_s : instants (time,) [s]
        axis : unit vector (3,) of the hinge line in body axes
        to_sun, sun_rate : as for `link`
        """
        law = self.angle
        if isinstance(law, FixedAngle):
            rate = np.full(len(time_s), law.rate_deg_s * units.DEG)
            return law.angle_deg * units.DEG + rate * time_s, rate
        if isinstance(law, PlannedAngle):
            times, angles = np.array(law.time_s), np.array(law.angle_deg) * units.DEG
            slopes = np.concatenate([[0.0], np.diff(angles) / np.diff(times), [0.0]])
            return np.interp(time_s, times, angles), slopes[np.searchsorted(times, time_s, side="right")]
        if to_sun is None or sun_rate is None:
            raise ScenarioError(
                f"joint {self.name}: follows the Sun, which this world does not have; set world.sun_direction"
            )
        assert law.normal is not None  # checked by `_check_name_and_normal`
        x = np.array(law.normal) - axis * (axis @ np.array(law.normal))
        x /= np.linalg.norm(x)
        y = np.cross(axis, x)
        across, along = dot(to_sun, y), dot(to_sun, x)
        square = across**2 + along**2
        rate = (along * dot(sun_rate, y) - across * dot(sun_rate, x)) / np.where(square > 1e-12, square, np.inf)
        return np.where(square > 1e-12, np.arctan2(across, along), 0.0), rate


def find_sun_in_body(
    root_from_body: Rotation,
    body_rate_rad_s: np.ndarray,
    line_m: np.ndarray,
    line_rate_m_s: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the direction to the Sun in body axes.

    Parameters
    ----------
    root_from_body : attitude of the body, single or (time)
    body_rate_rad_s : angular velocity (…, 3) of the body in the root, in body axes [rad/s]
    line_m : vector (…, 3) from the body to the Sun, root axes [m]
    line_rate_m_s : rate (…, 3) of that vector, root axes [m/s]; None if the Sun does not move

    Returns
    -------
    unit vector (time, 3) to the Sun, and its rate (time, 3) [1/s], both in body axes
    """
    line_rate_m_s = np.zeros_like(line_m) if line_rate_m_s is None else line_rate_m_s
    distance = np.sqrt(dot(line_m, line_m))[..., None]
    to_sun = line_m / distance
    moving = (line_rate_m_s - to_sun * dot(to_sun, line_rate_m_s)[..., None]) / distance
    back = root_from_body.inv()
    seen = rotate_vectors(back, to_sun)
    return seen, rotate_vectors(back, moving) - cross(np.broadcast_to(body_rate_rad_s, seen.shape), seen)
