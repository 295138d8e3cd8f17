"""Sun, Moon, Earth and shadow over a scenario: as a table, as lines for a person, and as advice where it was not asked for.

The boresight is that of a lidar whose PTU stands on its demand. In a local world there is no Earth and no Moon, and a Sun
only where the scenario says so.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar import motion, units
from rso_lidar.motion import Body
from rso_lidar.orbit import Epochs
from rso_lidar.orbit.sky.eclipse import Eclipse, eclipses
from rso_lidar.orbit.sky.geometry import (
    angle_rad,
    beta_angle_rad,
    earth_limb_angle_rad,
    earth_lit,
    earth_radius_rad,
    line_height_m,
    outside_field_rad,
    phase_angle_rad,
)
from rso_lidar.orbit.sky.sun import sun_position_m
from rso_lidar.pose import ROOT, turned
from rso_lidar.ties import first_least

if TYPE_CHECKING:
    from rso_lidar.scenario.mission.mission import Scenario
    from rso_lidar.scenario.preview.geometry import Preview
    from rso_lidar.scenario.tables.constraints import Constraints

_NEAR_DEG = 5.0  # outside of the field, where a baffle keeps little of the Sun out
_ECLIPSES_S = 30 * units.DAY_S  # eclipses are looked for in so much of a scenario
_MOST_TOLD = 3


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What the lidar has about it at the epochs of a preview; vectors (time, 3) in root axes, None where there is none.

    `position_m` is the follower's, `root_from_lidar` (…, 3, 3) the lidar's turn, `half_field` (time, 2) the tangents of the
    half field to the right and down; `sun_seen` says where the Earth does not hide the Sun whole.
    """

    position_m: np.ndarray
    root_from_lidar: np.ndarray
    half_field: np.ndarray
    sun_m: np.ndarray | None
    moon_m: np.ndarray | None
    earth: bool
    sun_seen: np.ndarray

    @cached_property
    def boresight(self) -> np.ndarray:
        """Return the unit vectors along the boresight."""
        ahead = turned(self.root_from_lidar, np.array([0.0, 0.0, 1.0]))
        return np.broadcast_to(ahead, self.position_m.shape)

    @cached_property
    def sun_angle_rad(self) -> np.ndarray | None:
        """Return the angle (time) [rad] from the boresight to the Sun's centre."""
        return None if self.sun_m is None else angle_rad(self.boresight, self.sun_m - self.position_m)

    @cached_property
    def moon_angle_rad(self) -> np.ndarray | None:
        """Return the angle (time) [rad] from the boresight to the Moon's centre, as the follower sees it."""
        return None if self.moon_m is None else angle_rad(self.boresight, self.moon_m - self.position_m)

    @cached_property
    def earth_limb_angle_rad(self) -> np.ndarray | None:
        """Return the angle (time) [rad] from the boresight to the Earth's limb, negative where the boresight meets it."""
        return earth_limb_angle_rad(self.boresight, self.position_m) if self.earth else None

    @cached_property
    def earth_in_field(self) -> np.ndarray:
        """Return whether (time) the Earth's disk cuts the field of view; never from below its surface."""
        if not self.earth:
            return np.full(len(self.position_m), False)
        covers: np.ndarray = self.outside_field_rad(-self.position_m) <= earth_radius_rad(self.position_m)
        return covers

    @property
    def earth_side(self) -> str:
        """Return in words which side of the Earth is in the field while its disk is."""
        assert self.sun_m is not None
        lit = earth_lit(self.boresight, self.position_m, self.sun_m)[self.earth_in_field]
        if lit.all():
            return "its day side"
        return f"its day side {np.mean(lit):.0%} of that" if lit.any() else "its night side"

    def outside_field_rad(self, direction: np.ndarray) -> np.ndarray:
        """Return by how much (time) [rad] directions in root axes lie outside of the field of view."""
        return outside_field_rad(turned(np.swapaxes(self.root_from_lidar, -1, -2), direction), self.half_field)


def surroundings(scenario: Scenario, seen: Preview) -> Surroundings:
    """Return what the lidar has about it at the epochs of a preview."""
    shape = (len(seen.time_s), 3)
    position_m = np.broadcast_to(seen.states["follower"].position_m, shape)
    half_field = np.array([scenario.instrument.at(float(time_s)).receiver.field_edge for time_s in seen.time_s])
    _, turn = seen.truth.poses.place(ROOT, "lidar")
    if scenario.local:
        sun_m = None
        if scenario.world.sun_direction is not None:
            sun_m = position_m + units.ASTRONOMICAL_UNIT_M * seen.truth.sun_direction  # one direction from everywhere
        return Surroundings(position_m, turn, half_field, sun_m, None, False, np.full(shape[0], True))
    from rso_lidar.orbit.sky.moon import moon_position_m

    sun_m, moon_m = sun_position_m(seen.epochs), moon_position_m(seen.epochs)
    return Surroundings(position_m, turn, half_field, sun_m, moon_m, True, seen.truth.sunlit["follower"] > 0.0)


