"""Rays meet facets: embree finds which, float64 says where.

Embree works in float32, so rays are moved into each target's axes, cast from a point near the target, and the range is
taken from the facet's plane in float64. Rays are cast in bands on threads; what a band gives does not depend on how many
there are. The loops of `cast_loops.py` do it in packets, all targets at once; below them stands the reference in NumPy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rso_lidar import pose
from rso_lidar.arithmetic import packed
from rso_lidar.records import Hits, Rays, Truth
from rso_lidar.scene.casting.bands import BAND_RAYS, NEAREST_M, at_once, bands_of
from rso_lidar.scene.casting.light import from_laser, from_sun, seen
from rso_lidar.scene.embree import engine as packets
from rso_lidar.scene.surfaces.surface import Surface

if TYPE_CHECKING:
    from rso_lidar.scene.casting.cast_loops import Targets


def cast(
    rays: Rays,
    surfaces: Sequence[Surface],
    truth: Truth,
    threads: int | None = None,
    *,
    laser_from_m: ArrayLike | None = None,
    sun: bool = False,
    aperture_m: float = 0.0,
) -> Hits:
    """Return the first facet that each ray meets, over the surfaces of all targets.

    `threads` is the number of bands cast at once (None: one for each core); it does not change the result.
    `laser_from_m` (xyz) is where the laser is, in lidar axes [m]; None, or zeros, is in the lens. Beside it, incidence is
    the laser's, 0 in shadow, and the BRDF takes both directions. `sun` asks for the sunlight too. Lobes narrower than the
    lens are averaged over its diameter `aperture_m` [m].
    """
    engine = packets.engine()
    first = (
        _first(rays, surfaces, truth, threads)
        if engine is None
        else _in_packets(rays, surfaces, truth, threads, engine)
    )
    number, facet = first.number, first.facet
    hits = Hits(
        rays=rays,
        ray=first.ray,
        pixel=first.pixel,
        weight=first.weight,
        target=first.target,
        facet=first.source_facet,
        part=first.part,
        range_m=first.range_m,
        cos_incidence=first.cosine,
        brdf_per_sr=first.brdf_per_sr,
    )
    laser = np.zeros(3) if laser_from_m is None else np.asarray(laser_from_m, dtype=float)
    if sun or laser.any() or any(surface.bent for surface in surfaces):
        hits = _relit(hits, number, facet, surfaces, truth, threads, laser, sun=sun)
    return _average_over_lens(hits, number, facet, surfaces, laser, aperture_m)


def _average_over_lens(
    hits: Hits,
    number: np.ndarray,
    facet: np.ndarray,
    surfaces: Sequence[Surface],
    laser_from_m: np.ndarray,
    aperture_m: float,
) -> Hits:
    """Return the hits with the lobes of retro-reflectors averaged over the lens."""
    retros = [(n, k, m) for n, one in enumerate(surfaces) for k, m in enumerate(one.materials) if m.is_retro]
    if not retros:
        return hits
    brdf = hits.brdf_per_sr.copy()
    for k, of, material in retros:
        on = np.flatnonzero(number == k)
        on = on[surfaces[k].finish[facet[on]] == of]
        direction, range_m = hits.rays.direction[hits.ray[on]], hits.range_m[on]
        brdf[on] = material.average_over_lens(brdf[on], direction, range_m, laser_from_m, aperture_m)
    return replace(hits, brdf_per_sr=brdf)


def _relit(
    hits: Hits,
    number: np.ndarray,
    facet: np.ndarray,
    surfaces: Sequence[Surface],
    truth: Truth,
    threads: int | None,
    laser_from_m: np.ndarray,
    *,
    sun: bool,
) -> Hits:
    """Return the hits in the light of a laser beside the lens and of the Sun, curved parts shaded as curved."""
    cosine, brdf = hits.cos_incidence.copy(), hits.brdf_per_sr.copy()
    sunlight = np.zeros(len(facet)) if sun else None

    def light(k: int, on: np.ndarray) -> None:
        surface, direction = surfaces[k], hits.rays.direction[hits.ray[on]]
        here = seen(surfaces, k, truth, direction, facet[on], hits.range_m[on], cosine[on])
        if laser_from_m.any():
            cosine[on], brdf[on] = from_laser(here, laser_from_m)
        elif surface.bent:
            cosine[on], brdf[on] = here.base_cos_out, here.own_brdf_per_sr()
        if sunlight is not None:
            sunlight[on] = from_sun(here)

    pieces = []
    for k, of_surface in _by_surface(number, len(surfaces)):
        pieces += [(k, of_surface[start : start + BAND_RAYS]) for start in range(0, len(of_surface), BAND_RAYS)]
    at_once(threads, lambda piece: light(*piece), pieces)
    return replace(hits, cos_incidence=cosine, brdf_per_sr=brdf, sunlight_per_sr=sunlight)


class _First(NamedTuple):
    """The first hits of rays, in their order: what `Hits` holds, and which surface and which of its facets (hit)."""

    ray: np.ndarray
    pixel: np.ndarray
    weight: np.ndarray
    target: np.ndarray
    number: np.ndarray
    facet: np.ndarray
    part: np.ndarray
    source_facet: np.ndarray
    range_m: np.ndarray
    cosine: np.ndarray
    brdf_per_sr: np.ndarray


@lru_cache(maxsize=4)
def _targets(surfaces: tuple[Surface, ...], engine: packets.Engine) -> tuple[tuple[packets.PacketScene, ...], Targets]:
    """Return the surfaces of a scenario as the loops want them, once for all its frames, and the scenes that these name."""
    from rso_lidar.scene.casting.cast_loops import Targets

    scenes = tuple(surface.packets(engine) for surface in surfaces)
    count = np.array([0] + [len(surface.facets) for surface in surfaces], dtype=np.int64)

    def row(columns: list[np.ndarray], dtype: type, shape: tuple[int, ...] = (0,)) -> np.ndarray:
        return np.concatenate([np.empty(shape), *columns]).astype(dtype)

    return scenes, Targets(
        np.array([scene.address for scene in scenes], dtype=np.int64),
        np.array([[*surface.sphere[0], surface.sphere[1]] for surface in surfaces]).reshape(-1, 4),
        _numbers(surfaces),
        np.cumsum(count)[:-1],
        row([surface.planes.T for surface in surfaces], np.float64, (0, 4)),
        row([surface.part for surface in surfaces], np.int16),
        row([surface.mesh.source_facet for surface in surfaces], np.int32),
        row([surface.lambertian_per_sr for surface in surfaces], np.float64),
    )


def _numbers(surfaces: Sequence[Surface]) -> np.ndarray:
    """Return the number of the target of each surface."""
    of = [k if surface.target is None else surface.target for k, surface in enumerate(surfaces)]
    return np.array(of, dtype=np.int16)


def _in_packets(
    rays: Rays, surfaces: Sequence[Surface], truth: Truth, threads: int | None, engine: packets.Engine
) -> _First:
    """Return the first hits on all surfaces, by the loops."""
    from rso_lidar.scene.casting.cast_loops import Columns, cast_rays

    _held, targets = _targets(tuple(surfaces), engine)  # scenes are good while they are held
    origin, turn = np.empty((len(surfaces), 3)), np.empty((len(surfaces), 3, 3))
    for k, surface in enumerate(surfaces):
        origin[k], turn[k] = truth.poses.place(surface.name, "lidar")
    columns = Columns(packed(rays.direction.T), packed(rays.pixel), packed(rays.weight))

    def meet(band: slice) -> tuple[np.ndarray, ...]:
        return cast_rays(columns, band.start, band.stop, targets, origin, turn, engine.intersect, engine.width)

    n_rays = len(rays.pixel)
    bands = [slice(start, min(start + BAND_RAYS, n_rays)) for start in range(0, n_rays, BAND_RAYS)]
    if threads == 1 or len(bands) < 2:
        first = _First(*meet(slice(0, n_rays)))
    else:
        pieces = at_once(threads, meet, bands)
        first = _First(*(np.concatenate(column) for column in zip(*pieces, strict=True)))
    if not all(surface.is_lambertian for surface in surfaces):
        for k, on in _by_surface(first.number, len(surfaces)):
            if not surfaces[k].is_lambertian:
                first.brdf_per_sr[on] = surfaces[k].brdf_per_sr(first.facet[on], first.cosine[on])
    return first


def _by_surface(number: np.ndarray, n_surfaces: int) -> list[tuple[int, np.ndarray]]:
    """Return each surface that is hit, and its hits in their order."""
    if n_surfaces == 1:
        return [(0, np.arange(len(number)))] if len(number) else []
    order = np.argsort(number, kind="stable")
    edges = np.searchsorted(number[order], np.arange(n_surfaces + 1))
    return [(k, order[a:b]) for k, (a, b) in enumerate(pairwise(edges.tolist())) if a < b]


# ------------------------------------------------------------------------------------------- the reference, in NumPy


def _first(rays: Rays, surfaces: Sequence[Surface], truth: Truth, threads: int | None) -> _First:
    """Return the first hits on all surfaces."""
    met = [_met(rays, surface, truth, threads, alone=len(surfaces) == 1) for surface in surfaces]
    ray, number, facet, range_m, cosine = met[0].of(0) if len(met) == 1 else _nearest(met, len(rays.pixel))
    brdf, part, source_facet = _surface_of(surfaces, number, facet, cosine)
    return _First(
        ray,
        rays.pixel[ray],
        rays.weight[ray],
        _numbers(surfaces)[number],
        number,
        facet,
        part,
        source_facet,
        range_m,
        cosine,
        brdf,
    )


class _Met(NamedTuple):
    """Where rays met one surface: ray, facet, range [m] and cos α of each hit, in the order of the rays."""

    ray: np.ndarray
    facet: np.ndarray
    range_m: np.ndarray
    cosine: np.ndarray

    def of(self, number: int) -> tuple[np.ndarray, ...]:
        """Return ray, number of the surface, facet, range and cos α, all on one surface."""
        return self.ray, np.full(len(self.ray), number, dtype=np.int16), self.facet, self.range_m, self.cosine


def _met(rays: Rays, surface: Surface, truth: Truth, threads: int | None, *, alone: bool) -> _Met:
    """Return the hits on one surface, as if it were alone."""
    target_from_lidar = truth.poses.place(surface.name, "lidar")
    direction, pixel, aimed = rays.direction, rays.pixel, None
    if not alone:
        aimed = _aimed(rays, surface, target_from_lidar)
        direction, pixel = direction[aimed], pixel[aimed]
    bands = bands_of(pixel, rays.shape[1])
    meet = partial(_meet, surface, target_from_lidar, direction)
    several = threads != 1 and len(bands) > 1
    found = at_once(threads, meet, bands) if several else [meet(slice(0, len(pixel)))]
    met = _Met(*(np.concatenate(column) if len(found) > 1 else column[0] for column in zip(*found, strict=True)))
    return met if aimed is None else met._replace(ray=aimed[met.ray])


def _nearest(met: Sequence[_Met], n_rays: int) -> tuple[np.ndarray, ...]:
    """Return ray, surface, facet, range and cos α of the nearest hit of each ray that hits anything."""
    range_m = np.full(n_rays, np.inf)
    cosine = np.zeros(n_rays)
    number = np.full(n_rays, -1, dtype=np.int16)
    facet = np.zeros(n_rays, dtype=np.int32)
    for k, hits in enumerate(met):
        nearer = np.flatnonzero(hits.range_m < range_m[hits.ray])
        ray = hits.ray[nearer]
        number[ray] = k
        range_m[ray], cosine[ray], facet[ray] = hits.range_m[nearer], hits.cosine[nearer], hits.facet[nearer]
    ray = np.flatnonzero(number >= 0)
    return ray, number[ray], facet[ray], range_m[ray], cosine[ray]


def _aimed(rays: Rays, surface: Surface, target_from_lidar: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Return the rays that pass the sphere about a target."""
    (centre, radius), (origin, rotation) = surface.sphere, target_from_lidar
    toward = pose.turned(rotation.T, centre - origin)
    distance_m = float(np.linalg.norm(toward))
    if distance_m <= radius:
        return np.arange(len(rays.pixel))
    # By how far unit vectors end apart, which is exact for narrow cones where a cosine is not.
    sine = radius / distance_m
    reach = sine * math.sqrt(2.0 / (1.0 + math.sqrt(1.0 - sine**2)))
    apart2 = ((rays.direction - toward / distance_m) ** 2).sum(axis=1)
    return np.flatnonzero(apart2 <= (1.0 + 1e-6) * reach**2 + 1e-24)


