"""Exposure: points on the facets of a target, and which of them see the source of light or of air."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar.kernels import packed
from rso_lidar.scene.casting.shadows import OFF_THE_FACET, cut_rays
from rso_lidar.scene.embree.engine import engine
from rso_lidar.scene.surfaces.surface import Surface

_EACH = 2.0  # facets over points up to which every facet has a point of its own
_INSIDE = 1.001  # how far within its edges the outermost point of a facet lies
_BITS = 10  # of each coordinate: 1024 cells along the longest side
_STEP = (0.7548776662466927, 0.5698402909980532)  # R2 sequence: inverse powers of the plastic number (Roberts 2018)


@dataclass(frozen=True, eq=False)
class FacetPoints:
    """Points on the facets of one surface, each for a share of the area.

    Attributes
    ----------
    position : (xyz, point) f8, in the axes of the surface [m]
    normal : (xyz, point) f8, unit normal of the facet, by winding
    area : (point) f8, area that the point stands for [m2]
    part : (point), number of the part
    """

    position: np.ndarray
    normal: np.ndarray
    area: np.ndarray
    part: np.ndarray


def spread_points(surface: Surface, count: int) -> FacetPoints:
    """Spread points over the facets of a surface, as evenly as their areas allow.

    The points of a facet have its centroid. Facets with the same corners share one area. Where facets are more than twice
    as many as points, single facets stand for their neighbours in the mesh.

    Parameters
    ----------
    surface : the surface
    count : number of points, about
    """
    corners = surface.corners
    areas = surface.areas_m2 / _count_copies(corners)
    step = areas.sum() / count
    if len(areas) <= _EACH * count:
        number = np.maximum(np.rint(areas / step), 1.0).astype(int)
        weight = areas / number
    else:
        number = np.diff(np.floor(np.append(0.0, np.cumsum(areas)) / step + 0.5)).astype(int)
        weight = np.where(number > 1, areas / np.maximum(number, 1), step)
        weight *= areas.sum() / float(weight @ number)
    facet = np.repeat(np.arange(len(areas)), number)
    k = np.arange(len(facet)) - np.repeat(np.cumsum(number) - number, number)
    u, v = (np.mod(0.5 + (k + 1) * step_k, 1.0) for step_k in _STEP)
    folded = u + v > 1.0
    u, v = np.where(folded, 1.0 - u, u), np.where(folded, 1.0 - v, v)
    shares = np.stack([1.0 - u - v, u, v], axis=1)  # of the three corners
    middle = np.stack([np.bincount(facet, share, len(areas)) for share in shares.T], axis=1)
    away = shares - (middle / np.maximum(number, 1)[:, None])[facet]
    # Points drawn in to the centroid until all lie in their facet: one beyond an edge would see past its neighbour.
    beyond = np.ones(len(areas))
    np.maximum.at(beyond, facet, -3.0 * away.min(axis=1) * _INSIDE)
    points = np.einsum("pc,pcx->px", 1.0 / 3.0 + away / beyond[facet, None], corners[facet])
    near = _order_by_place(points)  # neighbours meet the same facets: their rays take half the time in one packet
    facet = facet[near]
    return FacetPoints(packed(points[near].T), packed(surface.planes[:3, facet]), weight[facet], surface.part[facet])


def _order_by_place(points: np.ndarray) -> np.ndarray:
    """Return the order of points (point, xyz) along Morton's curve (Morton 1966), on which neighbours are near in space."""
    away = points - points.min(axis=0)
    cell = (away / max(float(away.max()), 1e-300) * (2**_BITS - 1)).astype(np.int64)
    place = np.zeros(len(points), np.int64)
    for bit in range(_BITS):
        for axis in range(3):
            place |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(place, kind="stable")


def _count_copies(corners: np.ndarray) -> np.ndarray:
    """Return how many facets have the same three corners (facet, corner, xyz) as each (facet)."""
    single = np.sort(corners.astype(np.float32).view([("x", "f4"), ("y", "f4"), ("z", "f4")])[..., 0], axis=1)
    as_bytes = np.ascontiguousarray(single).view(np.dtype((np.void, 36))).ravel()
    _, inverse, count = np.unique(as_bytes, return_inverse=True, return_counts=True)
    copies: np.ndarray = count[inverse.reshape(-1)]
    return copies


def find_free(
    position: np.ndarray,
    facing: np.ndarray,
    toward: np.ndarray,
    surfaces: Sequence[Surface],
    poses: Sequence[tuple[np.ndarray, np.ndarray]],
) -> np.ndarray:
    """Find the points from which no surface hides the source.

    Parameters
    ----------
    position, facing, toward : (xyz, point) in body axes: points [m], normals of the sides that are asked for, and unit
        vectors toward the source
    surfaces : all surfaces of the target
    poses : of each surface, its origin (xyz) [m] and rotation (3, 3) in body axes

    Returns
    -------
    (point) bool
    """
    count = position.shape[1]
    left = np.full(count, np.inf)
    size = max(
        float(np.linalg.norm(surface.sphere[0] + pose[0])) + surface.sphere[1]
        for surface, pose in zip(surfaces, poses, strict=True)
    )
    rays = packed(position), packed(facing), OFF_THE_FACET * size, packed(toward)
    embree = engine()
    for surface, (origin, turn) in zip(surfaces, poses, strict=True):
        scene, sphere = surface.scene(embree), np.append(*surface.sphere)
        placed = packed(-turn.T @ origin), packed(turn.T), packed(sphere)
        cut_rays(left, *rays, *placed, embree.occluded, scene.address, embree.width)
        embree.check()
    free: np.ndarray = left > 0.0
    return free
