"""Earthshine: sunlight that the Earth reflects onto targets, and that they reflect to the lens.

The light of each hit is a sum over directions, drawn evenly over the Earth's disc. Where the material has a lobe, half of
them are drawn from it instead. The balance heuristic weighs the two (Veach and Guibas, 1995), so that neither a small Earth
nor a narrow lobe is missed. Directions follow a sequence that depends on the number of the ray only, not on the seed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rso_lidar import units
from rso_lidar.kernels import packed
from rso_lidar.lit_earth import earth_radiance
from rso_lidar.parallel import run_in_threads
from rso_lidar.pose import ROOT, rotate_vectors
from rso_lidar.records import Hits, Truth
from rso_lidar.scene.bounces.path_starts import STEPS, number_facets
from rso_lidar.scene.bounces.scattering import find_lobes, localize_points, scatter_per_sr
from rso_lidar.scene.casting.first_hits import split_by_surface
from rso_lidar.scene.casting.local_hits import LocalHits, dot
from rso_lidar.scene.casting.shadows import find_shadowed
from rso_lidar.scene.materials.lobe import direction_density, draw_directions
from rso_lidar.scene.surfaces.surface import Surface

DIRECTIONS = 16  # of each hit
_DISC_STEPS = (0.7548776662466927, 0.5698402909980532)  # as STEPS, of two numbers: powers of the root of x^3 = x + 1
_BAND_HITS = 8192


def add_earthshine(
    hits: Hits, surfaces: Sequence[Surface], truth: Truth, albedo: float, threads: int | None = None
) -> Hits:
    """Add light of the Earth to the sunlight of hits.

    Parameters
    ----------
    hits : first facets that rays meet, with the sunlight on each; without, nothing is added
    surfaces : the surfaces of all targets, each in its own axes
    truth : one epoch: where the surfaces are, with the state of each body about the Earth
    albedo : of the Earth
    threads : number of threads (None: one for each core). The result is the same to the bit

    Returns
    -------
    The hits with both lights in `sunlight_per_sr`.
    """
    if hits.sunlight_per_sr is None:
        return hits
    surfaces, light = tuple(surfaces), hits.sunlight_per_sr.copy()
    number, facet = number_facets(hits, surfaces)
    direction = hits.rays.direction[hits.ray]

    def add(k: int, on: np.ndarray) -> None:
        disc = locate_earth(surfaces[k], truth)
        if disc is not None:
            points = localize_points(surfaces, k, truth, direction[on], facet[on], hits.range_m[on])
            light[on] += gather(points, hits.ray[on], disc, albedo)

    pieces = split_by_surface(number, len(surfaces), _BAND_HITS)
    run_in_threads(threads, lambda piece: add(*piece), pieces)
    return replace(hits, sunlight_per_sr=light)


@dataclass(frozen=True, eq=False)
class EarthDisc:
    """The Earth as a body sees it: `earth` and `sun` are vectors (xyz) to the centres in the surface's axes [m]."""

    earth: np.ndarray
    sun: np.ndarray

    @property
    def cos_radius(self) -> float:
        """Cosine of the Earth's angular radius."""
        return math.sqrt(1.0 - (units.EARTH_RADIUS_M / float(np.linalg.norm(self.earth))) ** 2)

    @property
    def solid_angle_sr(self) -> float:
        """Solid angle of the Earth [sr]."""
        return 2.0 * math.pi * (1.0 - self.cos_radius)

    def contains(self, direction: np.ndarray) -> np.ndarray:
        """Return whether directions (xyz, hit) meet the Earth (hit)."""
        ahead = self.earth / np.linalg.norm(self.earth)
        met: np.ndarray = dot(ahead[:, None], direction) > self.cos_radius
        return met

    def draw(self, uniform: np.ndarray) -> np.ndarray:
        """Draw directions (xyz, hit) evenly over the disc, by numbers from 0 to 1 (2, hit)."""
        ahead = self.earth / np.linalg.norm(self.earth)
        across = np.cross(ahead, np.eye(3)[int(np.argmin(np.abs(ahead)))])
        across /= np.linalg.norm(across)
        up = np.cross(ahead, across)
        cosine = 1.0 - uniform[0] * (1.0 - self.cos_radius)
        sine, turn = np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0)), 2.0 * math.pi * uniform[1]
        drawn: np.ndarray = (
            ahead[:, None] * cosine + across[:, None] * (sine * np.cos(turn)) + up[:, None] * (sine * np.sin(turn))
        )
        return drawn


