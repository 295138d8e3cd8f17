"""Pieces of a surface, each with the corners of its convex hull.

Projected, they cover the target more closely than one hull of the whole, so that fewer rays miss it.
"""

import heapq
from dataclasses import dataclass

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.scene.surfaces.geometry_cache import GeometryCache
from rso_lidar.scene.surfaces.surface import Surface

_MOST = 128  # pieces that are considered
_BINS = 16  # places along each axis where a piece may be divided
_WORTH = 0.004  # of the whole hull's area: what a piece must save to be worth its projection
_CORNERS = 128  # limit for one hull; a hull with more is replaced by a slightly larger one with this number


@dataclass(frozen=True, eq=False)
class Pieces:
    """Points (point, xyz) [m] in body axes; those from `starts[p]` to `starts[p + 1]` span the convex hull of piece p."""

    points: np.ndarray
    starts: np.ndarray


@dataclass(eq=False)
class _Node:
    """Some facets, and how they are divided; `area` [m²] is that of their hull, four times its mean projection (Cauchy)."""

    facets: np.ndarray
    parts: "tuple[_Node, _Node] | None" = None
    hull: np.ndarray | None = None
    area: float = 0.0


def find_pieces(surface: Surface) -> Pieces:
    """Return the pieces of a surface, found once for each geometry. Each facet is inside the hull of one of them."""
    return _cache.get(surface)


def _split(surface: Surface) -> Pieces:
    corners = surface.corners
    low, high = corners.min(axis=1), corners.max(axis=1)
    root = _tree(low, high)
    _measure(root, surface)
    hulls = [_simplify_hull(hull) for hull in _choose_pieces(root, _WORTH * root.area)[1]]
    starts = np.cumsum([0] + [len(hull) for hull in hulls])
    points = np.ascontiguousarray(np.concatenate(hulls))
    points.flags.writeable = starts.flags.writeable = False
    return Pieces(points, starts)


def _tree(low: np.ndarray, high: np.ndarray) -> _Node:
    """Divide facets, given by their bounds (facet, xyz), box by box, the largest first, into at most `_MOST`."""
    low, high = packed(low), packed(high)
    root = _Node(np.arange(len(low)))
    heap: list[tuple[float, int, _Node]] = [(0.0, 0, root)]
    number = 1
    while heap and number < _MOST:
        node = heapq.heappop(heap)[2]
        beyond, before, behind = find_cut(low, high, packed(node.facets))
        if not beyond.any():
            continue
        node.parts = _Node(node.facets[~beyond]), _Node(node.facets[beyond])
        for k, (area, part) in enumerate(zip((before, behind), node.parts, strict=True)):
            heapq.heappush(heap, (-area, 2 * number + k, part))
        number += 1
    return root