def environment_table(scenario: Scenario, seen: Preview) -> dict[str, np.ndarray]:
    """Return columns (time) by name at the epochs of a preview, each name with its unit; what is not there has no column.

    The boresight's angles to Sun, Moon and limb; the Earth's angular radius; for each body in orbit beta and the share of
    the Sun that it sees; for each target its distance, phase angle, and how high the line to it passes over the Earth.
    """
    around = surroundings(scenario, seen)
    columns: dict[str, np.ndarray | None] = {
        "time_s": seen.time_s,
        "sun_angle_rad": around.sun_angle_rad,
        "moon_angle_rad": around.moon_angle_rad,
        "earth_limb_angle_rad": around.earth_limb_angle_rad,
        "earth_radius_rad": earth_radius_rad(around.position_m) if around.earth else None,
    }
    for body in scenario.bodies:
        if body.orbits and around.sun_m is not None:
            columns[f"{body.name}_beta_rad"] = beta_angle_rad(seen.states[body.name], around.sun_m)
        if around.earth:
            columns[f"{body.name}_sunlit_fraction"] = np.asarray(seen.truth.sunlit[body.name])
    for target in scenario.target:
        line_m = _line_m(seen, target.name)
        columns[f"{target.name}_range_m"] = np.sqrt(np.sum(line_m**2, axis=-1))
        if around.sun_m is not None:
            columns[f"{target.name}_phase_angle_rad"] = phase_angle_rad(
                line_m,
                np.zeros_like(line_m),
                around.sun_m - around.position_m,  # all seen from the follower
            )
        if around.earth:
            columns[f"{target.name}_line_height_m"] = _line_height_m(seen, target.name)
    return {name: values for name, values in columns.items() if values is not None}


def _line_m(seen: Preview, target: str) -> np.ndarray:
    """Return the vector (time, 3) [m] from the follower's origin to a target's, in root axes."""
    poses = seen.truth.poses
    line = turned(poses.place(ROOT, "follower")[1], poses.place("follower", target)[0])
    return np.broadcast_to(line, (len(seen.time_s), 3))


def _line_height_m(seen: Preview, target: str) -> np.ndarray:
    """Return how high [m] the line from follower to target passes; NaN where an end of it is below the Earth's surface."""
    ends = [seen.states[name].position_m for name in ("follower", target)]
    buried = np.isnan(earth_radius_rad(ends[0])) | np.isnan(earth_radius_rad(ends[1]))
    return np.where(buried, np.nan, line_height_m(*ends))


# ------------------------------------------------------------------------------------------------------------ in words


def environment_lines(scenario: Scenario, seen: Preview) -> list[str]:
    """Return lines for a description: Sun, Earth and Moon off the boresight, beta, phase angles and eclipses."""
    table = environment_table(scenario, seen)
    around = surroundings(scenario, seen)
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
    for target in scenario.target:
        phase = table.get(f"{target.name}_phase_angle_rad")
        if phase is not None:
            lines.append(f"  phase     {target.name}: {_course(phase, seen.time_s)} (0°: the Sun is behind the lidar)")
    bodies = [body for body in scenario.bodies if body.orbits]
    for body in [body for body in bodies if body.name != "follower"] or bodies:
        beta = _ends(table[f"{body.name}_beta_rad"])
        lines.append(f"  eclipse   {body.name}: beta {beta}; {_eclipses(scenario, body)}")
    return lines


def environment_advice(scenario: Scenario, seen: Preview, constraints: Constraints | None = None) -> list[str]:
    """Return one line for each thing about the boresight that is allowed and probably not meant.

    Whether the Sun may come near the field is left to the `constraints` where they say so.
    """
    around = surroundings(scenario, seen)
    lines = _sun_advice(seen, around, near=constraints is None or constraints.sun_exclusion_deg is None)
    if scenario.lidar.receiver.filter_width_nm is not None:
        lines += _earth_advice(seen, around)
    return lines + _line_advice(scenario, seen, around)


def _sun_advice(seen: Preview, around: Surroundings, *, near: bool) -> list[str]:
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


def _earth_advice(seen: Preview, around: Surroundings) -> list[str]:
    covers = around.earth_in_field
    if not covers.any():
        return []
    return [
        f"the Earth's disk is in the field of view {share_text(covers, seen.time_s)} ({around.earth_side}): "
        "lidar.receiver.filter_width_nm asks for sunlight, but that which the Earth scatters is not in the frames; look "
        "away from the Earth"
    ]


def _line_advice(scenario: Scenario, seen: Preview, around: Surroundings) -> list[str]:
    lines = []
    for target in scenario.target if around.earth else ():
        blocked = _line_height_m(seen, target.name) < 0.0
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


def _eclipses(scenario: Scenario, body: Body) -> str:
    """Return the passages through the shadow in words: from when to when the Sun is hidden, whole and in part."""
    start_utc, end_s = scenario.span
    searched_s = min(end_s, _ECLIPSES_S)
    found = eclipses(motion.Chief(scenario.bodies, body.name), Epochs(start_utc, np.array([0.0, searched_s])))
    span = f" in the first {searched_s / units.DAY_S:g} days" if searched_s < end_s else ""
    if not found:
        return f"no eclipse{span}"
    told = [_told(eclipse) for eclipse in found]
    if len(told) > _MOST_TOLD:
        told = [told[0], f"... {len(told) - 2} more ...", told[-1]]
    filtered = scenario.lidar.receiver.filter_width_nm is not None
    unlit = ", and then no sunlight on it" * filtered
    return f"{len(found)} eclipse{'s' * (len(found) > 1)}{span}: {'; '.join(told)}{unlit}"


def _told(eclipse: Eclipse) -> str:
    partial = _from_to("penumbra", eclipse.penumbra_from_s, eclipse.penumbra_to_s)
    return f"{_from_to('umbra', eclipse.umbra_from_s, eclipse.umbra_to_s)}, {partial}" if eclipse.total else partial


def _from_to(what: str, begins_s: float, ends_s: float) -> str:
    if np.isinf(begins_s) and np.isinf(ends_s):
        return f"{what} all the time"
    begins = f"from {begins_s:.3f} s" if np.isfinite(begins_s) else "from before the first frame"
    ends = f"to {ends_s:.3f} s" if np.isfinite(ends_s) else "to after the last"
    return f"{what} {begins} {ends}"
