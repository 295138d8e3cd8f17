"""What a mission asks of its geometry: how near the boresight may come to Sun, Moon and Earth, and where not to fly."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from rso_lidar import motion, units
from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.motion import Body
from rso_lidar.orbit import Epochs
from rso_lidar.orbit.environment import cone_angle_rad, least, spans_below
from rso_lidar.part import GREATEST, Direction, NotNegative, Part, Positive, Text
from rso_lidar.pose import PoseTree
from rso_lidar.scenario.environment import share_text, surroundings

if TYPE_CHECKING:
    from rso_lidar.scenario.preview import Preview
    from rso_lidar.scenario.scenario import Scenario

_FEWEST, _MOST, _SCAN_S = 400, 20_000, 60.0

Exclusion = Annotated[Positive, Field(lt=180)]


def _radii(given: Any) -> Any:
    """Return what was given for `keep_out_m`, or say in one sentence what is wrong with it, whichever form it has."""
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

    target: Text
    axes: Text | None = None
    axis: Direction
    half_angle_deg: Exclusion
    from_m: NotNegative = 0.0
    to_m: Positive | None = None

    @model_validator(mode="after")
    def _some_length(self) -> Self:
        if self.to_m is not None and self.to_m <= self.from_m:
            raise ValueError(f"to_m {self.to_m:g} is not beyond from_m {self.from_m:g}; give the farther end as to_m")
        return self

    @property
    def apex(self) -> str:
        """Return the name of the axes whose origin is the apex, as the tree of poses knows them."""
        return f"{self.target}.rtn" if self.axes == "rtn" else self.axes or self.target

    @property
    def apex_name(self) -> str:
        """Return what a person calls the apex."""
        return self.target if self.axes in (None, "rtn") else f"{self.target}'s {self.axes}"

    def angle_rad(self, place_m: np.ndarray) -> np.ndarray:
        """Return the angle (time) [rad] between the corridor's axis and places (time, 3) in the axes of its apex."""
        return cone_angle_rad(place_m, np.array(self.axis))

    def applies(self, place_m: np.ndarray) -> np.ndarray:
        """Return whether (time) places are as far from the apex as the corridor is long."""
        distance = np.sqrt(np.sum(place_m**2, axis=-1))
        there: np.ndarray = (distance >= self.from_m) & (distance <= (self.to_m or np.inf))
        return there

    def margin_m(self, place_m: np.ndarray) -> np.ndarray:
        """Return how deep (time) [m] places are inside the corridor; negative outside."""
        distance = np.sqrt(np.sum(place_m**2, axis=-1))
        aside = distance * (self.half_angle_deg * units.DEG - self.angle_rad(place_m))
        margin: np.ndarray = np.minimum(np.minimum(aside, distance - self.from_m), (self.to_m or np.inf) - distance)
        return margin


class Constraints(Part):
    """What `check` holds a scenario to; nothing is asked that is left out.

    Exclusions are angles from the lidar's boresight: to the centre of the Sun while any of it is seen, to the Moon's centre,
    and to the Earth's limb. `keep_out_m` is the radius of a sphere about each target, or about those it names, into which
    the follower's origin comes in a corridor of that target only.
    """

    sun_exclusion_deg: Exclusion | None = None
    moon_exclusion_deg: Exclusion | None = None
    earth_exclusion_deg: Exclusion | None = None
    keep_out_m: KeepOut = None
    corridor: tuple[Corridor, ...] = ()

    def radius_m(self, target: str) -> float | None:
        """Return the radius of the sphere about a target that is kept out of, or None."""
        return self.keep_out_m.get(target) if isinstance(self.keep_out_m, dict) else self.keep_out_m

    def check(self, targets: Sequence[Body], *, local: bool, sun: bool) -> None:
        """Raise `ScenarioError` where something is asked about what the scenario has not."""
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


def broken(constraints: Constraints, scenario: Scenario, seen: Preview) -> list[str]:
    """Return one sentence for each constraint that the scenario breaks: what, when first, by how much, and the cure.

    Angles are looked at in the frames of the preview; a keep-out sphere in all the time from the first frame to the last.
    """
    lines = _exclusions(constraints, scenario, seen)
    lines += [line for target in scenario.target for line in _keep_out(constraints, scenario, seen, target.name)]
    for k, corridor in enumerate(constraints.corridor):
        lines += _corridor(f"constraints.corridor[{k}]", corridor, scenario, seen)
    return lines