@kernel
def find_cut(low: np.ndarray, high: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Find the plane across an axis that leaves the least area of boxes about the facets on its two sides.

    Parameters
    ----------
    low, high : (facet, xyz), bounds of all facets

    Returns
    -------
    Which of the facets are beyond the plane, none where there is no such plane. Half the area of the box about those
    before it, and of the box about those beyond it.
    """
    n = len(facets)
    beyond = np.zeros(n, dtype=np.bool_)
    first, last = np.full(3, np.inf), np.full(3, -np.inf)
    for i in range(n):
        f = facets[i]
        for axis in range(3):
            middle = low[f, axis] + high[f, axis]
            first[axis], last[axis] = min(first[axis], middle), max(last[axis], middle)
    bounds = np.empty((3, _BINS, 6))
    bounds[:, :, :3], bounds[:, :, 3:] = np.inf, -np.inf
    for i in range(n):
        f = facets[i]
        for axis in range(3):
            if last[axis] > first[axis]:
                box = bounds[axis, bin_of(low[f, axis] + high[f, axis], first[axis], last[axis])]
                for side in range(3):
                    box[side] = min(box[side], low[f, side])
                    box[3 + side] = max(box[3 + side], high[f, side])
    least, best, cut = np.inf, -1, 0
    area_before, area_behind = np.inf, np.inf
    behind, before = np.empty(_BINS), np.empty(6)
    for axis in range(3):
        if not last[axis] > first[axis]:
            continue
        before[:3], before[3:] = np.inf, -np.inf
        for place in range(_BINS - 1, 0, -1):
            grow_box(before, bounds[axis, place])
            behind[place] = half_area(before)
        before[:3], before[3:] = np.inf, -np.inf
        for place in range(_BINS - 1):
            if bounds[axis, place, 0] > bounds[axis, place, 3]:
                continue  # an empty bin
            grow_box(before, bounds[axis, place])
            area = half_area(before)
            if area + behind[place + 1] < least:
                least, best, cut = area + behind[place + 1], axis, place
                area_before, area_behind = area, behind[place + 1]
    if best < 0:
        return beyond, area_before, area_behind
    for i in range(n):
        f = facets[i]
        beyond[i] = bin_of(low[f, best] + high[f, best], first[best], last[best]) > cut
    return beyond, area_before, area_behind


@kernel
def bin_of(middle: float, first: float, last: float) -> int:
    """Return the bin of a facet's centre along an axis.

    Parameters
    ----------
    middle : coordinate of the centre [m]
    first, last : least and greatest coordinate of all centres [m]
    """
    return min(int(_BINS * ((middle - first) / (last - first))), _BINS - 1)


@kernel
def grow_box(box: np.ndarray, other: np.ndarray) -> None:
    """Grow a box (low x, y, z, high x, y, z) until it holds another."""
    for side in range(3):
        box[side] = min(box[side], other[side])
        box[3 + side] = max(box[3 + side], other[3 + side])


@kernel
def half_area(box: np.ndarray) -> float:
    """Return half the area of a box."""
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    area: float = x * y + y * z + z * x
    return area


def _measure(node: _Node, surface: Surface) -> None:
    """Compute the hulls of a node and of all nodes below it; the hull of a whole from those of its parts."""
    if node.parts is None:
        points = surface.vertices[np.unique(surface.facets[node.facets])]
    else:
        for part in node.parts:
            _measure(part, surface)
        points = np.concatenate([part.hull for part in node.parts if part.hull is not None])
    node.hull, node.area = _hull(points)


def _choose_pieces(node: _Node, price: float) -> tuple[float, list[np.ndarray]]:
    """Choose the pieces that cover a node at the least cost, their areas and a price for each; return cost and hulls."""
    assert node.hull is not None
    whole = node.area + price
    if node.parts is None:
        return whole, [node.hull]
    (cost, hulls), (other_cost, other_hulls) = (_choose_pieces(part, price) for part in node.parts)
    return (cost + other_cost, hulls + other_hulls) if cost + other_cost < whole else (whole, [node.hull])


def _hull(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the corners of the convex hull of points (point, xyz) and its area [m²], both sides of a flat one."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
        return points[hull.vertices], float(hull.area)
    except (QhullError, ValueError):  # flat, or fewer than four points
        pass
    off = points - points.mean(axis=0)
    axes = np.linalg.eigh(np.einsum("pi,pj->ij", off, off))[1]
    along, across = (np.einsum("pi,i->p", off, axes[:, axis]) for axis in (2, 1))
    try:
        hull = ConvexHull(np.stack([along, across], axis=1))
        return points[hull.vertices], 2.0 * float(hull.volume)
    except (QhullError, ValueError):  # a line
        return points[[int(np.argmin(along)), int(np.argmax(along))]], 0.0


def _simplify_hull(hull: np.ndarray) -> np.ndarray:
    """Return corners whose hull holds that of the given ones: the same, or some `_CORNERS` of a slightly larger body."""
    if len(hull) <= _CORNERS:
        return hull
    from scipy.spatial import ConvexHull, QhullError

    middle = 0.5 * (hull.min(axis=0) + hull.max(axis=0))
    size = np.maximum(hull.max(axis=0) - middle, 1e-300)
    even = (hull - middle) / size  # scale each axis, so that a thin body is treated like a round one
    chosen = np.unique([int(np.argmax(_along(even, direction))) for direction in _spread(_CORNERS // 3)])
    while True:
        try:
            planes = ConvexHull(even[chosen]).equations
        except (QhullError, ValueError):
            return hull
        centre = even[chosen].mean(axis=0)
        depth = -(_along(planes[:, :3], centre) + planes[:, 3])
        # For each plane the corner farthest beyond it, in shares of the way from the centre.
        beyond = [(_along(even, plane[:3]) + plane[3]) / far for plane, far in zip(planes, depth, strict=True)]
        corner, share = np.argmax(beyond, axis=1), np.max(beyond, axis=1)
        if len(chosen) >= _CORNERS or share.max() <= 1e-3:
            break
        farthest = corner[np.argsort(-share, kind="stable")]
        chosen = np.union1d(chosen, farthest[: max(_CORNERS - len(chosen), _CORNERS // 8)])
    corners: np.ndarray = middle + size * (centre + (even[chosen] - centre) * (1.0 + 1e-9 + share.max()))
    return corners


def _along(points: np.ndarray, direction: np.ndarray) -> np.ndarray:
    along: np.ndarray = points[:, 0] * direction[0] + points[:, 1] * direction[1] + points[:, 2] * direction[2]
    return along


def _spread(number: int) -> np.ndarray:
    """Return unit vectors (direction, xyz) spread evenly, on a spiral from pole to pole."""
    z = (np.arange(number) + 0.5) * (2.0 / number) - 1.0
    turn, across = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(number), np.sqrt(1.0 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)


_cache = GeometryCache(_split)
