"""Whether a mission keeps its constraints: one sentence for each violation."""

from __future__ import annotations

import numpy as np

from rso_lidar import motion, units
from rso_lidar.errors import suppress_warnings
from rso_lidar.orbit import Epochs, find_minimum, find_spans_below
from rso_lidar.pose import PoseTree
from rso_lidar.scenario.assessment.environment import describe_share
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.geometry import Preview
from rso_lidar.scenario.preview.sky import compute_sky_geometry
from rso_lidar.scenario.tables.constraints import Constraints, Corridor
from rso_lidar.ties import find_first_least

_FEWEST, _MOST, _SCAN_S = 400, 20_000, 60.0


def list_violations(constraints: Constraints, mission: Mission, preview: Preview) -> list[str]:
    """List one sentence for each constraint that a mission violates: what, when first, by how much, and the cure.

    Angles are checked at the epochs of the preview. A keep-out sphere is checked at all times between the first frame and
    the last.
    """
    lines = _check_exclusions(constraints, mission, preview)
    lines += [line for target in mission.target for line in _check_keep_out(constraints, mission, preview, target.name)]
    for k, corridor in enumerate(constraints.corridor):
        lines += _check_corridor(f"constraints.corridor[{k}]", corridor, mission, preview)
    return lines


def _check_exclusions(constraints: Constraints, mission: Mission, preview: Preview) -> list[str]:
    """List the violations of the exclusion angles."""
    around = compute_sky_geometry(mission, preview)
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
            worst = find_first_least(np.where(near, angle, np.inf))
            least_deg = angle[worst] / units.DEG
            how = f"{what} within {least_deg:.2f}° of the boresight"
            if least_deg < 0.0:
                how = f"the boresight meets the Earth, {-least_deg:.2f}° inside its limb,"
            lines.append(
                f"constraints.{key}: {how} at {preview.time_s[worst]:g} s, and {asked_deg:g}° is required; "
                f"{describe_share(near, preview.time_s)}; {cure}"
            )
    return lines


def _locate(poses: PoseTree, apex: str, name: str, n_epochs: int) -> np.ndarray:
    """Return the position (time, 3) [m] of the origin of the axes `name` in the axes `apex`."""
    place: np.ndarray = np.broadcast_to(poses.place(apex, name)[0], (n_epochs, 3))
    return place


def _check_keep_out(constraints: Constraints, mission: Mission, preview: Preview, target: str) -> list[str]:
    """List the violations of a keep-out sphere."""
    radius_m = constraints.radius_m(target)
    if radius_m is None:
        return []
    corridors = [corridor for corridor in constraints.corridor if corridor.target == target]

    def poses(time_s: np.ndarray) -> PoseTree:
        epochs = Epochs(mission.time.start_utc, time_s)
        with suppress_warnings():
            return motion.truth(mission.bodies, epochs, **mission.world.motion_arguments).poses

    def distance_m(time_s: np.ndarray) -> np.ndarray:
        distance: np.ndarray = np.sqrt(np.sum(_locate(poses(time_s), target, "follower", len(time_s)) ** 2, axis=-1))
        return distance

    def clear_m(time_s: np.ndarray) -> np.ndarray:
        tree = poses(time_s)
        clear: np.ndarray = np.sqrt(np.sum(_locate(tree, target, "follower", len(time_s)) ** 2, axis=-1)) - radius_m
        for corridor in corridors:
            clear = np.maximum(clear, corridor.margin_m(_locate(tree, corridor.apex, "follower", len(time_s))))
        return clear

    start_s, end_s = float(preview.time_s[0]), float(preview.time_s[-1])
    step_s = max((end_s - start_s) / _MOST, min(_SCAN_S, (end_s - start_s) / _FEWEST))
    spans = find_spans_below(clear_m, start_s, end_s, max(step_s, 1e-3))
    if not spans:
        return []
    clipped = [(max(begins, start_s), min(ends, end_s)) for begins, ends in spans]
    when_s, nearest_m = min((find_minimum(distance_m, *span) for span in clipped), key=lambda minimum: minimum[1])
    inside = ", from the first frame on" if spans[0][0] < start_s else f", first at {clipped[0][0]:.3f} s"
    outside = " outside of its corridor" if corridors else ""
    nearest = f"{nearest_m:.3g}" if nearest_m < 999.5 else f"{nearest_m:.0f}"
    return [
        f"constraints.keep_out_m: the follower comes within {nearest} m of {target}{outside} at {when_s:.3f} s, and "
        f"{radius_m:g} m is required{inside}; fly wider, or reduce the sphere"
    ]


def _check_corridor(place: str, corridor: Corridor, mission: Mission, preview: Preview) -> list[str]:
    """List the violations of a corridor."""
    place_m = _locate(preview.truth.poses, corridor.apex, "follower", len(preview.time_s))
    applies = corridor.applies(place_m)
    angle = corridor.angle_rad(place_m)
    out = applies & (angle > corridor.half_angle_deg * units.DEG)
    if not out.any():
        return []
    worst = int(np.argmax(np.where(out, angle, -np.inf)))
    return [
        f"{place}: the follower is {angle[worst] / units.DEG:.2f}° off the axis at {preview.time_s[worst]:g} s, "
        f"{np.sqrt(np.sum(place_m[worst] ** 2)):.4g} m from {corridor.apex_name}, and "
        f"{corridor.half_angle_deg:g}° is required; {describe_share(out, preview.time_s)}; "
        "steer into the cone, or turn its axis"
    ]
