"""Outlines of targets on the focal plane, and the pixels that they may cover."""

import math
from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.optics.receiver import Receiver
from rso_lidar.records import Extent

_BEND = 16  # points along an edge, for a lens with distortion
_TOUCH = 0.75  # pixels: the middle of a pixel that an outline touches is at most half a diagonal away from it


class Outlines(NamedTuple):
    """Outlines of targets in pixels: `corners` (corner, row_col), those of outline p from `starts[p]` to `starts[p + 1]`.

    `off` (outline) [pixels] is the greatest distance of an outline from its corners' chords. `of` (target, 2) is the
    first outline of each target and the one past its last, -1 where only bounds are known.
    """

    corners: np.ndarray
    starts: np.ndarray
    off: np.ndarray
    of: np.ndarray


def image_bounds(receiver: Receiver, extent: Extent, reach: float) -> np.ndarray:
    """Return each target's bounds (target, low_high, row_col) on the focal plane [pixels].

    They reach beyond the focal plane where the target does. They are empty where low > high.

    Parameters
    ----------
    extent : bounds of the targets in the tangent plane
    reach : what lies farther from the boresight, in the tangent plane, does not count
    """
    low, high = np.maximum(extent.low, -reach), np.minimum(extent.high, reach)
    ends = np.stack([low, high], axis=1)
    if receiver.distortion is None:
        return packed(_in_pixels(ends, receiver))
    bounds = np.empty_like(ends)
    empty = (low > high).any(axis=1)
    bounds[empty] = [[1.0, 1.0], [0.0, 0.0]]
    within = np.clip(ends[~empty], -receiver.field_edge, receiver.field_edge)
    corners = np.stack([within[:, [0, 1, 1, 0], 0], within[:, [0, 0, 1, 1], 1]], axis=-1).reshape(-1, 2)
    points, off = _bend_outlines(corners, np.arange(0, len(corners) + 1, 4), receiver)
    points = points.reshape(-1, 4 * _BEND, 2)
    beyond = (ends[~empty] - within)[..., ::-1] / receiver.pixel_tangent
    bounds[~empty] = np.stack([points.min(axis=1) - off[:, None], points.max(axis=1) + off[:, None]], axis=1) + beyond
    return packed(bounds)


def image_outlines(receiver: Receiver, extent: Extent) -> Outlines:
    """Return the outlines of all targets on the focal plane."""
    of = np.full((len(extent.low), 2), -1, np.int64)
    every: list[np.ndarray] = []
    for t, outlines in enumerate(extent.outlines or ()):
        if outlines is not None:
            of[t] = len(every), len(every) + len(outlines)
            every.extend(outlines)
    bent = receiver.distortion is not None
    if bent:
        every = [_clip_outline(outline, receiver.field_edge) for outline in every]
    starts = np.array(list(accumulate(map(len, every), initial=0)), np.int64)
    corners = np.concatenate(every) if every else np.empty((0, 2))
    if bent:
        points, off = _bend_outlines(corners, starts, receiver)
        return Outlines(packed(points), packed(_BEND * starts), packed(off), packed(of))
    return Outlines(packed(_in_pixels(corners, receiver)), packed(starts), packed(np.zeros(len(every))), packed(of))


def _in_pixels(points: np.ndarray, receiver: Receiver) -> np.ndarray:
    """Return points of the tangent plane (…, right_down) as pixels (…, row_col); whole numbers are edges of pixels.

    A distortion is undefined outside the field. There the pixels continue evenly.
    """
    if receiver.distortion is None:
        straight: np.ndarray = points[..., ::-1] / receiver.pixel_tangent
        straight += (0.5 * receiver.n_rows, 0.5 * receiver.n_cols)
        return straight
    pixels = np.empty_like(points)
    within = np.clip(points, -receiver.field_edge, receiver.field_edge)
    image = receiver.image_of(within[..., 0], within[..., 1])
    for axis in (0, 1):
        pixels[..., axis] = image[1 - axis] + (points - within)[..., 1 - axis] / receiver.pixel_tangent
    return pixels


def _bend_outlines(corners: np.ndarray, starts: np.ndarray, receiver: Receiver) -> tuple[np.ndarray, np.ndarray]:
    """Image outlines through a lens with distortion, at `_BEND` points for each corner.

    Parameters
    ----------
    corners : (corner, right_down) of all outlines
    starts : first corner of each outline, and the number of corners last

    Returns
    -------
    The points (point, row_col) in pixels, and how far each outline may be from the chords between them [pixels].
    """
    following = np.arange(1, len(corners) + 1)
    sizes = np.diff(starts)
    following[starts[1:][sizes > 0] - 1] = starts[:-1][sizes > 0]
    share = (np.arange(_BEND) / _BEND)[:, None]
    along = corners[:, None] + share * (corners[following] - corners)[:, None]
    points = _in_pixels(along, receiver)
    even, odd = points[:, ::2], points[:, 1::2]
    chords = 0.5 * (even + np.concatenate([even[:, 1:], even[following, :1]], axis=1))
    # Over half the length, the sagitta of a smooth curve is a quarter; twice that is a safe bound.
    sagitta = 0.5 * np.abs(odd - chords).max(axis=(1, 2), initial=0.0) + 1e-6
    off = np.array([sagitta[a:b].max(initial=0.0) for a, b in pairwise(starts)])
    return np.ascontiguousarray(points.reshape(-1, 2)), off


