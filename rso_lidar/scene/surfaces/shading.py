"""Shading normals of curved parts whose mesh is flat: averaged at corners, interpolated over facets."""

import numpy as np

_CREASE_COSINE = 0.5  # facets that meet at more than 60 degrees are an edge of the craft, not a curved part
_SAME_PLACE = 1e-6  # of the surface's size: files repeat a vertex, and round it


def average_corner_normals(corners: np.ndarray, normals: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Average the unit normals (facet, corner, xyz) at each corner over the facets of its part that meet there.

    Each is weighted by its angle at the corner (Thürmer and Wüthrich 1998). Because winding is mixed, it is turned to the
    side of the facet whose corner it is. Normals more than 60 degrees off are left out.

    Parameters
    ----------
    corners : (facet, corner, xyz) corners of the facets [m]
    normals : (facet, xyz) unit normals, of either side
    part : (facet) number of the part

    Returns
    -------
    (facet, corner, xyz) unit normals.
    """
    if not len(corners):
        return np.zeros((0, 3, 3))
    vertex = _vertices(corners, part)
    weighted = _angles(corners).reshape(-1, 1) * np.repeat(normals, 3, axis=0)
    own = np.repeat(normals, 3, axis=0)
    order = np.argsort(vertex, kind="stable")
    first = np.flatnonzero(np.diff(vertex[order], prepend=-1))
    size = np.diff(first, append=len(order))
    start, ring = np.repeat(first, size), np.repeat(size, size)
    place = np.arange(len(order)) - start
    total = weighted.copy()
    for step in range(1, int(size.max())):  # each corner meets the next of its vertex, then the next but one, ...
        here = np.flatnonzero(ring > step)
        mine = order[here]
        other = order[start[here] + (place[here] + step) % ring[here]]
        agree = np.einsum("ci,ci->c", own[mine], own[other])
        counts = np.where(np.abs(agree) >= _CREASE_COSINE, np.sign(agree), 0.0)
        total[mine] += counts[:, None] * weighted[other]
    unit: np.ndarray = total / np.linalg.norm(total, axis=1, keepdims=True)
    return unit.reshape(-1, 3, 3)


def interpolate_normals(corners: np.ndarray, normals: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Interpolate unit normals (hit, xyz) over facets.

    Parameters
    ----------
    corners, normals : (hit, corner, xyz), corners of the facet that is hit, and normals there
    point : (hit, xyz), points on the facets

    Returns
    -------
    (hit, xyz) unit normals.
    """
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = point - corners[:, 0]
    aa, ab, bb = (np.einsum("hi,hi->h", *pair) for pair in ((a, a), (a, b), (b, b)))
    pa, pb = np.einsum("hi,hi->h", p, a), np.einsum("hi,hi->h", p, b)
    area2 = np.maximum(aa * bb - ab * ab, 1e-300)
    second = np.clip((bb * pa - ab * pb) / area2, 0.0, 1.0)
    third = np.clip((aa * pb - ab * pa) / area2, 0.0, 1.0 - second)
    share = np.stack([1.0 - second - third, second, third], axis=1)
    normal: np.ndarray = np.einsum("hc,hci->hi", share, normals)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return normal


def _vertices(corners: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Number the corners (facet * 3 + corner): corners of one part in one place have the same number."""
    size = max(float(np.ptp(corners.reshape(-1, 3), axis=0).max()), 1e-300)
    cell = np.rint(corners.reshape(-1, 3) / (_SAME_PLACE * size)).astype(np.int64)
    keyed = np.column_stack([np.repeat(part, 3), cell])
    order = np.lexsort(keyed.T)
    new = np.any(np.diff(keyed[order], axis=0, prepend=keyed[order[:1]] - 1) != 0, axis=1)
    vertex = np.empty(len(order), dtype=np.int64)
    vertex[order] = np.cumsum(new) - 1
    return vertex


def _angles(corners: np.ndarray) -> np.ndarray:
    """Return the angle [rad] of each facet at each of its corners."""
    ahead = np.roll(corners, -1, axis=1) - corners
    behind = np.roll(corners, 1, axis=1) - corners
    cross = np.linalg.norm(np.cross(ahead, behind), axis=2)
    angle: np.ndarray = np.arctan2(cross, np.einsum("fci,fci->fc", ahead, behind))
    return angle
