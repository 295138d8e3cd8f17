"""Sun, Moon and Earth about the lidar over a run.

In a local world there is no Earth and no Moon, and there is a Sun only where the scenario gives its direction.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rso_lidar import units
from rso_lidar.motion import Chief, find_moon_m
from rso_lidar.orbit import (
    angle_rad,
    beta_angle_rad,
    earth_angular_radius_rad,
    earth_limb_angle_rad,
    line_altitude_m,
    phase_angle_rad,
    subtract_center,
    sun_position_m,
)
from rso_lidar.pose import ROOT, rotate_vectors
from rso_lidar.records import BodyState
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.mission.moon_missions import list_lunar_bodies
from rso_lidar.scenario.preview.geometry import Preview


@dataclass(frozen=True, eq=False)
class SkyGeometry:
    """Sun, Moon and Earth about the lidar at the epochs of a preview.

    `position_m`, `sun_m` and `moon_m` (time, 3) are positions of the follower, the Sun and the Moon in root axes [m]. They
    are None for a body that does not exist. `root_from_lidar` (…, 3, 3) are rotation matrices. `half_field` (time, 2)
    holds the tangents of the half field to the right and down. `sun_seen` (time) states whether the Earth leaves any part
    of the Sun visible.
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
        """Unit vectors along the boresight (time, 3) in root axes."""
        ahead = rotate_vectors(self.root_from_lidar, np.array([0.0, 0.0, 1.0]))
        return np.broadcast_to(ahead, self.position_m.shape)

    @cached_property
    def sun_angle_rad(self) -> np.ndarray | None:
        """Angle (time) [rad] from the boresight to the Sun's centre."""
        return None if self.sun_m is None else angle_rad(self.boresight, self.sun_m - self.position_m)

    @cached_property
    def moon_angle_rad(self) -> np.ndarray | None:
        """Angle (time) [rad] from the boresight to the Moon's centre, as seen from the follower."""
        return None if self.moon_m is None else angle_rad(self.boresight, self.moon_m - self.position_m)

    @cached_property
    def earth_limb_angle_rad(self) -> np.ndarray | None:
        """Angle (time) [rad] from the boresight to the Earth's limb, negative where the boresight meets the Earth."""
        return earth_limb_angle_rad(self.boresight, self.position_m) if self.earth else None

    @cached_property
    def earth_in_field(self) -> np.ndarray:
        """Whether (time) the Earth's disk overlaps the field of view; false below its surface."""
        if not self.earth:
            return np.full(len(self.position_m), False)
        covers: np.ndarray = self.outside_field_rad(-self.position_m) <= earth_angular_radius_rad(self.position_m)
        return covers

    @property
    def earth_side(self) -> str:
        """Words for the side of the Earth that is in the field while its disk is."""
        assert self.sun_m is not None
        lit = is_earth_lit(self.boresight, self.position_m, self.sun_m)[self.earth_in_field]
        if lit.all():
            return "its day side"
        return f"its day side {np.mean(lit):.0%} of that" if lit.any() else "its night side"

    def outside_field_rad(self, direction: np.ndarray) -> np.ndarray:
        """Return the angle (time) [rad] between directions in root axes and the edge of the field of view."""
        return angle_outside_field_rad(
            rotate_vectors(np.swapaxes(self.root_from_lidar, -1, -2), direction), self.half_field
        )


def compute_sky_geometry(mission: Mission, preview: Preview) -> SkyGeometry:
    """Compute Sun, Moon and Earth about the lidar at the epochs of a preview."""
    shape = (len(preview.time_s), 3)
    position_m = np.broadcast_to(preview.states["follower"].position_m, shape)
    half_field = np.array([mission.instrument.at(float(time_s)).receiver.field_edge for time_s in preview.time_s])
    _, turn = preview.truth.poses.place(ROOT, "lidar")
    if mission.is_local:
        sun_m = None
        if mission.world.sun_direction is not None:
            sun_m = (
                position_m + units.ASTRONOMICAL_UNIT_M * preview.truth.sun_direction
            )  # the direction is the same everywhere
        return SkyGeometry(position_m, turn, half_field, sun_m, None, False, np.full(shape[0], True))
    sun_m, moon_m = sun_position_m(preview.epochs), find_moon_m(mission.bodies, preview.epochs)
    return SkyGeometry(position_m, turn, half_field, sun_m, moon_m, True, preview.truth.sunlit["follower"] > 0.0)


def tabulate_environment(mission: Mission, preview: Preview) -> dict[str, np.ndarray]:
    """Tabulate the environment at the epochs of a preview as columns (time) by name, each name with its unit.

    The columns are the boresight's angles to Sun, Moon and limb, and the Earth's angular radius. Each body in orbit adds
    its beta angle and the fraction of the Sun that it sees. Each target adds its distance, its phase angle, and the height
    at which the line to it passes the Earth. A quantity that does not exist has no column.
    """
    around = compute_sky_geometry(mission, preview)
    columns: dict[str, np.ndarray | None] = {
        "time_s": preview.time_s,
        "sun_angle_rad": around.sun_angle_rad,
        "moon_angle_rad": around.moon_angle_rad,
        "earth_limb_angle_rad": around.earth_limb_angle_rad,
        "earth_radius_rad": earth_angular_radius_rad(around.position_m) if around.earth else None,
    }
    for body in mission.bodies:
        if body.orbits and around.sun_m is not None:
            columns[f"{body.name}_beta_rad"] = beta_angle_rad(about_center(mission, preview, body.name), around.sun_m)
        if around.earth:
            columns[f"{body.name}_sunlit_fraction"] = np.asarray(preview.truth.sunlit[body.name])
    for target in mission.target:
        line_m = _line_m(preview, target.name)
        columns[f"{target.name}_range_m"] = np.sqrt(np.sum(line_m**2, axis=-1))
        if around.sun_m is not None:
            columns[f"{target.name}_phase_angle_rad"] = phase_angle_rad(
                line_m,
                np.zeros_like(line_m),
                around.sun_m - around.position_m,  # relative to the follower
            )
        if around.earth:
            columns[f"{target.name}_line_height_m"] = line_of_sight_height_m(preview, target.name)
            if (over_moon_m := line_height_over_moon_m(mission, preview, target.name)) is not None:
                columns[f"{target.name}_line_height_over_moon_m"] = over_moon_m
    return {name: values for name, values in columns.items() if values is not None}


