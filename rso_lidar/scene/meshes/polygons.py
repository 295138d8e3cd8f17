"""Polygons of mesh files, cut into triangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rso_lidar.errors import MeshError
from rso_lidar.kernels import kernel

MOST_FACETS = 20_000_000  # of one target, all instances counted: some 2 GB of acceleration structure
_MOST_STEPS = 5e8  # sum of the squares of the corners of concave polygons: some 2 s of one core
_ROUNDING = 1e-12  # of a polygon that is scaled to a size of 1
_STRICT, _TOUCHING, _CONVEX, _ANY = range(4)  # what an ear may be, where the polygon leaves no better one


class MeshPiece(NamedTuple):
    """The triangles of a mesh file that are under one name.

    Attributes
    ----------
    name : of the part
    vertices, facets : (vertex, xyz) f8, and their numbers (facet, 3)
    colours : (facet, rgb) u1, None where the file has none or cannot have any
    material : (facet), index among `material_names`; None where the file names no materials
    material_names : names of the materials of the file; an empty name is none
    """

    name: str
    vertices: np.ndarray
    facets: np.ndarray
    colours: np.ndarray | None = None
    material: np.ndarray | None = None
    material_names: tuple[str, ...] = ()


def cut_polygons(where: str, points: np.ndarray, corners: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Cut polygons into triangles, two fewer than a polygon has corners, in the order of the polygons.

    A fan from its first corner covers a polygon that is convex, or seen whole from that corner. Others lose one ear at a
    time, in the plane across their normal. A polygon that crosses itself, or has no area, has no right
    answer: it becomes as many triangles, some of which may overlap.

    Parameters
    ----------
    points : (vertex, xyz)
    sizes : (polygon), numbers of corners; below 3 for lines and points, which give no triangle

    Returns
    -------
    (facet, 3), indices of vertices.

    Raises
    ------
    MeshError
        If a corner names no vertex, there are too many triangles, or concave polygons have too many corners.
    """
    counts = np.maximum(sizes - 2, 0)
    total = int(counts.sum())
    check_facet_count(where, total)
    if len(corners) and not (corners.min() >= 0 and corners.max() < len(points)):
        raise MeshError(f"{where}: a facet names a vertex that is not in the file; export the mesh again")
    starts = np.cumsum(sizes) - sizes
    owner = np.repeat(np.arange(len(sizes)), counts)
    step = np.arange(total) - np.repeat(np.cumsum(counts) - counts, counts)
    first = starts[owner]
    places = np.stack([first, first + step + 1, first + step + 2], axis=1)  # of a fan, in `corners`
    rows = np.flatnonzero(sizes[owner] > 3)
    if len(rows):
        concave, normals = _find_concave(points[corners[places[rows]]], owner[rows], len(sizes))
        if len(concave):
            if (steps := (sizes[concave].astype(float) ** 2).sum()) > _MOST_STEPS:
                raise MeshError(
                    f"{where}: has {len(concave):,} concave polygons of up to {sizes[concave].max():,} corners, too "
                    f"many to cut ({steps:.1e} steps, over {_MOST_STEPS:.0e}); triangulate it and export it again"
                )
            places[np.isin(owner, concave)] = _cut_concave(points, corners, starts[concave], sizes[concave], normals)
    facets: np.ndarray = corners[places]
    return facets


def check_facet_count(where: str, count: int) -> None:
    """Raise `MeshError` if a mesh file has too many facets."""
    if count > MOST_FACETS:
        raise MeshError(f"{where}: holds {count:,} facets, over {MOST_FACETS:,}; decimate it and export it again")


