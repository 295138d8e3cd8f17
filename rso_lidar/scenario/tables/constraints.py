"""Constraints on the geometry of a mission: exclusion angles, keep-out spheres and corridors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from rso_lidar import units
from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.motion import Body
from rso_lidar.orbit import angle_rad
from rso_lidar.part import GREATEST, Direction, NotNegative, Part, Positive, Text

Exclusion = Annotated[Positive, Field(lt=180)]


def _radii(given: Any) -> Any:
    """Check the value of `keep_out_m`, a number or a table, with one sentence for a bad one."""
    for name, radius in given.items() if isinstance(given, dict) else [("", given)]:
        number = isinstance(radius, int | float) and not isinstance(radius, bool)
        if given is not None and not (number and 1e-12 <= radius <= GREATEST):
            of = f" of '{name}'" if name else ""
            raise ValueError(
                f"the radius{of} is {radius!r}; give metres, a number over 0, or a table such as {{ name = 200 }}"
            )
    return given


KeepOut = Annotated[Positive | dict[Text, Positive] | None, BeforeValidator(_radii)]


class Corridor(Part):
    """A cone in which the follower stays while it is `from_m` to `to_m` away: the apex is the origin of `axes`.

    `axes` are the target's body axes, axes that the target declares, such as a port, or "rtn", those of its orbit.
    """

    target: Text = Field(description="Name of the target to which the corridor leads.")
    axes: Text | None = Field(
        default=None,
        description=(
            "Axes whose origin is the apex and in which `axis` is given: axes that the target declares, such as a "
            "port, or `rtn`. If omitted, the target's body axes."
        ),
    )
    axis: Direction = Field(description="Centre line of the cone, from the apex outward, of any length.")
    half_angle_deg: Exclusion = Field(description="Half angle of the cone [deg].")
    from_m: NotNegative = Field(default=0.0, description="Distance from the apex at which the corridor begins [m].")
    to_m: Positive | None = Field(
        default=None, description="Distance from the apex at which the corridor ends [m]. If omitted, it has no end."
    )

    @model_validator(mode="after")
    def _some_length(self) -> Self:
        if self.to_m is not None and self.to_m <= self.from_m:
            raise ValueError(f"to_m {self.to_m:g} is not beyond from_m {self.from_m:g}; give the farther end as to_m")
        return self

    @property
    def apex(self) -> str:
        """Name, in the tree of poses, of the axes whose origin is the apex."""
        return f"{self.target}.rtn" if self.axes == "rtn" else self.axes or self.target

    @property
    def apex_name(self) -> str:
        """Name of the apex for messages."""
        return self.target if self.axes in (None, "rtn") else f"{self.target}'s {self.axes}"

    def angle_rad(self, place_m: np.ndarray) -> np.ndarray:
        """Return the angle (time) [rad] between the axis of the corridor and the direction to some points.

        Parameters
        ----------
        place_m : points (time, 3) in the axes of the apex [m]
        """
        return angle_rad(place_m, np.array(self.axis))

    def applies(self, place_m: np.ndarray) -> np.ndarray:
        """Return whether (time) points are within the length of the corridor.

        Parameters
        ----------
        place_m : points (time, 3) in the axes of the apex [m]
        """
        distance = np.sqrt(np.sum(place_m**2, axis=-1))
        there: np.ndarray = (distance >= self.from_m) & (distance <= (self.to_m or np.inf))
        return there

    def margin_m(self, place_m: np.ndarray) -> np.ndarray:
        """Return the distance (time) [m] of points from the boundary of the corridor, negative outside.

        Parameters
        ----------
        place_m : points (time, 3) in the axes of the apex [m]
        """
        distance = np.sqrt(np.sum(place_m**2, axis=-1))
        aside = distance * (self.half_angle_deg * units.DEG - self.angle_rad(place_m))
        margin: np.ndarray = np.minimum(np.minimum(aside, distance - self.from_m), (self.to_m or np.inf) - distance)
        return margin


class Constraints(Part):
    """Constraints that `check` applies to a scenario; those that are left out do not apply.

    Exclusion angles are measured from the lidar's boresight: to the Sun's centre while any of the Sun is visible, to the
    Moon's centre, and to the Earth's limb. `keep_out_m` is the radius of a sphere about each target, or about those that a
    table names. The follower's origin may enter it only inside a corridor of that target.
    """

    sun_exclusion_deg: Exclusion | None = Field(
        default=None,
        description=(
            "Minimum angle from the boresight to the Sun's centre while any of the Sun is visible [deg]. If omitted, "
            "only a Sun in the field of view or within 5° of it is reported."
        ),
    )
    moon_exclusion_deg: Exclusion | None = Field(
        default=None,
        description="Minimum angle from the boresight to the Moon's centre, as seen from the follower [deg].",
    )
    earth_exclusion_deg: Exclusion | None = Field(
        default=None, description="Minimum angle from the boresight to the Earth's limb [deg]."
    )
    keep_out_m: KeepOut = Field(
        default=None,
        description=(
            "Radius of a sphere about every target, or a table by target such as `{ tdrs = 200 }` [m]. The follower's "
            "origin must stay outside, except in a corridor of that target."
        ),
    )
    corridor: tuple[Corridor, ...] = Field(
        default=(), description="Cones in which the follower must stay during its approach."
    )

    def radius_m(self, target: str) -> float | None:
        """Return the radius [m] of the keep-out sphere about a target; None without one.

        Parameters
        ----------
        target : name of the target
        """
        return self.keep_out_m.get(target) if isinstance(self.keep_out_m, dict) else self.keep_out_m

    def check(self, targets: Sequence[Body], *, local: bool, sun: bool) -> None:
        """Raise `ScenarioError` for constraints on targets, axes or bodies that the scenario does not have.

        Parameters
        ----------
        targets : of the scenario
        local : whether the world has no Earth
        sun : whether the world has a Sun
        """
        by_name = {target.name: target for target in targets}
        named = list(self.keep_out_m) if isinstance(self.keep_out_m, dict) else []
        for place, name in [
            *(("keep_out_m", name) for name in named),
            *((f"corridor[{k}].target", corridor.target) for k, corridor in enumerate(self.corridor)),
        ]:
            if name not in by_name:
                known = ", ".join(by_name) or "none"
                raise ScenarioError(
                    f"constraints.{place}: no target '{name}'{did_you_mean(name, by_name)} (targets: {known})"
                )
        for k, corridor in enumerate(self.corridor):
            target = by_name[corridor.target]
            known_axes = [target.name, *(axes.name for axes in target.axes), *(["rtn"] if target.orbits else [])]
            if corridor.axes is not None and corridor.axes not in known_axes:
                raise ScenarioError(
                    f"constraints.corridor[{k}].axes: '{target.name}' has no axes '{corridor.axes}'"
                    f"{did_you_mean(corridor.axes, known_axes)} (known: {', '.join(known_axes)})"
                )
        lacking = {"moon_exclusion_deg": local, "earth_exclusion_deg": local, "sun_exclusion_deg": not sun}
        for key, lacks in lacking.items():
            if lacks and getattr(self, key) is not None:
                cure = "set world.sun_direction or leave it out" if key.startswith("sun") else "leave it out"
                raise ScenarioError(
                    f"constraints.{key}: this local world has no {key.partition('_')[0].title()}; {cure}"
                )
