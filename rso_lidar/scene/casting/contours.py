"""Contours: lines of the image along which the brightness of a target may change abruptly, as its edges show them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.records import Contours, Truth
from rso_lidar.scene.surfaces.geometry_cache import GeometryCache
from rso_lidar.scene.surfaces.surface import ANGLES, Surface

_LEAST_DEPTH_M = 1e-6  # nearer to the lidar's plane, or behind it, a point has no image
_NONE = -1  # instead of a facet or corner
_ROUNDING = 1e-8  # of the largest coordinate: a smaller one is zero


@dataclass(frozen=True, eq=False)
class FacetEdges:
    """Edges between facets, each once.

    Attributes
    ----------
    points : (point, xyz) f8 [m], corners of facets in body axes, each position once
    ends : (edge, 2) i4, points at both ends
    facets : (edge, 2) i4, the two facets; the second is -1 on a rim, and where more than two meet
    beyond : (edge, 2) i4, the third corner of each of them
    """

    points: np.ndarray
    ends: np.ndarray
    facets: np.ndarray
    beyond: np.ndarray


def contours(
    surfaces: Sequence[Surface],
    truth: Truth,
    least_crease: float = 0.1,
    is_wanted: Sequence[bool] | np.ndarray | None = None,
) -> Contours:
    """Find the contours of all surfaces: rims, folds where a facet hides its neighbour, and creases between facets.

    Whether another facet hides a contour is not examined.

    Parameters
    ----------
    surfaces : surfaces of all targets
    truth : where they are at one epoch
    least_crease : a crease counts if the brightness of its facets differs by at least this share of the brighter one
    is_wanted : (surface), whether to find the contours of each surface (None: of all)

    Returns
    -------
    the contours, in the tangent plane.
    """
    lines, steps, depths, numbers = [np.empty((0, 4))], [np.empty(0)], [np.empty((0, 2))], [np.empty(0, np.int16)]
    for number, surface in enumerate(surfaces):
        if is_wanted is not None and not is_wanted[number]:
            continue
        edges = _edges.get(surface)
        translation, matrix = truth.poses.place("lidar", surface.name)
        position = truth.poses.place(surface.name, "lidar")[0]
        brightness = estimate_brightness(
            packed(surface.corners),
            packed(surface.planes),
            packed(surface.finish),
            surface.brdf_table,
            packed(position),
        )
        ends, step, per_depth = project_edges(
            edges.points,
            edges.ends,
            edges.facets,
            edges.beyond,
            brightness,
            packed(translation),
            packed(matrix),
            least_crease,
        )
        lines.append(ends)
        steps.append(step)
        depths.append(per_depth)
        numbers.append(np.full(len(step), number, np.int16))
    return Contours(*(np.concatenate(columns) for columns in (lines, steps, depths, numbers)))


def find_textures(surfaces: Sequence[Surface], truth: Truth) -> np.ndarray:
    """Find how large the cells of crinkled foil appear on each surface, at its far side.

    Parameters
    ----------
    surfaces : surfaces of all targets
    truth : where they are at one epoch

    Returns
    -------
    Sides of the cells in the tangent plane (surface), infinite for a surface without foil.
    """
    sizes = np.full(len(surfaces), np.inf)
    for number, surface in enumerate(surfaces):
        cells_m = [m.cell_m for k, m in surface.crinkled.items() if (surface.finish == k).any()]
        if cells_m:
            centre, radius_m = surface.sphere
            distance_m = float(np.linalg.norm(truth.poses.place(surface.name, "lidar")[0] - centre))
            sizes[number] = min(cells_m) / (distance_m + radius_m)
    return sizes


@kernel
def estimate_brightness(
    corners: np.ndarray, planes: np.ndarray, finish: np.ndarray, brdf_table: np.ndarray, position: np.ndarray
) -> np.ndarray:
    """Estimate the brightness of each facet (facet) [1/(sr m²)] for light from the lidar: ρ cos α / R².

    Parameters
    ----------
    corners : (facet, 3, xyz) [m]
    planes : (4, facet), of which the first three are normals
    finish : (facet), material of each facet
    brdf_table : (material, angle) BRDF [1/sr] at even angles of incidence
    position : (xyz) of the lidar [m], in the same axes
    """
    brightness = np.empty(len(corners))
    for f in range(len(corners)):
        x, y, z = position[0] - corners[f, 0, 0], position[1] - corners[f, 0, 1], position[2] - corners[f, 0, 2]
        squared = x * x + y * y + z * z
        cosine = min(abs(planes[0, f] * x + planes[1, f] * y + planes[2, f] * z) / np.sqrt(squared), 1.0)
        at = int(np.arccos(cosine) * ((ANGLES - 1) / (0.5 * np.pi)))
        brightness[f] = brdf_table[finish[f], at] * cosine / squared
    return brightness


@kernel
def project_edges(
    points: np.ndarray,
    ends: np.ndarray,
    facets: np.ndarray,
    beyond: np.ndarray,
    brightness: np.ndarray,
    translation: np.ndarray,
    matrix: np.ndarray,
    least_crease: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Project the edges that change the brightness of the image.

    An edge of two facets is a fold if both are on one side of it in the image; then the brighter one ends there.
    Otherwise it is a crease between the two. An edge that reaches behind the lidar is cut at its plane.

    Parameters
    ----------
    points, ends, facets, beyond : edges, as in `FacetEdges`
    brightness : (facet) as `estimate_brightness` returns it
    least_crease : least relative step of a crease

    Returns
    -------
    Right and down of the first end, then of the second (contour, 4); the step of brightness (contour); 1/z of both ends
    (contour, 2).
    """
    n = len(points)
    x, y, z = np.empty(n), np.empty(n), np.empty(n)
    right, down = np.empty(n), np.empty(n)
    for i in range(n):
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        x[i] = matrix[0, 0] * px + matrix[0, 1] * py + matrix[0, 2] * pz + translation[0]
        y[i] = matrix[1, 0] * px + matrix[1, 1] * py + matrix[1, 2] * pz + translation[1]
        z[i] = matrix[2, 0] * px + matrix[2, 1] * py + matrix[2, 2] * pz + translation[2]
        depth = max(z[i], _LEAST_DEPTH_M)
        right[i], down[i] = x[i] / depth, y[i] / depth
    lines, steps, per_depth, count = np.empty((len(ends), 4)), np.empty(len(ends)), np.empty((len(ends), 2)), 0
    for e in range(len(ends)):
        a, b = ends[e, 0], ends[e, 1]
        if max(z[a], z[b]) <= _LEAST_DEPTH_M:
            continue
        step = brightness[facets[e, 0]]
        if facets[e, 1] >= 0:
            other = brightness[facets[e, 1]]
            c, d = beyond[e, 0], beyond[e, 1]
            # Normal to the plane through the lidar and the edge; it parts corners behind the lidar too.
            dx, dy, dz = x[b] - x[a], y[b] - y[a], z[b] - z[a]
            nx, ny, nz = y[a] * dz - z[a] * dy, z[a] * dx - x[a] * dz, x[a] * dy - y[a] * dx
            side_c = nx * (x[c] - x[a]) + ny * (y[c] - y[a]) + nz * (z[c] - z[a])
            side_d = nx * (x[d] - x[a]) + ny * (y[d] - y[a]) + nz * (z[d] - z[a])
            brighter = max(step, other)
            step = brighter
            if side_c * side_d < 0.0:
                step = abs(brightness[facets[e, 0]] - other)
                if step < least_crease * brighter:
                    continue
        if step > 0.0:
            line = lines[count]
            line[0], line[1], line[2], line[3] = right[a], down[a], right[b], down[b]
            for end in range(2):
                behind, ahead = (a, b) if end == 0 else (b, a)
                per_depth[count, end] = 1.0 / max(z[behind], _LEAST_DEPTH_M)
                if z[behind] < _LEAST_DEPTH_M:
                    share = (_LEAST_DEPTH_M - z[behind]) / (z[ahead] - z[behind])
                    line[2 * end] = (x[behind] + share * (x[ahead] - x[behind])) / _LEAST_DEPTH_M
                    line[2 * end + 1] = (y[behind] + share * (y[ahead] - y[behind])) / _LEAST_DEPTH_M
            steps[count] = step
            count += 1
    return lines[:count].copy(), steps[:count].copy(), per_depth[:count].copy()


def _find_edges(surface: Surface) -> FacetEdges:
    """Find the edges of a surface."""
    corners = surface.corners.reshape(-1, 3)
    least = _ROUNDING * np.abs(corners).max(initial=0.0)  # single precision is relative to each number
    single = np.where(np.abs(corners) <= least, 0.0, corners).astype(np.float32)
    as_bytes = np.ascontiguousarray(single).view(np.dtype((np.void, 12))).ravel()
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
    facets = np.stack([facet[start], np.where(pair, facet[second], _NONE)], axis=1)
    others = np.stack([beyond[start], np.where(pair, beyond[second], _NONE)], axis=1)
    columns = [np.ascontiguousarray(array.astype(np.int32)) for array in (sides[start], facets, others)]
    for values in (points, *columns):
        values.flags.writeable = False
    return FacetEdges(points, *columns)


_edges = GeometryCache(_find_edges)  # found once for each geometry