def _clip_outline(outline: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Return the part of a convex outline (corner, right_down) with |right| <= edge[0] and |down| <= edge[1]."""
    if (np.abs(outline) <= edge).all():
        return outline
    for axis, side in ((0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)):
        outline = _clip_edge(outline, axis, side, float(edge[axis]))
    return outline


def _clip_edge(outline: np.ndarray, axis: int, side: float, edge: float) -> np.ndarray:
    """Return the part of a convex outline (corner, right_down) on one side of a line (Sutherland & Hodgman).

    Parameters
    ----------
    outline : (corner, right_down)
    axis, side, edge : the part with side * coordinate[axis] <= edge is kept
    """
    if not len(outline):
        return outline
    over = side * outline[:, axis] - edge
    following, next_over = np.roll(outline, -1, axis=0), np.roll(over, -1)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = outline + (over / (over - next_over))[:, None] * (following - outline)
    both = np.stack([outline, crossing], axis=1).reshape(-1, 2)
    kept: np.ndarray = both[np.stack([over <= 0.0, (over <= 0.0) != (next_over <= 0.0)], axis=1).ravel()]
    return kept


@kernel
def cover_pixels(
    bounds: np.ndarray,
    corners: np.ndarray,
    starts: np.ndarray,
    off: np.ndarray,
    outlines_of: np.ndarray,
    per_side: np.ndarray,
    n_rows: int,
    n_cols: int,
) -> tuple[np.ndarray, int, int]:
    """Find the pixels that targets may cover, in a window about all of them.

    Parameters
    ----------
    bounds : (target, low_high, row_col) of targets [pixels]
    corners, starts, off, outlines_of : the fields of `Outlines`
    per_side : (target) what is written into the pixels of each target; the greatest counts
    n_rows, n_cols : pixels of the focal plane

    Returns
    -------
    (row, col) i8: 0 where there is nothing. Then row and column of the window's first pixel.
    """
    spans, top, bottom, left, right = np.empty((len(bounds), 4), np.int64), n_rows, 0, n_cols, 0
    for t in range(len(bounds)):
        for axis in range(2):
            size = float(n_cols if axis else n_rows)
            spans[t, 2 * axis] = math.floor(min(max(bounds[t, 0, axis], 0.0), size))
            spans[t, 2 * axis + 1] = math.ceil(min(max(bounds[t, 1, axis] + 1e-9, 0.0), size))
        if spans[t, 0] < spans[t, 1] and spans[t, 2] < spans[t, 3]:
            top, bottom = min(top, spans[t, 0]), max(bottom, spans[t, 1])
            left, right = min(left, spans[t, 2]), max(right, spans[t, 3])
    sides = np.zeros((max(bottom - top, 0), max(right - left, 0)), np.int64)
    if not sides.size:
        return sides, 0, 0
    for t in range(len(bounds)):
        rows, cols = (spans[t, 0], spans[t, 1]), (spans[t, 2], spans[t, 3])
        if rows[0] >= rows[1] or cols[0] >= cols[1]:
            continue
        block = sides[rows[0] - top : rows[1] - top, cols[0] - left : cols[1] - left]
        if outlines_of[t, 0] < 0:
            block[:] = np.maximum(block, per_side[t])
        else:
            cover(block, per_side[t], rows, cols, corners, starts, off, outlines_of[t, 0], outlines_of[t, 1])
    return sides, top, left


@kernel
def cover(
    block: np.ndarray,
    value: int,
    rows: tuple[int, int],
    cols: tuple[int, int],
    corners: np.ndarray,
    starts: np.ndarray,
    off: np.ndarray,
    first: int,
    last: int,
) -> None:
    """Raise the pixels that convex outlines touch to a value.

    One loop over the edges finds, for each row, how far left and right an outline reaches.

    Parameters
    ----------
    block : (row, col), changed
    rows, cols : first pixel of the block and one past the last
    corners, starts, off : outlines, as in `Outlines`
    first, last : the first outline, and one past the last
    """
    height = rows[1] - rows[0]
    left, right = np.full(height, np.inf), np.full(height, -np.inf)
    for p in range(first, last):
        a, b, margin = starts[p], starts[p + 1], off[p] + _TOUCH
        top, bottom = rows[1], rows[0]
        for i in range(a, b):
            j = i + 1 if i + 1 < b else a
            r0, c0, r1, c1 = corners[i, 0], corners[i, 1], corners[j, 0], corners[j, 1]
            low, high = min(r0, r1), max(r0, r1)
            begin = int(max(float(rows[0]), math.ceil(min(low - margin - 0.5, float(rows[1])))))
            end = int(min(float(rows[1]), math.floor(max(high + margin - 0.5, float(rows[0]) - 1.0)) + 1.0))
            slope = (c1 - c0) / (r1 - r0) if r1 != r0 else 0.0
            for r in range(begin, end):
                up = c0 + (min(max(r + 0.5 - margin, low), high) - r0) * slope
                down = c0 + (min(max(r + 0.5 + margin, low), high) - r0) * slope
                if r1 == r0:
                    down = c1
                left[r - rows[0]] = min(left[r - rows[0]], up, down)
                right[r - rows[0]] = max(right[r - rows[0]], up, down)
            top, bottom = min(top, begin), max(bottom, end)
        for r in range(top, bottom):
            n = r - rows[0]
            begin = int(max(float(cols[0]), math.ceil(min(left[n] - margin - 0.5, float(cols[1])))))
            end = int(min(float(cols[1]), math.floor(max(right[n] + margin - 0.5, float(cols[0]) - 1.0)) + 1.0))
            for c in range(begin, end):
                block[n, c - cols[0]] = max(block[n, c - cols[0]], value)
            left[n], right[n] = np.inf, -np.inf