def _line_m(preview: Preview, target: str) -> np.ndarray:
    """Return the vector (time, 3) [m] from the follower's origin to that of a target, in root axes."""
    poses = preview.truth.poses
    line = rotate_vectors(poses.place(ROOT, "follower")[1], poses.place("follower", target)[0])
    return np.broadcast_to(line, (len(preview.time_s), 3))


def line_of_sight_height_m(preview: Preview, target: str) -> np.ndarray:
    """Return the height (time) [m] at which the line from follower to target passes the Earth.

    It is NaN where an end of the line is below the Earth's surface.
    """
    ends = preview.states["follower"].position_m, preview.states[target].position_m
    buried = np.isnan(earth_angular_radius_rad(ends[0])) | np.isnan(earth_angular_radius_rad(ends[1]))
    return np.where(buried, np.nan, line_altitude_m(*ends))


def line_height_over_moon_m(mission: Mission, preview: Preview, target: str) -> np.ndarray | None:
    """Return the height (time) [m] at which the line from follower to target passes the Moon.

    Returns
    -------
    None if the follower does not orbit about the Moon
    """
    if "follower" not in list_lunar_bodies(mission.bodies):
        return None
    moon_m = find_moon_m(mission.bodies, preview.epochs)
    own_m, target_m = (preview.states[name].position_m - moon_m for name in ("follower", target))
    return line_altitude_m(own_m, target_m, units.MOON_RADIUS_M)


def about_center(mission: Mission, preview: Preview, name: str) -> BodyState:
    """Return the states (time, 3) of a body about the centre of the Earth, or of the Moon if it orbits about that."""
    return subtract_center(preview.states[name], Chief(mission.bodies, name).center_states(preview.epochs))


def is_earth_lit(boresight: np.ndarray, position_m: np.ndarray, sun_m: np.ndarray) -> np.ndarray:
    """Determine whether the Earth is in daylight (time,) where a boresight meets it, or at the nearest point of its limb.

    Parameters
    ----------
    boresight : (time, 3) direction in root axes, of any length
    position_m, sun_m : (time, 3) position of the observer and of the Sun [m]
    """
    ahead = boresight / np.sqrt(np.sum(boresight**2, axis=-1, keepdims=True))
    distance = np.sqrt(np.sum(position_m**2, axis=-1))
    along = -np.sum(position_m * ahead, axis=-1)
    inside = (
        along**2 - distance**2 + units.EARTH_RADIUS_M**2
    )  # discriminant of the ray's first intersection with the sphere
    met = position_m + (along - np.sqrt(np.maximum(inside, 0.0)))[..., None] * ahead
    # limb point in the plane of boresight and Earth's centre, at the central angle acos(R / r) from the nadir point
    up = position_m / distance[..., None]
    aside = ahead - np.sum(ahead * up, axis=-1)[..., None] * up
    aside = aside / np.maximum(np.sqrt(np.sum(aside**2, axis=-1)), 1e-300)[..., None]
    cosine = np.minimum(units.EARTH_RADIUS_M / distance, 1.0)
    limb = cosine[..., None] * up + np.sqrt(1.0 - cosine**2)[..., None] * aside
    place = np.where(((inside > 0.0) & (along > 0.0))[..., None], met, limb)
    lit: np.ndarray = np.sum(place * sun_m, axis=-1) > 0.0
    return lit


def angle_outside_field_rad(direction: np.ndarray, half_field: np.ndarray) -> np.ndarray:
    """Return the angle (time,) [rad] from a rectangular field of view to directions, 0 inside the field.

    A disk of angular radius q about the direction overlaps the field where this angle is at most q.

    Parameters
    ----------
    direction : (time, 3) in lidar axes, +z the boresight, of any length
    half_field : (time, 2) or (2,) tangents of the half angles to the right and down
    """
    unit = direction / np.maximum(np.sqrt(np.sum(direction**2, axis=-1, keepdims=True)), 1e-300)
    # the field is symmetric: fold the direction into the quadrant with x and y positive
    x, y, z = np.abs(unit[..., 0]), np.abs(unit[..., 1]), unit[..., 2]
    right, down = np.broadcast_to(half_field[..., 0], x.shape), np.broadcast_to(half_field[..., 1], x.shape)
    over_x, over_y = x - right * z, y - down * z
    inside = (over_x <= 0.0) & (over_y <= 0.0) & (z > 0.0)
    corner = angle_rad(np.stack([x, y, z], axis=-1), np.stack([right, down, np.ones_like(x)], axis=-1))
    best = corner
    for over, across, along, edge, reach in ((over_x, x, y, right, down), (over_y, y, x, down, right)):
        norm = np.sqrt(1.0 + edge**2)
        foot = (
            z + edge * across
        ) / norm  # projection of the direction onto the plane of the edge, along the middle of the edge
        on_edge = (over > 0.0) & (foot > 0.0) & (along * norm <= reach * foot)
        best = np.where(on_edge, np.arcsin(np.clip(over / norm, -1.0, 1.0)), best)
    angle: np.ndarray = np.where(inside, 0.0, best)
    return angle
