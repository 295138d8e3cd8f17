"""Cells of the focal plane, k x k to a pixel: the targets' outlines on them, and the directions through them."""

from functools import lru_cache
from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.optics.receiver import Receiver
from rso_lidar.records import Extent

_BEND = 16  # points along an edge, for a lens with distortion
_BLOCK = 8  # rows of pixels whose directions are computed together, for a lens with distortion


class Outlines(NamedTuple):
    """Outlines of all targets in cells: `corners` (corner, row_col), those of outline p from `starts[p]` to `starts[p + 1]`.

    `off` (outline) [cells] is the greatest distance of an outline from its corners' chords. `of` (target, 2) is the
    first outline of each target and the one past its last, -1 where only bounds are known.
    """

    corners: np.ndarray
    starts: np.ndarray
    off: np.ndarray
    of: np.ndarray


def boxes_in_cells(receiver: Receiver, extent: Extent, reach: float, k: int) -> np.ndarray:
    """Return each target's bounds (target, low_high, row_col) in cells; whole numbers are cell edges.

    A box reaches beyond the focal plane where the target does. It is empty where low > high.

    Parameters
    ----------
    extent : bounds of the targets in the tangent plane
    reach : what lies farther from the boresight, in the tangent plane, does not count
    k : cells along each side of a pixel
    """
    if receiver.distortion is None:
        n_rows, n_cols = receiver.shape
        scale = k / receiver.pixel_tangent
        return packed(
            straight_boxes(packed(extent.low), packed(extent.high), reach, scale, 0.5 * k * n_rows, 0.5 * k * n_cols)
        )
    low, high = np.maximum(extent.low, -reach), np.minimum(extent.high, reach)
    ends = np.stack([low, high], axis=1)
    boxes = np.empty_like(ends)
    empty = (low > high).any(axis=1)
    boxes[empty] = [[1.0, 1.0], [0.0, 0.0]]
    within = np.clip(ends[~empty], -receiver.field_edge, receiver.field_edge)
    corners = np.stack([within[:, [0, 1, 1, 0], 0], within[:, [0, 0, 1, 1], 1]], axis=-1).reshape(-1, 2)
    cells, off = _bend_outlines(corners, np.arange(0, len(corners) + 1, 4), receiver, k)
    cells = cells.reshape(-1, 4 * _BEND, 2)
    beyond = (ends[~empty] - within)[..., ::-1] * (k / receiver.pixel_tangent)
    boxes[~empty] = np.stack([cells.min(axis=1) - off[:, None], cells.max(axis=1) + off[:, None]], axis=1) + beyond
    return packed(boxes)


@kernel
def straight_boxes(
    low: np.ndarray, high: np.ndarray, reach: float, scale: float, half_rows: float, half_cols: float
) -> np.ndarray:
    """Return bounds (target, low_high, row_col) in cells, for a lens without distortion.

    Parameters
    ----------
    low, high : (target, right_down) bounds in the tangent plane
    reach : what lies farther from the boresight, in the tangent plane, does not count
    scale : cells per unit of the tangent plane
    half_rows, half_cols : row and column of the boresight [cells]
    """
    boxes = np.empty((len(low), 2, 2))
    for t in range(len(low)):
        boxes[t, 0, 0] = max(low[t, 1], -reach) * scale + half_rows
        boxes[t, 0, 1] = max(low[t, 0], -reach) * scale + half_cols
        boxes[t, 1, 0] = min(high[t, 1], reach) * scale + half_rows
        boxes[t, 1, 1] = min(high[t, 0], reach) * scale + half_cols
    return boxes


def outlines_in_cells(receiver: Receiver, extent: Extent, k: int) -> Outlines:
    """Return the outlines of all targets in cells, k along each side of a pixel."""
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
        cells, off = _bend_outlines(corners, starts, receiver, k)
        return Outlines(packed(cells), packed(_BEND * starts), packed(off), packed(of))
    return Outlines(packed(_in_cells(corners, receiver, k)), packed(starts), packed(np.zeros(len(every))), packed(of))


