"""Light that does not come from the lens: a laser beside it, the Sun, and what stands in their way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rso_lidar.pose import ROOT, turned
from rso_lidar.records import Truth
from rso_lidar.scene.embree import engine as packets
from rso_lidar.scene.materials.crinkle import unhidden
from rso_lidar.scene.materials.scatterer import SUN_RADIUS_RAD, Scatterer
from rso_lidar.scene.surfaces.surface import Surface

_TIE = 1e-6  # components of a direction that differ by less are equal, whatever rounding says
_OFF_THE_FACET = 1e-5  # of the surface's size: a hundred steps of float32, so that no facet shades itself


@dataclass(frozen=True)
class Seen:
    """What the lidar sees of one surface, hit by hit, in the surface's axes.

    `point`, `to_viewer`, `facing` (the facet's normal), `base` (on smooth parts the interpolated one) and `normal` (the one
    that the BRDF gets, on crinkled foil a cell's) are (xyz, hit); all are on the viewer's side, with cosines `base_cos_out`
    and `cos_out` from the last two. `slope` is that of crinkled foil, 0 elsewhere. `number` is the surface's place among
    all `surfaces`.
    """

    surfaces: Sequence[Surface]
    number: int
    truth: Truth
    target_from_lidar: tuple[np.ndarray, np.ndarray]
    facet: np.ndarray
    point: np.ndarray
    to_viewer: np.ndarray
    facing: np.ndarray
    base: np.ndarray
    base_cos_out: np.ndarray
    normal: np.ndarray
    cos_out: np.ndarray
    slope: np.ndarray

    @property
    def surface(self) -> Surface:
        """Return the surface that is seen."""
        return self.surfaces[self.number]

    @cached_property
    def crinkled(self) -> np.ndarray:
        """Return which hits are on crinkled foil."""
        return np.flatnonzero(self.slope > 0.0)

    @cached_property
    def shown(self) -> np.ndarray:
        """Return by how much (hit) more a cell shows to the viewer than a flat piece would; 1 where nothing is crinkled."""
        shown = np.ones(len(self.facet))
        on = self.crinkled
        cos_tilt = _dot(self.normal[:, on], self.base[:, on])
        shown[on] = self.cos_out[on] / np.maximum(self.base_cos_out[on] * cos_tilt, 1e-9)
        return shown

    def own_brdf_per_sr(self) -> np.ndarray:
        """Return the BRDF [1/sr] (hit) for light from the lens: what the lens sees of a cell, light from there meets."""
        brdf = self.surface.brdf_per_sr(self.facet, self.cos_out)
        on = self.crinkled
        cosine = self.base_cos_out[on]
        brdf[on] *= self.shown[on] * self.cos_out[on] / np.maximum(cosine, 1e-9)
        brdf[on] *= unhidden(cosine, cosine, 1.0, self.slope[on])
        return brdf


def seen(
    surfaces: Sequence[Surface],
    number: int,
    truth: Truth,
    direction: np.ndarray,
    facet: np.ndarray,
    range_m: np.ndarray,
    cosine: np.ndarray,
) -> Seen:
    """Return how the hits of rays `direction` (hit, xyz) on one surface face the lidar.

    `cosine` is that of the facet; on smooth parts it gives way to that of the interpolated normal, 0 where that turns away.
    """
    surface = surfaces[number]
    target_from_lidar = truth.poses.place(surface.name, "lidar")
    along = _turned(target_from_lidar, direction.T)
    point = target_from_lidar[0][:, None] + range_m * along
    plane = np.stack([surface.planes[axis][facet] for axis in range(3)])
    side = np.where(_dot(plane, along) > 0.0, -1.0, 1.0)
    facing = side * plane
    base, base_cos_out = facing, cosine
    if surface.smooth:
        base = side * surface.shading_normals(facet, point.T).T
        smooth = surface.is_smooth[facet]
        base_cos_out = np.where(smooth, np.clip(-_dot(base, along), 0.0, 1.0), cosine)
    normal, cos_out, slope = base, base_cos_out, np.zeros(len(facet))
    if surface.crinkled:
        normal, cos_out, finish = base.copy(), base_cos_out.copy(), surface.finish[facet]
        for of, material in surface.crinkled.items():
            on = np.flatnonzero(finish == of)
            slope[on] = material.rms_slope
            normal[:, on] = material.tilt_normals(base[:, on], point[:, on])
            cos_out[on] = np.clip(-_dot(normal[:, on], along[:, on]), 0.0, 1.0)
    return Seen(
        surfaces,
        number,
        truth,
        target_from_lidar,
        facet,
        point,
        -along,
        facing,
        base,
        base_cos_out,
        normal,
        cos_out,
        slope,
    )


def from_laser(hits: Seen, laser_from_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return cos α and BRDF [1/sr] of hits that a laser at `laser_from_m` [m] in lidar axes lights.

    cos α is 0 where the laser is on the facet's other side from the lens, or something stands between. Cube corners have the
    BRDF toward the laser, of which `RetroReflector.average_over_lens` gives the mean over the lens.
    """
    (origin, turn) = hits.target_from_lidar
    laser = (origin + turned(turn, laser_from_m))[:, None] - hits.point
    distance_m = np.sqrt(_dot(laser, laser))
    to_laser = laser / distance_m
    lit = _dot(hits.facing, to_laser) > 0.0
    cos_in = np.where(lit, np.clip(_dot(hits.base, to_laser), 0.0, 1.0), 0.0)
    cos_in[_shaded(hits, cos_in > 0.0, to_laser, distance_m)] = 0.0
    cos_phase = np.clip(_dot(to_laser, hits.to_viewer), -1.0, 1.0)
    on = hits.crinkled
    met = cos_in.copy()  # on crinkled foil, the cosine at which light meets the cell
    met[on] = np.where(cos_in[on] > 0.0, np.clip(_dot(hits.normal[:, on], to_laser[:, on]), 0.0, 1.0), 0.0)
    lobe = np.where(hits.surface.is_retro[hits.facet], 1.0, cos_phase)
    brdf = hits.surface.brdf_per_sr(hits.facet, met, hits.cos_out, lobe)
    brdf[on] *= met[on] / np.maximum(cos_in[on], 1e-9) * hits.shown[on]
    brdf[on] *= unhidden(cos_in[on], hits.base_cos_out[on], cos_phase[on], hits.slope[on])
    return cos_in, brdf


def from_sun(hits: Seen) -> np.ndarray:
    """Return BRDF times cosine of incidence [1/sr] of the Sun's light toward the lidar, times the free share of its disc.

    Over lobes that change within the disc the product is averaged, by two rings of six points (Gauss in the square of the
    radius: exact for polynomials of degree five in the offset): good to a few per cent for lobes down to half the disc.
    The shadow's edge is sharp: the ray goes to the middle of the disc.
    """
    lit = np.zeros(len(hits.facet))
    sun = np.asarray(hits.truth.sun_direction, dtype=float)
    share = float(np.asarray(hits.truth.sunlit.get(hits.surface.body, 1.0)))
    if not np.all(np.isfinite(sun)) or share <= 0.0 or not len(lit):
        return lit
    to_sun = turned(hits.truth.poses.place(hits.surface.name, ROOT)[1], sun / np.linalg.norm(sun))
    toward = np.repeat(to_sun[:, None], len(lit), axis=1)
    up = (_dot(hits.facing, toward) > 0.0) & (hits.cos_out > 0.0)
    up[_shaded(hits, up, toward, np.full(len(up), np.inf))] = False
    on = np.flatnonzero(up)
    ring = _disc(to_sun)

    def ask(material: Scatterer, of: np.ndarray) -> np.ndarray:
        normal, to_viewer, cos_out = hits.normal[:, on[of]], hits.to_viewer[:, on[of]], hits.cos_out[on[of]]
        points = ring if material.is_narrow else to_sun[None]
        total = np.zeros(len(of))
        for point in points:
            cos_in = np.clip(_dot(normal, point), 0.0, 1.0)
            cos_phase = np.clip(_dot(to_viewer, point), -1.0, 1.0)
            total += cos_in * material.sunlight_brdf_per_sr(cos_in, cos_out, cos_phase)
        slope = hits.slope[on[of]]
        if material.rms_slope > 0.0:
            cos_in, cos_phase = _dot(hits.base[:, on[of]], to_sun), _dot(to_viewer, to_sun)
            total *= hits.shown[on[of]] * unhidden(cos_in, hits.base_cos_out[on[of]], cos_phase, slope)
        return total / len(points)

    lit[on] = share * hits.surface.by_material(hits.facet[on], ask)
    return lit


def _disc(to_sun: np.ndarray) -> np.ndarray:
    """Return unit vectors (point, xyz) to points of equal weight on the Sun's disc."""
    slant = np.abs(to_sun)
    across = np.cross(to_sun, np.eye(3)[np.argmax(slant < slant.min() + _TIE)])
    across /= np.linalg.norm(across)
    upward = np.cross(to_sun, across)
    radius = np.repeat(np.sqrt(0.5 + np.array([-1.0, 1.0]) / np.sqrt(12.0)), 6) * SUN_RADIUS_RAD
    angle = (np.arange(12) + 0.5 * (np.arange(12) // 6)) * np.pi / 3.0
    points = to_sun + np.tan(radius)[:, None] * (np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * upward)
    disc: np.ndarray = points / np.linalg.norm(points, axis=1, keepdims=True)
    return disc


def _shaded(hits: Seen, asked: np.ndarray, toward: np.ndarray, reach_m: np.ndarray) -> np.ndarray:
    """Return the hits, of those asked for, from which a ray `toward` (xyz, hit) meets a surface within its reach [m]."""
    centre, radius = hits.surface.sphere
    off_m = _OFF_THE_FACET * (radius + float(np.linalg.norm(centre)))
    engine = packets.engine()
    if engine is not None:
        return _met_in_packets(hits, asked, toward, reach_m, off_m, engine)
    index = np.flatnonzero(asked)
    start, toward = hits.point[:, index] + off_m * hits.facing[:, index], toward[:, index]
    shaded = np.zeros(len(index), dtype=bool)
    for number, other in enumerate(hits.surfaces):
        if number == hits.number:
            shaded |= _occluded(other, start, toward, reach_m[index])
        else:
            other_from_here = hits.truth.poses.place(other.name, hits.surface.name)
            there = other_from_here[0][:, None] + _turned(other_from_here, start)
            shaded |= _occluded(other, there, _turned(other_from_here, toward), reach_m[index])
    return index[shaded]


def _met_in_packets(
    hits: Seen, asked: np.ndarray, toward: np.ndarray, reach_m: np.ndarray, off_m: float, engine: packets.Engine
) -> np.ndarray:
    """Return what `_shaded` does, by the loops."""
    from rso_lidar.scene.embree.packets import add_met

    met = np.zeros(len(asked), dtype=bool)
    point, facing, toward = (np.ascontiguousarray(vectors) for vectors in (hits.point, hits.facing, toward))
    for number, other in enumerate(hits.surfaces):
        origin, turn = np.zeros(3), np.eye(3)
        if number != hits.number:
            origin[:], turn[:] = hits.truth.poses.place(other.name, hits.surface.name)
        scene, sphere = other.packets(engine), np.append(*other.sphere)
        at = (origin, turn, sphere, engine.occluded, scene.address, engine.width)
        add_met(met, asked, point, facing, off_m, toward, reach_m, *at)
    return np.flatnonzero(met)


def _occluded(surface: Surface, start: np.ndarray, toward: np.ndarray, reach_m: np.ndarray) -> np.ndarray:
    """Return whether rays (xyz, ray) in a surface's axes meet it within their reach [m]."""
    centre, radius = surface.sphere
    to_centre = centre[:, None] - start
    ahead = _dot(to_centre, toward)
    beside2 = _dot(to_centre, to_centre) - ahead**2
    met = np.zeros(len(ahead), dtype=bool)
    ray = np.flatnonzero((beside2 <= (1.01 * radius) ** 2 + 1e-4) & (ahead > -1.01 * radius))
    # As the lidar's rays do, these start just before the sphere about the target, where float32 is fine.
    skipped = np.maximum(ahead[ray] - 1.01 * radius - 0.01, 0.0)
    ray, skipped = ray[skipped < reach_m[ray]], skipped[skipped < reach_m[ray]]
    if len(ray):
        near = (start[:, ray] + skipped * toward[:, ray]).T
        left = (reach_m[ray] - skipped).astype(np.float32)
        found = surface.embree.run(
            np.ascontiguousarray(near, np.float32),
            np.ascontiguousarray(toward[:, ray].T, np.float32),
            left,
            query="OCCLUDED",
        )
        met[ray] = found >= 0
    return met


def _turned(a_from_b: tuple[np.ndarray, np.ndarray], vectors: np.ndarray) -> np.ndarray:
    """Return vectors (xyz, ray) turned from axes b to axes a, element by element."""
    matrix = a_from_b[1]
    x, y, z = vectors
    return np.stack([row[0] * x + row[1] * y + row[2] * z for row in matrix])


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the dot products of vectors (xyz, ray)."""
    product: np.ndarray = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product
