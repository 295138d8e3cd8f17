"""Sun, Moon, Earth and eclipses in words: lines of a description, and warnings."""

from __future__ import annotations

import numpy as np

from rso_lidar import motion, units
from rso_lidar.motion import Body
from rso_lidar.orbit import Epochs
from rso_lidar.orbit.sky.eclipse import Eclipse, find_eclipses
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.geometry import Preview
from rso_lidar.scenario.preview.sky import SkyGeometry, environment_table, line_of_sight_height_m, sky_geometry
from rso_lidar.scenario.tables.constraints import Constraints
from rso_lidar.ties import first_least

_NEAR_DEG = 5.0  # outside of the field, where a baffle keeps little of the Sun out
_ECLIPSES_S = 30 * units.DAY_S  # eclipses are looked for in so much of a scenario
_MOST_TOLD = 3


def environment_lines(mission: Mission, seen: Preview) -> list[str]:
    """Return lines for a description: Sun, Earth and Moon off the boresight, beta, phase angles and eclipses."""
    table = environment_table(mission, seen)
    around = sky_geometry(mission, seen)
    lines = []
    if "sun_angle_rad" in table:
        lines.append(f"sun         {_course(table['sun_angle_rad'], seen.time_s, ' off the boresight')}")
    if "earth_limb_angle_rad" in table and np.all(np.isfinite(table["earth_radius_rad"])):
        radius = _ends(table["earth_radius_rad"])
        limb = _course(table["earth_limb_angle_rad"], seen.time_s, " off the boresight")
        covers = around.earth_in_field
        cut = f"; in the field {np.mean(covers):.0%} of the time ({around.earth_side})" if covers.any() else ""
        lines.append(f"earth       limb {limb}; radius of its disk {radius}{cut}")
    if "moon_angle_rad" in table:
        lines.append(f"moon        {_course(table['moon_angle_rad'], seen.time_s, ' off the boresight')}")
    for target in mission.target:
        phase = table.get(f"{target.name}_phase_angle_rad")
        if phase is not None:
            lines.append(f"  phase     {target.name}: {_course(phase, seen.time_s)} (0°: the Sun is behind the lidar)")
    bodies = [body for body in mission.bodies if body.orbits]
    for body in [body for body in bodies if body.name != "follower"] or bodies:
        beta = _ends(table[f"{body.name}_beta_rad"])
        lines.append(f"  eclipse   {body.name}: beta {beta}; {_eclipses(mission, body)}")
    return lines


def environment_advice(mission: Mission, seen: Preview, constraints: Constraints | None = None) -> list[str]:
    """Return one line for each thing about the boresight that is allowed and probably not meant.

    Whether the Sun may come near the field is left to the `constraints` where they say so.
    """
    around = sky_geometry(mission, seen)
    lines = _sun_advice(seen, around, near=constraints is None or constraints.sun_exclusion_deg is None)
    if mission.lidar.receiver.filter_width_nm is not None:
        lines += _earth_advice(seen, around)
    return lines + _line_advice(mission, seen, around)


def _sun_advice(seen: Preview, around: SkyGeometry, *, near: bool) -> list[str]:
    if around.sun_m is None:
        return []
    to_sun = around.sun_m - around.position_m
    disc = np.arcsin(units.SUN_RADIUS_M / np.sqrt(np.sum(to_sun**2, axis=-1)))
    outside = np.where(around.sun_seen, around.outside_field_rad(to_sun) - disc, np.inf)
    inside = outside <= 0.0
    if inside.any():
        return [
            f"the Sun is in the field of view {share_text(inside, seen.time_s)}: it blinds a real sensor, and no frame "
            "shows that; turn the boresight away, or start at another time"
        ]
    worst = int(np.argmin(outside))
    if not near or outside[worst] >= _NEAR_DEG * units.DEG:
        return []
    return [
        f"the Sun comes within {outside[worst] / units.DEG:.2f}° of the field of view at {seen.time_s[worst]:g} s, and "
        "stray light is not in the frames; say what the baffle keeps out with constraints.sun_exclusion_deg"
    ]


def _earth_advice(seen: Preview, around: SkyGeometry) -> list[str]:
    covers = around.earth_in_field
    if not covers.any():
        return []
    return [
        f"the Earth's disk is in the field of view {share_text(covers, seen.time_s)} ({around.earth_side}): "
        "lidar.receiver.filter_width_nm asks for sunlight, but that which the Earth scatters is not in the frames; look "
        "away from the Earth"
    ]


def _line_advice(mission: Mission, seen: Preview, around: SkyGeometry) -> list[str]:
    lines = []
    for target in mission.target if around.earth else ():
        blocked = line_of_sight_height_m(seen, target.name) < 0.0
        if blocked.any():
            lines.append(
                f"target {target.name}: the Earth stands between it and the lidar {share_text(blocked, seen.time_s)}, and "
                "frames show it all the same; start when it is in sight"
            )
    return lines


def share_text(mask: np.ndarray, time_s: np.ndarray) -> str:
    """Return how often a mask (time) holds and when first, in words."""
    return f"{np.mean(mask):.0%} of the time, first at {time_s[np.argmax(mask)]:g} s"


def _ends(angle: np.ndarray) -> str:
    return f"{angle[0] / units.DEG:.2f} -> {angle[-1] / units.DEG:.2f}°"


def _course(angle: np.ndarray, time_s: np.ndarray, off: str = "") -> str:
    worst = first_least(angle)
    return f"{_ends(angle)}{off}, least {angle[worst] / units.DEG:.2f}° at {time_s[worst]:g} s"


def _eclipses(mission: Mission, body: Body) -> str:
    """Return the passages through the shadow in words: from when to when the Sun is hidden, whole and in part."""
    start_utc, end_s = mission.span
    searched_s = min(end_s, _ECLIPSES_S)
    found = find_eclipses(motion.Chief(mission.bodies, body.name), Epochs(start_utc, np.array([0.0, searched_s])))
    span = f" in the first {searched_s / units.DAY_S:g} days" if searched_s < end_s else ""
    if not found:
        return f"no eclipse{span}"
    told = [_told(eclipse) for eclipse in found]
    if len(told) > _MOST_TOLD:
        told = [told[0], f"... {len(told) - 2} more ...", told[-1]]
    filtered = mission.lidar.receiver.filter_width_nm is not None
    unlit = ", and then no sunlight on it" * filtered
    return f"{len(found)} eclipse{'s' * (len(found) > 1)}{span}: {'; '.join(told)}{unlit}"


def _told(eclipse: Eclipse) -> str:
    partial = _from_to("penumbra", eclipse.penumbra_from_s, eclipse.penumbra_to_s)
    return f"{_from_to('umbra', eclipse.umbra_from_s, eclipse.umbra_to_s)}, {partial}" if eclipse.is_total else partial


def _from_to(what: str, begins_s: float, ends_s: float) -> str:
    if np.isinf(begins_s) and np.isinf(ends_s):
        return f"{what} all the time"
    begins = f"from {begins_s:.3f} s" if np.isfinite(begins_s) else "from before the first frame"
    ends = f"to {ends_s:.3f} s" if np.isfinite(ends_s) else "to after the last"
    return f"{what} {begins} {ends}"
