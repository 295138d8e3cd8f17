"""Whether a mission keeps its constraints: one sentence for each that it breaks."""

from __future__ import annotations

import numpy as np

from rso_lidar import motion, units
from rso_lidar.errors import unwarned
from rso_lidar.orbit import Epochs
from rso_lidar.orbit.sky.event_search import find_minimum, find_spans_below
from rso_lidar.pose import PoseTree
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.geometry import Preview
from rso_lidar.scenario.preview.sky import sky_geometry
from rso_lidar.scenario.review.environment import share_text
from rso_lidar.scenario.tables.constraints import Constraints, Corridor
from rso_lidar.ties import first_least

_FEWEST, _MOST, _SCAN_S = 400, 20_000, 60.0


def broken(constraints: Constraints, mission: Mission, seen: Preview) -> list[str]:
    """Return one sentence for each constraint that the scenario breaks: what, when first, by how much, and the cure.

    Angles are looked at in the frames of the preview; a keep-out sphere in all the time from the first frame to the last.
    """
    lines = _exclusions(constraints, mission, seen)
    lines += [line for target in mission.target for line in _keep_out(constraints, mission, seen, target.name)]
    for k, corridor in enumerate(constraints.corridor):
        lines += _corridor(f"constraints.corridor[{k}]", corridor, mission, seen)
    return lines


def _exclusions(constraints: Constraints, mission: Mission, seen: Preview) -> list[str]:
    around = sky_geometry(mission, seen)
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
            worst = first_least(np.where(near, angle, np.inf))
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


def _keep_out(constraints: Constraints, mission: Mission, seen: Preview, target: str) -> list[str]:
    radius_m = constraints.radius_m(target)
    if radius_m is None:
        return []
    corridors = [corridor for corridor in constraints.corridor if corridor.target == target]

    def poses(time_s: np.ndarray) -> PoseTree:
        epochs = Epochs(mission.time.start_utc, time_s)
        with unwarned():
            course = motion.truth(
                mission.bodies, epochs, local=mission.local, sun_direction=mission.world.sun_direction
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
    spans = find_spans_below(clear_m, start_s, end_s, max(step_s, 1e-3))
    if not spans:
        return []
    clipped = [(max(begins, start_s), min(ends, end_s)) for begins, ends in spans]
    when_s, nearest_m = min((find_minimum(distance_m, *span) for span in clipped), key=lambda found: found[1])
    inside = ", from the first frame on" if spans[0][0] < start_s else f", first at {clipped[0][0]:.3f} s"
    outside = " outside of its corridor" if corridors else ""
    return [
        f"constraints.keep_out_m: the follower comes to {nearest_m:.3g} m of {target}{outside} at {when_s:.3f} s, and "
        f"{radius_m:g} m is asked{inside}; fly wider, or shrink the sphere"
    ]


def _corridor(place: str, corridor: Corridor, mission: Mission, seen: Preview) -> list[str]:
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