def _meet(
    surface: Surface, target_from_lidar: tuple[np.ndarray, np.ndarray], direction: np.ndarray, band: slice
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return ray, facet, range [m] and cos α of the hits of one band of rays on one target."""
    centre, radius = surface.sphere
    origin, rotation = target_from_lidar
    # Rays start 1 % and 1 cm before the sphere about the target, where float32 is fine, and no facet lies behind them.
    start_m = max(0.0, float(np.linalg.norm(centre - origin)) - 1.01 * radius - 0.01)
    x, y, z = direction[band].T
    turned = [row[0] * x + row[1] * y + row[2] * z for row in rotation]  # no BLAS: its bits change with the band
    start, along = np.empty((len(x), 3), np.float32), np.empty((len(x), 3), np.float32)
    for axis in range(3):
        along[:, axis] = turned[axis]
        start[:, axis] = origin[axis] + start_m * turned[axis]
    found = surface.embree.run(start, along, query="INTERSECT", output=1)
    ray = np.flatnonzero(found["primID"] >= 0)
    facet = found["primID"][ray]
    plane = surface.planes
    normal = [plane[axis][facet] for axis in range(3)]
    cosine = normal[0] * turned[0][ray] + normal[1] * turned[1][ray] + normal[2] * turned[2][ray]
    above = plane[3][facet] - (normal[0] * origin[0] + normal[1] * origin[1] + normal[2] * origin[2])
    rough = start_m + found["tfar"][ray].astype(float)
    with np.errstate(divide="ignore", invalid="ignore"):
        exact = above / cosine
    # Seen edge-on, a facet's plane says nothing about range: there, and only there, embree's own distance stands. That
    # is good to some 1e-6 of the target's size; a thousand times that apart, the ray is within 1e-3 rad of the plane.
    grazing = ~(np.abs(exact - rough) <= 1e-3 * (1.0 + 2.0 * radius))
    range_m = np.where(grazing, rough, exact)
    apart = range_m > NEAREST_M
    found = ray + (band.start or 0), facet, range_m, np.minimum(np.abs(cosine), 1.0)
    return found if apart.all() else tuple(column[apart] for column in found)


def _surface_of(
    surfaces: Sequence[Surface], number: np.ndarray, facet: np.ndarray, cosine: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return BRDF [1/sr], part and the source file's facet number of each hit."""
    brdf, part, source_facet = np.zeros(len(facet)), np.zeros(len(facet), np.int16), np.zeros(len(facet), np.int32)
    for k, surface in enumerate(surfaces):
        on = np.flatnonzero(number == k) if len(surfaces) > 1 else slice(None)
        brdf[on] = surface.brdf_per_sr(facet[on], cosine[on])
        part[on] = surface.part[facet[on]]
        source_facet[on] = surface.mesh.source_facet[facet[on]]
    return brdf, part, source_facet