def _find_concave(triangles: np.ndarray, owner: np.ndarray, polygons: int) -> tuple[np.ndarray, np.ndarray]:
    """Find polygons that a fan from their first corner does not cover; return their numbers and normals (polygon, xyz).

    Parameters
    ----------
    triangles : (triangle, corner, xyz) of the fans
    owner : (triangle), number of its polygon, rising
    polygons : number of polygons, 1 or more
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # what is not finite is reported by the reader
        starts = np.flatnonzero(np.diff(owner, prepend=-1))
        reach = np.maximum.reduceat(np.abs(triangles - triangles[:, :1]).max(axis=(1, 2)), starts)
        scaled = (triangles - triangles[:, :1]) / np.repeat(reach, np.diff(starts, append=len(owner)))[:, None, None]
        across = np.cross(scaled[:, 1], scaled[:, 2])
        normal = np.add.reduceat(across, starts)  # twice the area, along the normal (Newell)
        length2 = np.einsum("pi,pi->p", normal, normal)
        along = np.einsum("ti,ti->t", across, np.repeat(normal, np.diff(starts, append=len(owner)), axis=0))
        turned = np.minimum.reduceat(along, starts) < -_ROUNDING * length2
        selected = turned & (length2 > _ROUNDING**2)
        return owner[starts][selected], normal[selected] / np.sqrt(length2[selected])[:, None]


def _cut_concave(
    points: np.ndarray, corners: np.ndarray, starts: np.ndarray, sizes: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """Cut concave polygons ear by ear; return the places (triangle, 3) of the triangles' corners in `corners`.

    Parameters
    ----------
    points : as in `cut_polygons`
    starts, sizes : (polygon), place of the first corner, and number of corners
    normals : (polygon, xyz), unit vectors
    """
    first = np.cumsum(sizes) - sizes
    places = np.repeat(starts - first, sizes) + np.arange(int(sizes.sum()))
    offset = points[corners[places]] - np.repeat(points[corners[starts]], sizes, axis=0)
    offset /= np.repeat(np.maximum.reduceat(np.abs(offset).max(axis=1), first), sizes)[:, None]
    right = np.cross(np.eye(3)[np.argmin(np.abs(normals), axis=1)], normals)
    right /= np.linalg.norm(right, axis=1)[:, None]
    up = np.cross(normals, right)
    x = np.einsum("ci,ci->c", offset, np.repeat(right, sizes, axis=0))
    y = np.einsum("ci,ci->c", offset, np.repeat(up, sizes, axis=0))
    cut = np.empty((int((sizes - 2).sum()), 3), dtype=np.int64)
    _cut_ears(x, y, sizes.astype(np.int64), cut)
    return places[cut]


@kernel
def _cut_ears(x: np.ndarray, y: np.ndarray, sizes: np.ndarray, cut: np.ndarray) -> None:
    """Write the triangles of polygons that turn counter-clockwise, as places in x and y.

    Cutting an ear changes its two neighbours only (ElGindy, Everett and Toussaint 1993), so a polygon of n corners takes
    n * n steps.

    Parameters
    ----------
    x, y : (corner) of all polygons, one after the other
    sizes : (polygon), numbers of corners
    cut : (triangle, 3), filled
    """
    written = 0
    base = 0
    for polygon in range(len(sizes)):
        size = sizes[polygon]
        following = base + (np.arange(size) + 1) % size
        preceding = base + (np.arange(size) + size - 1) % size
        is_ear = np.empty(size, dtype=np.bool_)
        rule = _STRICT
        for k in range(size):
            is_ear[k] = _is_ear(x, y, base, k, preceding, following, rule)
        left = size
        at = 0
        while left > 3:
            looked = 0
            while looked < left and not is_ear[at]:
                at = following[at] - base
                looked += 1
            if looked == left:  # no ear: the polygon touches or crosses itself
                rule += 1
                for _ in range(left):
                    is_ear[at] = _is_ear(x, y, base, at, preceding, following, rule)
                    at = following[at] - base
                continue
            before, after = preceding[at] - base, following[at] - base
            cut[written, 0], cut[written, 1], cut[written, 2] = base + before, base + at, base + after
            written += 1
            left -= 1
            following[before], preceding[after] = base + after, base + before
            is_ear[before] = _is_ear(x, y, base, before, preceding, following, rule)
            is_ear[after] = _is_ear(x, y, base, after, preceding, following, rule)
            at = following[after] - base  # not the next corner, for fewer slivers
        cut[written, 0], cut[written, 1], cut[written, 2] = preceding[at], base + at, following[at]
        written += 1
        base += size


@kernel
def _is_ear(
    x: np.ndarray, y: np.ndarray, base: int, at: int, preceding: np.ndarray, following: np.ndarray, rule: int
) -> bool:
    """Return whether a corner and its neighbours are a triangle that is inside the rest of its polygon.

    Parameters
    ----------
    x, y : (corner) of all polygons
    base : index of the polygon's first corner among all (corner)
    at : number of the corner in the polygon, from 0
    preceding, following : (corner of the polygon), places of its neighbours
    rule : `_STRICT`, no corner inside or on the triangle; `_TOUCHING`, none inside; `_CONVEX`, whatever is inside; `_ANY`
    """
    a, b, c = preceding[at], base + at, following[at]
    turn = (x[b] - x[a]) * (y[c] - y[b]) - (y[b] - y[a]) * (x[c] - x[b])
    if rule == _ANY:
        return True
    if turn <= _ROUNDING if rule == _STRICT else turn < -_ROUNDING:
        return False
    if rule == _CONVEX:
        return True
    edge = _ROUNDING if rule == _TOUCHING else -_ROUNDING
    p = following[c - base]
    while p != a:
        in_ab = (x[b] - x[a]) * (y[p] - y[a]) - (y[b] - y[a]) * (x[p] - x[a]) >= edge
        in_bc = (x[c] - x[b]) * (y[p] - y[b]) - (y[c] - y[b]) * (x[p] - x[b]) >= edge
        in_ca = (x[a] - x[c]) * (y[p] - y[c]) - (y[a] - y[c]) * (x[p] - x[c]) >= edge
        if in_ab and in_bc and in_ca:
            # A hole is joined to the rim by an edge there and back, so two corners may be in one place.
            is_a = abs(x[p] - x[a]) < _ROUNDING and abs(y[p] - y[a]) < _ROUNDING
            is_b = abs(x[p] - x[b]) < _ROUNDING and abs(y[p] - y[b]) < _ROUNDING
            is_c = abs(x[p] - x[c]) < _ROUNDING and abs(y[p] - y[c]) < _ROUNDING
            if not (is_a or is_b or is_c):
                return False
        p = following[p - base]
    return True
