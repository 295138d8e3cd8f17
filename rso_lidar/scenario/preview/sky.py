"""Sun, Moon, Earth and shadow over a scenario: as a table, as lines for a person, and as advice where it was not asked for.

The boresight is that of a lidar whose PTU stands on its demand. In a local world there is no Earth and no Moon, and a Sun
only where the scenario says so.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rso_lidar import units
from rso_lidar.orbit.sky.geometry import (
    angle_outside_field_rad,
    angle_rad,
    beta_angle_rad,
    earth_angular_radius_rad,
    earth_limb_angle_rad,
    is_earth_lit,
    line_altitude_m,
    phase_angle_rad,
)
from rso_lidar.orbit.sky.moon import moon_position_m
from rso_lidar.orbit.sky.sun import sun_position_m
from rso_lidar.pose import ROOT, turned
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.geometry import Preview


@dataclass(frozen=True, eq=False)
class SkyGeometry:
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
        covers: np.ndarray = self.outside_field_rad(-self.position_m) <= earth_angular_radius_rad(self.position_m)
        return covers

    @property
    def earth_side(self) -> str:
        """Return in words which side of the Earth is in the field while its disk is."""
        assert self.sun_m is not None
        lit = is_earth_lit(self.boresight, self.position_m, self.sun_m)[self.earth_in_field]
        if lit.all():
            return "its day side"
        return f"its day side {np.mean(lit):.0%} of that" if lit.any() else "its night side"

    def outside_field_rad(self, direction: np.ndarray) -> np.ndarray:
        """Return by how much (time) [rad] directions in root axes lie outside of the field of view."""
        return angle_outside_field_rad(turned(np.swapaxes(self.root_from_lidar, -1, -2), direction), self.half_field)


def sky_geometry(mission: Mission, seen: Preview) -> SkyGeometry:
    """Return what the lidar has about it at the epochs of a preview."""
    shape = (len(seen.time_s), 3)
    position_m = np.broadcast_to(seen.states["follower"].position_m, shape)
    half_field = np.array([mission.instrument.at(float(time_s)).receiver.field_edge for time_s in seen.time_s])
    _, turn = seen.truth.poses.place(ROOT, "lidar")
    if mission.local:
        sun_m = None
        if mission.world.sun_direction is not None:
            sun_m = position_m + units.ASTRONOMICAL_UNIT_M * seen.truth.sun_direction  # one direction from everywhere
        return SkyGeometry(position_m, turn, half_field, sun_m, None, False, np.full(shape[0], True))
    sun_m, moon_m = sun_position_m(seen.epochs), moon_position_m(seen.epochs)
    return SkyGeometry(position_m, turn, half_field, sun_m, moon_m, True, seen.truth.sunlit["follower"] > 0.0)


def environment_table(mission: Mission, seen: Preview) -> dict[str, np.ndarray]:
    """Return columns (time) by name at the epochs of a preview, each name with its unit; what is not there has no column.

    The boresight's angles to Sun, Moon and limb; the Earth's angular radius; for each body in orbit beta and the share of
    the Sun that it sees; for each target its distance, phase angle, and how high the line to it passes over the Earth.
    """
    around = sky_geometry(mission, seen)
    columns: dict[str, np.ndarray | None] = {
        "time_s": seen.time_s,
        "sun_angle_rad": around.sun_angle_rad,
        "moon_angle_rad": around.moon_angle_rad,
        "earth_limb_angle_rad": around.earth_limb_angle_rad,
        "earth_radius_rad": earth_angular_radius_rad(around.position_m) if around.earth else None,
    }
    for body in mission.bodies:
        if body.orbits and around.sun_m is not None:
            columns[f"{body.name}_beta_rad"] = beta_angle_rad(seen.states[body.name], around.sun_m)
        if around.earth:
            columns[f"{body.name}_sunlit_fraction"] = np.asarray(seen.truth.sunlit[body.name])
    for target in mission.target:
        line_m = _line_m(seen, target.name)
        columns[f"{target.name}_range_m"] = np.sqrt(np.sum(line_m**2, axis=-1))
        if around.sun_m is not None:
            columns[f"{target.name}_phase_angle_rad"] = phase_angle_rad(
                line_m,
                np.zeros_like(line_m),
                around.sun_m - around.position_m,  # all seen from the follower
            )
        if around.earth:
            columns[f"{target.name}_line_height_m"] = line_of_sight_height_m(seen, target.name)
    return {name: values for name, values in columns.items() if values is not None}


def _line_m(seen: Preview, target: str) -> np.ndarray:
    """Return the vector (time, 3) [m] from the follower's origin to a target's, in root axes."""
    poses = seen.truth.poses
    line = turned(poses.place(ROOT, "follower")[1], poses.place("follower", target)[0])
    return np.broadcast_to(line, (len(seen.time_s), 3))


def line_of_sight_height_m(seen: Preview, target: str) -> np.ndarray:
    """Return how high [m] the line from follower to target passes; NaN where an end of it is below the Earth's surface."""
    ends = [seen.states[name].position_m for name in ("follower", target)]
    buried = np.isnan(earth_angular_radius_rad(ends[0])) | np.isnan(earth_angular_radius_rad(ends[1]))
    return np.where(buried, np.nan, line_altitude_m(*ends))
