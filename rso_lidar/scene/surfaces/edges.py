"""Edges between the facets of a surface: where its brightness may change abruptly as the lidar sees it."""

from dataclasses import dataclass

import numpy as np

from rso_lidar.scene.surfaces.geometry_cache import GeometryCache
from rso_lidar.scene.surfaces.surface import Surface

NONE = -1  # instead of a facet or corner


@dataclass(frozen=True, eq=False)
class FacetEdges:
    """Edges between facets, each once.

    Attributes
    ----------
    points : (point, xyz) f8 [m], corners of facets in body axes, each position once
    ends : (edge, 2) i4, points at both ends
    facets : (edge, 2) i4, the two facets; the second is `NONE` on a rim, and where more than two meet
    beyond : (edge, 2) i4, the third corner of each of them
    """

    points: np.ndarray
    ends: np.ndarray
    facets: np.ndarray
    beyond: np.ndarray


def find_edges(surface: Surface) -> FacetEdges:
    """Return the edges of a surface, found once for each geometry."""
    return _cache.get(surface)


def _collect(surface: Surface) -> FacetEdges:
    corners = surface.corners.reshape(-1, 3)
    as_bytes = np.ascontiguousarray(corners.astype(np.float32) + np.float32(0.0)).view(np.dtype((np.void, 12))).ravel()
    _, first, point = np.unique(as_bytes, return_index=True, return_inverse=True)
    points = np.ascontiguousarray(corners[first])
    triangle = point.reshape(-1, 3)
    sides = np.concatenate([triangle[:, [0, 1]], triangle[:, [1, 2]], triangle[:, [2, 0]]])
    beyond = np.concatenate([triangle[:, 2], triangle[:, 0], triangle[:, 1]])
    facet = np.tile(np.arange(len(triangle)), 3)
    sides.sort(axis=1)
    proper = sides[:, 0] != sides[:, 1]
    sides, beyond, facet = sides[proper], beyond[proper], facet[proper]
    key = sides[:, 0] * np.int64(len(points)) + sides[:, 1]
    order = np.argsort(key, kind="stable")
    key, sides, beyond, facet = key[order], sides[order], beyond[order], facet[order]
    start = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]])) if len(key) else np.empty(0, np.int64)
    count = np.diff(np.append(start, len(key)))
    pair = count == 2
    second = np.where(pair, start + 1, start)
    facets = np.stack([facet[start], np.where(pair, facet[second], NONE)], axis=1)
    others = np.stack([beyond[start], np.where(pair, beyond[second], NONE)], axis=1)
    columns = [np.ascontiguousarray(one.astype(np.int32)) for one in (sides[start], facets, others)]
    for values in (points, *columns):
        values.flags.writeable = False
    return FacetEdges(points, *columns)


_cache = GeometryCache(_collect)
