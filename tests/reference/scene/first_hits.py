"""First hits of rays in NumPy, by embreex, which asks embree for one ray after another: the oracle of
`rso_lidar.scene.casting.first_hits`.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple
from unittest import mock

import numpy as np

from rso_lidar import pose
from rso_lidar.records import Rays, Truth
from rso_lidar.scene import Surface
from rso_lidar.scene.casting.first_hits import NEAREST_M, FirstHits, target_numbers
from tests.reference.scene.shadows import find_shadowed


@contextmanager
def reference_casting() -> Iterator[None]:
    """Have `scene.cast` find hits and shadows by the reference inside."""
    with (
        mock.patch("rso_lidar.scene.casting.cast.find_first_hits", find_first_hits),
        mock.patch("rso_lidar.scene.casting.cast.find_shadowed", find_shadowed),
    ):
        yield


def find_first_hits(rays: Rays, surfaces: Sequence[Surface], truth: Truth, *_: object) -> FirstHits:
    """Return the first hits on all surfaces."""
    met = [_met(rays, surface, truth, alone=len(surfaces) == 1) for surface in surfaces]
    ray, number, facet, range_m, cosine = met[0].of(0) if len(met) == 1 else _nearest(met, len(rays.pixel))
    brdf, part, source_facet = _surface_of(surfaces, number, facet, cosine)
    return FirstHits(
        ray,
        rays.pixel[ray],
        rays.weight[ray],
        target_numbers(surfaces)[number],
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


def _met(rays: Rays, surface: Surface, truth: Truth, *, alone: bool) -> _Met:
    """Return the hits on one surface, as if it were alone."""
    target_from_lidar = truth.poses.place(surface.name, "lidar")
    direction, aimed = rays.direction, None
    if not alone:
        aimed = _aimed(rays, surface, target_from_lidar)
        direction = direction[aimed]
    met = _Met(*_meet(surface, target_from_lidar, direction))
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
    toward = pose.rotate_vectors(rotation.T, centre - origin)
    distance_m = float(np.linalg.norm(toward))
    if distance_m <= radius:
        return np.arange(len(rays.pixel))
    # By how far unit vectors end apart, which is exact for narrow cones where a cosine is not.
    sine = radius / distance_m
    reach = sine * math.sqrt(2.0 / (1.0 + math.sqrt(1.0 - sine**2)))
    apart2 = ((rays.direction - toward / distance_m) ** 2).sum(axis=1)
    return np.flatnonzero(apart2 <= (1.0 + 1e-6) * reach**2 + 1e-24)


def _meet(
    surface: Surface, target_from_lidar: tuple[np.ndarray, np.ndarray], direction: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return ray, facet, range [m] and cos α of the hits on one target."""
    centre, radius = surface.sphere
    origin, rotation = target_from_lidar
    # Rays start 1 % and 1 cm before the sphere about the target, where float32 is fine, and no facet lies behind them.
    start_m = max(0.0, float(np.linalg.norm(centre - origin)) - 1.01 * radius - 0.01)
    x, y, z = direction.T
    turned = [row[0] * x + row[1] * y + row[2] * z for row in rotation]
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
    found = ray, facet, range_m, np.minimum(np.abs(cosine), 1.0)
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