def _exclusions(constraints: Constraints, scenario: Scenario, seen: Preview) -> list[str]:
    around = surroundings(scenario, seen)
    cure = "turn the boresight away, or start at another time"
    lines = []
    for key, what, angle in (
        ("sun_exclusion_deg", "the Sun comes", around.sun_angle_rad),
        ("moon_exclusion_deg", "the Moon comes", around.moon_angle_rad),
        ("earth_exclusion_deg", "the Earth's limb comes", around.earth_limb_angle_rad),
    ):
        asked_deg = getattr(constraints, key)
        if asked_deg is None or angle is None:
            continue
        near = angle < asked_deg * units.DEG
        if key == "sun_exclusion_deg":
            near &= around.sun_seen
        if near.any():
            worst = int(np.argmin(np.where(near, angle, np.inf)))
            least_deg = angle[worst] / units.DEG
            how = f"{what} within {least_deg:.2f}° of the boresight"
            if least_deg < 0.0:
                how = f"the boresight meets the Earth, {-least_deg:.2f}° inside its limb,"
            lines.append(
                f"constraints.{key}: {how} at {seen.time_s[worst]:g} s, and {asked_deg:g}° is asked; "
                f"{share_text(near, seen.time_s)}; {cure}"
            )
    return lines


def _at(poses: PoseTree, apex: str, name: str, n_epochs: int) -> np.ndarray:
    """Return where (time, 3) [m] the origin of axes is, in the axes of an apex."""
    place: np.ndarray = np.broadcast_to(poses.place(apex, name)[0], (n_epochs, 3))
    return place


def _keep_out(constraints: Constraints, scenario: Scenario, seen: Preview, target: str) -> list[str]:
    radius_m = constraints.radius_m(target)
    if radius_m is None:
        return []
    corridors = [corridor for corridor in constraints.corridor if corridor.target == target]

    def poses(time_s: np.ndarray) -> PoseTree:
        epochs = Epochs(scenario.time.start_utc, time_s)
        with motion.unwarned():
            course = motion.truth(
                scenario.bodies, epochs, local=scenario.local, sun_direction=scenario.world.sun_direction
            )
        return course.poses

    def distance_m(time_s: np.ndarray) -> np.ndarray:
        distance: np.ndarray = np.sqrt(np.sum(_at(poses(time_s), target, "follower", len(time_s)) ** 2, axis=-1))
        return distance

    def clear_m(time_s: np.ndarray) -> np.ndarray:
        tree = poses(time_s)
        clear: np.ndarray = np.sqrt(np.sum(_at(tree, target, "follower", len(time_s)) ** 2, axis=-1)) - radius_m
        for corridor in corridors:
            clear = np.maximum(clear, corridor.margin_m(_at(tree, corridor.apex, "follower", len(time_s))))
        return clear

    start_s, end_s = float(seen.time_s[0]), float(seen.time_s[-1])
    step_s = max((end_s - start_s) / _MOST, min(_SCAN_S, (end_s - start_s) / _FEWEST))
    spans = spans_below(clear_m, start_s, end_s, max(step_s, 1e-3))
    if not spans:
        return []
    clipped = [(max(begins, start_s), min(ends, end_s)) for begins, ends in spans]
    when_s, nearest_m = min((least(distance_m, *span) for span in clipped), key=lambda found: found[1])
    inside = ", from the first frame on" if spans[0][0] < start_s else f", first at {clipped[0][0]:.3f} s"
    outside = " outside of its corridor" if corridors else ""
    return [
        f"constraints.keep_out_m: the follower comes to {nearest_m:.3g} m of {target}{outside} at {when_s:.3f} s, and "
        f"{radius_m:g} m is asked{inside}; fly wider, or shrink the sphere"
    ]


def _corridor(place: str, corridor: Corridor, scenario: Scenario, seen: Preview) -> list[str]:
    place_m = _at(seen.truth.poses, corridor.apex, "follower", len(seen.time_s))
    applies = corridor.applies(place_m)
    angle = corridor.angle_rad(place_m)
    out = applies & (angle > corridor.half_angle_deg * units.DEG)
    if not out.any():
        return []
    worst = int(np.argmax(np.where(out, angle, -np.inf)))
    return [
        f"{place}: the follower is {angle[worst] / units.DEG:.2f}° off the axis at {seen.time_s[worst]:g} s, "
        f"{np.sqrt(np.sum(place_m[worst] ** 2)):.4g} m from {corridor.apex_name}, and "
        f"{corridor.half_angle_deg:g}° is asked; {share_text(out, seen.time_s)}; steer into the cone, or turn its axis"
    ]
