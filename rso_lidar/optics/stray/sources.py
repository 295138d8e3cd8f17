"""Sun, lit Earth and Moon as the lens sees them: their radiance in every direction, and elements of their light.

Radiance is relative: in units of the Sun's irradiance at the Earth, so per steradian. The Sun is a disc of even radiance at
1 au. The Earth is a Lambertian sphere of its equatorial radius without an atmosphere. The Moon's lit part has an even
radiance, so that its total follows Allen's phase law. Each body hides those behind it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from rso_lidar import units
from rso_lidar.lit_earth import earth_radiance
from rso_lidar.pose import ROOT
from rso_lidar.records import Truth

SUN, EARTH, MOON = range(3)
STRAY_BODIES = ("sun", "earth", "moon")
# Allen, Astrophysical Quantities, 3rd ed. (1973), sec. 66: V magnitudes of the Sun and, at phase 0, of the mean Moon.
_SUN_MAGNITUDE, _FULL_MOON_MAGNITUDE, _MEAN_MOON_M = -26.74, -12.73, 384_401e3
_SUN_POINTS, _MOON_POINTS, _SMALL_EARTH_POINTS = 64, 32, 400
_SMALL_EARTH_RAD = 5.0 * units.DEG  # a smaller Earth is cut into points of equal solid angle
_GROWTH = 0.12  # step of rings of elements over their angle from the boresight
_MOST_RINGS = 96  # in and near the field
_PER_RADIUS = 12  # least number of elements across the radius of the Earth's disk


@dataclass(frozen=True, eq=False)
class SkyBodies:
    """Where the bodies are, seen from the lens.

    `sun`, `earth` and `moon` are vectors (xyz) toward their centres in lidar axes [m], None for a body that does not exist.
    `sunlit` is the share of the Sun's disc that the Earth leaves visible.
    """

    sun: np.ndarray | None
    earth: np.ndarray | None
    moon: np.ndarray | None
    sunlit: float
    earth_albedo: float

    @cached_property
    def sun_radius_rad(self) -> float:
        """Angular radius of the Sun [rad]."""
        return _angular_radius(self.sun, units.SUN_RADIUS_M)

    @cached_property
    def earth_radius_rad(self) -> float:
        """Angular radius of the Earth [rad]; 90 degrees on its surface."""
        return _angular_radius(self.earth, units.EARTH_RADIUS_M)

    @cached_property
    def moon_radius_rad(self) -> float:
        """Angular radius of the Moon [rad]."""
        return _angular_radius(self.moon, units.MOON_RADIUS_M)

    @cached_property
    def moon_irradiance(self) -> float:
        """Irradiance of the Moon over that of the Sun."""
        if self.moon is None or self.sun is None:
            return 0.0
        distance_m = float(np.linalg.norm(self.moon))
        phase = _angle(self.sun - self.moon, -self.moon)
        return moon_over_sun(phase) * (_MEAN_MOON_M / distance_m) ** 2

    def radiance(
        self, direction: np.ndarray, bodies: tuple[int, ...], cell_rad: float | np.ndarray = 0.0
    ) -> np.ndarray:
        """Return the radiance (…) over the Sun's irradiance [1/sr], each body hiding those behind it.

        Parameters
        ----------
        direction : (…, 3) unit vectors in lidar axes
        bodies : whose light is wanted; the others are dark, but hide what is behind them
        cell_rad : width of the cell about each direction [rad], over which the edges of the disks are averaged
        """
        radiance_per_sr = np.zeros(direction.shape[:-1])
        if self.sun is None:
            return radiance_per_sr
        for body, place, radius in (
            (SUN, self.sun, self.sun_radius_rad),
            (MOON, self.moon, self.moon_radius_rad),
            (EARTH, self.earth, self.earth_radius_rad),
        ):  # from the farthest to the nearest
            if place is None:
                continue
            apart = _separation(direction, place)
            cover = np.clip(0.5 + (radius - apart) / np.maximum(cell_rad, 1e-15), 0.0, 1.0)
            light: float | np.ndarray = 0.0
            if body in bodies:
                # Of a cell on the edge, the middle of the part on the disk: the limb is darker than what is inside it.
                over = np.maximum(apart - (radius - 0.5 * cover * cell_rad), 0.0)
                at = _move_toward(direction, place, over) if np.any(over) else direction
                light = (self._sun_radiance, self.earth_light, self._moon_radiance)[body](at)
            radiance_per_sr = radiance_per_sr * (1.0 - cover) + cover * light
        return radiance_per_sr

    def _sun_radiance(self, direction: np.ndarray) -> np.ndarray:
        """Return the radiance (…) of the Sun's disc."""
        return np.full(direction.shape[:-1], 1.0 / _solid_angle(self.sun_radius_rad))

    def _moon_radiance(self, direction: np.ndarray) -> np.ndarray:
        """Return the radiance (…) of the Moon's lit part; 0 on its dark part, and meaningless beside the disc."""
        assert self.moon is not None
        assert self.sun is not None
        ahead, to_sun = self.moon / np.linalg.norm(self.moon), self.sun - self.moon
        across = (direction - np.sum(direction * ahead, axis=-1)[..., None] * ahead) / math.sin(self.moon_radius_rad)
        depth = np.sqrt(np.maximum(1.0 - np.sum(across * across, axis=-1), 0.0))
        is_lit = np.sum((across - depth[..., None] * ahead) * to_sun, axis=-1) > 0.0
        share = 0.5 * (1.0 + math.cos(_angle(to_sun, -self.moon)))
        level = self.moon_irradiance / max(_solid_angle(self.moon_radius_rad) * share, 1e-300)
        return np.where(is_lit, level, 0.0)

    def earth_light(self, direction: np.ndarray) -> np.ndarray:
        """Return the radiance (…) of the Earth over the Sun's irradiance [1/sr], in directions that meet it."""
        assert self.earth is not None
        assert self.sun is not None
        return earth_radiance(direction, self.earth, self.sun, self.earth_albedo)

    def elements(self, body: int, field_rad: float, knee_rad: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the elements of one body that the plane of the lens sees.

        Parameters
        ----------
        field_rad : half the diagonal of the field [rad], in which the Earth is cut finely
        knee_rad : angle over which the scatter of the lens changes [rad]

        Returns
        -------
        Direction (element, xyz), irradiance over that of the Sun (element), and radius of a disc of the element's solid
        angle [rad] (element).
        """
        place = (self.sun, self.earth, self.moon)[body]
        if place is None or self.sun is None:
            return np.empty((0, 3)), np.empty(0), np.empty(0)
        if body == EARTH:
            direction, solid_sr, cell_rad = self._cut_earth(field_rad, knee_rad)
        else:
            radius, n = (self.sun_radius_rad, _SUN_POINTS) if body == SUN else (self.moon_radius_rad, _MOON_POINTS)
            direction = _disc_points(place, radius, n)
            solid_sr, cell_rad = np.full(n, _solid_angle(radius) / n), np.zeros(n)
        light = self.radiance(direction, (body,), cell_rad) * solid_sr
        if body == MOON and light.any():
            assert self.moon is not None
            is_clear = (
                self.earth is None or _angle(self.moon, self.earth) > self.earth_radius_rad + self.moon_radius_rad
            )
            light = light * (self.moon_irradiance / light.sum() if is_clear else 1.0)
        if body == SUN and (
            self.moon is None or _angle(self.sun, self.moon) > self.sun_radius_rad + self.moon_radius_rad
        ):
            # The visible share of the disc is known exactly; a sliver of it may lie between the elements.
            free = light > 0.0 if light.any() else np.full(len(light), True)
            light = free * (self.sunlit / np.count_nonzero(free))
        some = np.flatnonzero((light > 0.0) & (direction[:, 2] > 0.0))
        return direction[some], light[some], np.sqrt(solid_sr[some] / math.pi)

    def _cut_earth(self, field_rad: float, knee_rad: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return directions (element, xyz), solid angles [sr] and widths [rad] (element) of cells that cover the Earth.

        A near Earth is cut into cells of rings about the boresight, which are narrow in and near the field.

        Parameters
        ----------
        field_rad, knee_rad : as for `elements`
        """
        assert self.earth is not None
        radius = self.earth_radius_rad
        if radius < _SMALL_EARTH_RAD:
            n = _SMALL_EARTH_POINTS
            return _disc_points(self.earth, radius, n), np.full(n, _solid_angle(radius) / n), np.zeros(n)
        if _angle(np.array([0.0, 0.0, 1.0]), self.earth) - radius > 0.5 * math.pi:
            return np.empty((0, 3)), np.empty(0), np.empty(0)
        near = min(field_rad + 3.0 * knee_rad, 0.5 * math.pi)
        edges = list(np.linspace(0.0, near, min(math.ceil(2.0 * near / knee_rad), _MOST_RINGS) + 1))
        while edges[-1] < 0.5 * math.pi:
            edges.append(min(edges[-1] + min(_GROWTH * edges[-1], radius / _PER_RADIUS), 0.5 * math.pi))
        directions, solid = [], []
        for low, high in pairwise(edges):
            middle = math.acos(0.5 * (math.cos(low) + math.cos(high)))  # equal solid angles to both sides
            n = max(48, math.ceil(2.0 * math.pi * math.sin(middle) / min(radius / _PER_RADIUS, 0.2)))
            turn = (np.arange(n) + 0.5) * (2.0 * math.pi / n)
            sine = math.sin(middle)
            directions.append(
                np.stack([sine * np.cos(turn), sine * np.sin(turn), np.full(n, math.cos(middle))], axis=1)
            )
            solid.append(np.full(n, 2.0 * math.pi * (math.cos(low) - math.cos(high)) / n))
        cells, solid_sr = np.concatenate(directions), np.concatenate(solid)
        width_rad = np.sqrt(solid_sr)
        limb = np.cos(np.minimum(radius + width_rad, math.pi))
        some = np.flatnonzero(cells @ (self.earth / np.linalg.norm(self.earth)) >= limb)
        return cells[some], solid_sr[some], width_rad[some]


def locate_bodies(truth: Truth, moon_m: np.ndarray | None, earth_albedo: float, *, has_earth: bool) -> SkyBodies:
    """Locate Sun, Earth and Moon in lidar axes.

    Parameters
    ----------
    moon_m : (xyz) position of the Moon in root axes [m]; None without a Moon
    has_earth : whether the root's origin is the centre of the Earth
    """
    lidar_from_root = np.asarray(truth.poses.place("lidar", ROOT)[1])
    state = truth.states.get("follower")
    place_m = np.zeros(3) if state is None else np.asarray(state.position_m, dtype=float).reshape(3)
    sun = np.asarray(truth.sun_direction, dtype=float).reshape(3)
    to_sun = None
    if np.all(np.isfinite(sun)):
        to_sun = units.ASTRONOMICAL_UNIT_M * sun / np.linalg.norm(sun) - (place_m if has_earth else 0.0)
    above = has_earth and float(np.linalg.norm(place_m)) > units.EARTH_RADIUS_M
    to_moon = None if moon_m is None else np.asarray(moon_m, dtype=float).reshape(3) - place_m
    in_lidar = [
        None if vector is None else lidar_from_root @ vector
        for vector in (to_sun, -place_m if above else None, to_moon)
    ]
    sunlit = float(np.asarray(truth.sunlit.get("follower", 1.0))) if has_earth else 1.0
    return SkyBodies(in_lidar[0], in_lidar[1], in_lidar[2], sunlit, earth_albedo)


def moon_over_sun(phase_rad: float) -> float:
    """Return the irradiance of the Moon at its mean distance over that of the Sun, in visible light.

    Allen (1973): V = -12.73 + 0.026 |α| + 4e-9 α⁴, α the phase in degrees. Beyond 150 degrees the law is extrapolated.

    Parameters
    ----------
    phase_rad : angle Sun-Moon-observer [rad], 0 at full Moon
    """
    degrees = abs(phase_rad) / units.DEG
    magnitude = _FULL_MOON_MAGNITUDE + 0.026 * degrees + 4e-9 * degrees**4
    return float(10.0 ** (-0.4 * (magnitude - _SUN_MAGNITUDE)))


def _angular_radius(place: np.ndarray | None, radius_m: float) -> float:
    """Return the angular radius of a sphere [rad]; 0 for one that does not exist."""
    if place is None:
        return 0.0
    return math.asin(min(radius_m / float(np.linalg.norm(place)), 1.0))


def _solid_angle(radius_rad: float) -> float:
    """Return the solid angle of a disc [sr]."""
    return 4.0 * math.pi * math.sin(0.5 * radius_rad) ** 2


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    """Return the angle between two vectors [rad]."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def _separation(direction: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return the angle (…) between directions (…, 3) and a place (xyz) [rad]."""
    across = np.cross(direction, place)
    angle: np.ndarray = np.arctan2(np.sqrt(np.sum(across * across, axis=-1)), np.sum(direction * place, axis=-1))
    return angle


def _move_toward(direction: np.ndarray, place: np.ndarray, angle_rad: np.ndarray) -> np.ndarray:
    """Return directions moved toward a place.

    Parameters
    ----------
    direction : (…, 3) unit vectors
    place : (xyz) vector toward the place
    angle_rad : (…) how far they move [rad]
    """
    ahead = place / np.linalg.norm(place)
    across = ahead - np.sum(direction * ahead, axis=-1)[..., None] * direction
    across /= np.maximum(np.sqrt(np.sum(across * across, axis=-1)), 1e-300)[..., None]
    moved: np.ndarray = np.cos(angle_rad)[..., None] * direction + np.sin(angle_rad)[..., None] * across
    return moved


def _disc_points(place: np.ndarray, radius_rad: float, n: int) -> np.ndarray:
    """Return unit vectors (point, xyz) to points of equal weight on a disc: a sunflower of golden angles."""
    ahead = place / np.linalg.norm(place)
    across = np.cross(ahead, np.eye(3)[int(np.argmin(np.abs(ahead)))])
    across /= np.linalg.norm(across)
    up = np.cross(ahead, across)
    share = (np.arange(n) + 0.5) / n
    angle = 2.0 * np.arcsin(np.sqrt(share) * math.sin(0.5 * radius_rad))  # equal shares of the solid angle
    turn = np.arange(n) * (math.pi * (3.0 - math.sqrt(5.0)))
    sine = np.sin(angle)
    points: np.ndarray = (
        np.cos(angle)[:, None] * ahead + (sine * np.cos(turn))[:, None] * across + (sine * np.sin(turn))[:, None] * up
    )
    return points