def locate_earth(surface: Surface, truth: Truth) -> EarthDisc | None:
    """Locate the Earth in the axes of a surface.

    Returns
    -------
    The Earth's disc; None below its surface, and where none of its day side is visible.
    """
    state, to_sun = truth.states.get(surface.body), np.asarray(truth.sun_direction, dtype=float).reshape(3)
    if state is None or not np.all(np.isfinite(to_sun)):
        return None
    place_m = np.asarray(state.position_m, dtype=float).reshape(3)
    distance_m = float(np.linalg.norm(place_m))
    if distance_m <= units.EARTH_RADIUS_M:
        return None
    # The visible cap reaches acos(R / r) from the point below: it is all night where the Sun is further down than that.
    sine = float(place_m @ to_sun) / (distance_m * float(np.linalg.norm(to_sun)))
    if sine <= -math.sqrt(1.0 - (units.EARTH_RADIUS_M / distance_m) ** 2):
        return None
    turn = truth.poses.place(surface.name, ROOT)[1]
    sun_m = units.ASTRONOMICAL_UNIT_M * to_sun / np.linalg.norm(to_sun) - place_m
    return EarthDisc(rotate_vectors(turn, -place_m), rotate_vectors(turn, sun_m))


def gather(points: LocalHits, ray: np.ndarray, disc: EarthDisc, albedo: float) -> np.ndarray:
    """Gather the light of the Earth that each point reflects to the lens, over the Sun's irradiance (hit) [1/sr].

    Cube corners get none: they return light to where it came from.

    Parameters
    ----------
    ray : (hit) number of the ray, which chooses the directions
    disc : the Earth in the axes of that surface
    """
    lobes = find_lobes(points)
    about = packed(lobes), packed(points.base), packed(points.normal), packed(points.to_viewer)
    is_open = ~points.surface.is_retro[points.facet] & (points.base_cos_out > 0.0)
    has_lobe = lobes[:, 0] > 0.0
    total, half = np.zeros(len(ray)), DIRECTIONS // 2
    toward_earth = np.where(has_lobe, half, DIRECTIONS)  # number of directions that are drawn over the disc
    reach_m = np.full(len(ray), np.inf)
    for k in range(DIRECTIONS):
        place = ray.astype(float) * DIRECTIONS + k + 1.0
        toward = disc.draw(np.stack([(place * step) % 1.0 for step in _DISC_STEPS]))
        if k >= half and has_lobe.any():
            uniform = np.stack([(place * step) % 1.0 for step in STEPS])
            toward = np.where(has_lobe, draw_directions(packed(uniform), *about), toward)
        density = toward_earth * (disc.contains(toward) / disc.solid_angle_sr)
        if has_lobe.any():
            density = density + np.where(has_lobe, half * direction_density(packed(toward), *about), 0.0)
        light = np.where(disc.contains(toward), earth_radiance(toward.T, disc.earth, disc.sun, albedo), 0.0)
        cosine = np.maximum(dot(points.base, toward), 0.0)
        asked = is_open & (light > 0.0) & (cosine > 0.0) & (density > 0.0)
        asked[find_shadowed(points, asked, packed(toward), reach_m)] = False
        on = np.flatnonzero(asked)
        brdf = scatter_per_sr(points.only(on), toward[:, on], points.to_viewer[:, on])
        total[on] += brdf * cosine[on] * light[on] / density[on]
    return total