def tangents_of_cells(receiver: Receiver, rows: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y (row, col) of the directions (x, y, 1) through the middles of cells, at least in the given rows.

    Without distortion x has one row and y one column, valid for all.
    """
    return _straight_cells(receiver) if receiver.distortion is None else _bent_cells(receiver).of(rows)


@lru_cache(maxsize=8)
def _straight_cells(receiver: Receiver) -> tuple[np.ndarray, np.ndarray]:
    middles = _middles(receiver, 0, receiver.n_rows)
    x, y = receiver.tangents_at(*middles)
    return packed(x), packed(y)


def _middles(receiver: Receiver, first: int, last: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the columns (1, col) and rows (row, 1) on the focal plane of the middles of cells.

    Parameters
    ----------
    first, last : first row of pixels and one past the last
    """
    k = receiver.rays_per_side
    return ((np.arange(receiver.n_cols * k) + 0.5) / k)[None, :], ((np.arange(first * k, last * k) + 0.5) / k)[:, None]


class _BentCells:
    """Directions through the cells of a lens with distortion, computed in blocks of rows when they are first needed.

    A block is always computed as a whole, so that its bits do not depend on the requested rows. Two threads may both
    compute one.
    """

    def __init__(self, receiver: Receiver) -> None:
        self.receiver = receiver
        self.side = _BLOCK * receiver.rays_per_side
        n_rows, n_cols = (n * receiver.rays_per_side for n in receiver.shape)
        self.x, self.y = np.empty((n_rows, n_cols)), np.empty((n_rows, n_cols))
        self.found = [False] * -(-receiver.n_rows // _BLOCK)

    def of(self, rows: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Return x and y of all cells, with those in rows first to last filled in."""
        for block in range(rows[0] // self.side, -(-rows[1] // self.side)):
            if not self.found[block]:
                first = block * _BLOCK
                last = min(first + _BLOCK, self.receiver.n_rows)
                at = slice(block * self.side, (block + 1) * self.side)
                x, y = self.receiver.tangents_at(*np.broadcast_arrays(*_middles(self.receiver, first, last)))
                self.x[at], self.y[at] = x, y
                self.found[block] = True
        return tuple(_read_only(values) for values in (self.x, self.y))  # type: ignore[return-value]


def _read_only(values: np.ndarray) -> np.ndarray:
    view = values.view()
    view.flags.writeable = False
    return view


@lru_cache(maxsize=2)
def _bent_cells(receiver: Receiver) -> _BentCells:
    return _BentCells(receiver)


def _in_cells(points: np.ndarray, receiver: Receiver, k: int) -> np.ndarray:
    """Return points of the tangent plane (…, right_down) as cells (…, row_col); whole numbers are cell edges.

    A distortion is undefined outside the field. There the cells continue evenly.
    """
    if receiver.distortion is None:
        straight: np.ndarray = points[..., ::-1] * (k / receiver.pixel_tangent)
        straight += (0.5 * k * receiver.n_rows, 0.5 * k * receiver.n_cols)
        return straight
    cells = np.empty_like(points)
    within = np.clip(points, -receiver.field_edge, receiver.field_edge)
    image = receiver.image_of(within[..., 0], within[..., 1])
    for axis in (0, 1):
        cells[..., axis] = k * (image[1 - axis] + (points - within)[..., 1 - axis] / receiver.pixel_tangent)
    return cells


def _bend_outlines(
    corners: np.ndarray, starts: np.ndarray, receiver: Receiver, k: int
) -> tuple[np.ndarray, np.ndarray]:
    """Image outlines through a lens with distortion, at `_BEND` points for each corner.

    Parameters
    ----------
    corners : (corner, right_down) of all outlines
    starts : first corner of each outline, and the number of corners last

    Returns
    -------
    The points (point, row_col) in cells, and how far each outline may be from the chords between them [cells].
    """
    following = np.arange(1, len(corners) + 1)
    sizes = np.diff(starts)
    following[starts[1:][sizes > 0] - 1] = starts[:-1][sizes > 0]
    share = (np.arange(_BEND) / _BEND)[:, None]
    along = corners[:, None] + share * (corners[following] - corners)[:, None]
    cells = _in_cells(along, receiver, k)
    even, odd = cells[:, ::2], cells[:, 1::2]
    chords = 0.5 * (even + np.concatenate([even[:, 1:], even[following, :1]], axis=1))
    # Over half the length, the sagitta of a smooth curve is a quarter; twice that is a safe bound.
    sagitta = 0.5 * np.abs(odd - chords).max(axis=(1, 2), initial=0.0) + 1e-6
    off = np.array([sagitta[a:b].max(initial=0.0) for a, b in pairwise(starts)])
    return np.ascontiguousarray(cells.reshape(-1, 2)), off


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
