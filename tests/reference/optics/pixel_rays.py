"""NumPy oracle of `rso_lidar.optics.rays.pixel_rays`: same signature, same rays in the same order.

Outlines in cells, bounds behind a lens that distorts, and the edge of the beam are the package's own: NumPy there too.
"""

import math

import numpy as np

from rso_lidar.optics.rays.cells import Outlines, boxes_in_cells, outlines_in_cells, tangents_of_cells
from rso_lidar.optics.rays.coverage import BEYOND, FINEST, SLACK, STEP
from rso_lidar.optics.rays.pixel_rays import clip_to_beam
from rso_lidar.records import Rays


def pixel_rays(receiver, laser, extent):
    """Return the rays of one flash."""
    k = receiver.rays_per_side
    boxes = _boxes_in_cells(receiver, extent, np.inf)
    fineness = [_fineness(box, receiver.min_rays_per_target) for box in boxes.tolist()]
    reach = laser.half_width_tangent + receiver.pixel_tangent / k
    everywhere = laser.footprint == "gaussian" or laser.offset is not None or receiver.filter_width_nm is not None
    boxes = boxes if everywhere else _boxes_in_cells(receiver, extent, reach)
    outlines = outlines_in_cells(receiver, extent)
    owner, window = _find_owners(boxes, fineness, outlines, receiver)
    fine = [
        part
        for t, m in enumerate(fineness)
        if m > 1
        for part in _fine_rays(boxes, owner, window, outlines, t, m, receiver)
    ]
    direction, pixel, weight = _rays(owner, window, fine, receiver)
    if laser.footprint != "gaussian" and laser.offset is None:
        direction, pixel, weight = clip_to_beam(direction, pixel, weight, laser, receiver)
    return Rays(receiver.shape, direction, pixel, weight)


def _boxes_in_cells(receiver, extent, reach):
    """Return each target's bounds (target, low_high, row_col) in cells."""
    if receiver.distortion is not None:
        return boxes_in_cells(receiver, extent, reach)
    k = receiver.rays_per_side
    ends = np.stack([np.maximum(extent.low, -reach), np.minimum(extent.high, reach)], axis=1)
    half = 0.5 * k * np.array(receiver.shape)
    return ends[..., ::-1] * (k / receiver.pixel_tangent) + half


def touched(box, shape):
    """Return the first row, one past the last, the first col and one past the last of the cells that a box touches."""
    most = float(max(shape) + 1)
    (r0, c0), (r1, c1) = ([min(max(at, -1.0), most) for at in end] for end in box)
    return (
        max(0, math.floor(r0)),
        max(0, min(shape[0], math.floor(r1) + 1)),
        max(0, math.floor(c0)),
        max(0, min(shape[1], math.floor(c1) + 1)),
    )


def _outlines_of(outlines, t):
    """Return the first outline of target t and the one past its last, or None."""
    first, last = outlines.of[t].tolist()
    return None if first < 0 else (first, last)


def _find_owners(
    boxes: np.ndarray, fineness: list[int], outlines: Outlines, receiver
) -> tuple[np.ndarray, tuple[int, int]]:
    """Return who owns the cells (row, col) of a window of whole pixels, and the window's first row and column.

    -1: nobody; 0: any target of one ray a cell; t + 1: target t, of finer ones. The finest wins a cell.
    """
    k = receiver.rays_per_side
    shape = receiver.n_rows * k, receiver.n_cols * k
    spans = [touched(box, shape) for box in boxes.tolist()]
    seen = [t for t, (r0, r1, c0, c1) in enumerate(spans) if r0 < r1 and c0 < c1]
    if not seen:
        return np.empty((0, 0), np.int16), (0, 0)
    first_row, first_col = (min(spans[t][side] for t in seen) // k * k for side in (0, 2))
    last_row, last_col = (-(-max(spans[t][side] for t in seen) // k) * k for side in (1, 3))
    owner = np.full((last_row - first_row, last_col - first_col), -1, dtype=np.int16)
    for t in sorted(seen, key=fineness.__getitem__):
        (r0, r1, c0, c1), of = spans[t], _outlines_of(outlines, t)
        if fineness[t] > 1 or of is None:
            owner[r0 - first_row : r1 - first_row, c0 - first_col : c1 - first_col] = t + 1 if fineness[t] > 1 else 0
        else:
            area = (first_row, first_col), (r0, r1), (c0, c1)
            cover(owner, 0, *area, 1, outlines.corners, outlines.starts, outlines.off, *of)
    return owner, (first_row, first_col)


def _fine_rays(
    boxes: np.ndarray, owner: np.ndarray, window: tuple[int, int], outlines: Outlines, t: int, m: int, receiver
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, float]]:
    """Return column and row on the focal plane, pixel and weight of rays in the cells that target t owns, refined m x m.

    Another target may show in the same cells: about t's bounds its rays are on the same fine grid, and farther off on a
    grid `STEP` times finer than the cells, so that a speck before a wall costs no million rays.
    """
    k = receiver.rays_per_side
    r0, r1, c0, c1 = touched(boxes[t].tolist(), (receiver.n_rows * k, receiver.n_cols * k))
    cells, step = np.array([[r0, c0], [r1, c1]], dtype=float), min(m, STEP)
    near = np.stack([np.floor(boxes[t, 0] * step), np.ceil(boxes[t, 1] * step)])
    made = []
    for grid in (m, step) if m > step else (m,):
        low, high = np.maximum(boxes[:, 0], cells[0]), np.minimum(boxes[:, 1], cells[1])
        if grid > step:
            low, high = np.maximum(low, near[0] / step), np.minimum(high, near[1] / step)
        # Parts of cells whose middles lie between two ends.
        low, high = (np.ceil(np.clip(ends, -BEYOND, BEYOND) * grid - 0.5).astype(int) for ends in (low, high))
        seen = np.flatnonzero((low < high).all(axis=1))
        if not len(seen):
            continue
        begin, end = low[seen].min(axis=0), high[seen].max(axis=0)
        origin = int(begin[0]), int(begin[1])
        block = np.zeros(end - begin, dtype=np.int16)
        for s in seen.tolist():
            (top, left), (bottom, right), of = low[s].tolist(), high[s].tolist(), _outlines_of(outlines, s)
            if of is None:
                block[top - origin[0] : bottom - origin[0], left - origin[1] : right - origin[1]] = 1
            else:
                area = origin, (top, bottom), (left, right)
                cover(block, 1, *area, grid, outlines.corners, outlines.starts, outlines.off, *of)
        (top, left), (bottom, right) = near.astype(int).tolist()
        hole = (top, bottom, left, right) if grid < m else (0, 0, 0, 0)
        found = _parts(block, origin, grid, hole, owner, window, t + 1, k, receiver.n_cols)
        made.append((*found, 1.0 / (k * grid) ** 2))
    return made


def _rays(
    owner: np.ndarray,
    window: tuple[int, int],
    fine: list[tuple[np.ndarray, np.ndarray, np.ndarray, float]],
    receiver,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return direction (ray, xyz), pixel and weight of the rays of a window of cells and of finer ones, by pixel."""
    none = np.empty(0), np.empty(0), np.empty(0, np.int32), 0.0
    col, row, pixel, share = zip(*(fine or [none]), strict=True)
    weight = np.repeat(share, [len(values) for values in pixel])
    x, y = receiver.tangents_at(np.concatenate(col), np.concatenate(row))
    x_of, y_of = tangents_of_cells(receiver, (window[0], window[0] + owner.shape[0]))
    k, n_cols = receiver.rays_per_side, receiver.n_cols
    direction, pixels, weight = _lay_out(owner, window, k, n_cols, x_of, y_of, x, y, np.concatenate(pixel), weight)
    return direction.T, pixels, weight


def _fineness(box, wanted):
    """Return m, by which each side of a cell is refined under a target so that its bounds get `wanted` rays."""
    sides = [high - low for low, high in zip(*box, strict=True)]
    if wanted == 0 or not (0.0 <= sides[0] < math.inf and 0.0 <= sides[1] < math.inf):
        return 1
    shortest, longest = max(min(sides), 1e-9), max(*sides, 1e-6)
    enough = math.sqrt(wanted / max(sides[0] * sides[1], 1e-12))
    if enough <= 1.0:
        return 1
    # Two rays across a sliver, so that none is missed; but an edge-on sheet is not sampled without end.
    m: int = min(max(math.ceil(min(max(enough, 2.0 / shortest), 4.0 * wanted / longest)), 1), FINEST)
    return m if m <= STEP else STEP * math.ceil(m / STEP)


def cover(
    block: np.ndarray,
    value: int,
    origin: tuple[int, int],
    rows: tuple[int, int],
    cols: tuple[int, int],
    grid: int,
    corners: np.ndarray,
    starts: np.ndarray,
    off: np.ndarray,
    first: int,
    last: int,
) -> None:
    """Write `value` where outlines first to last, off by at most `off`, cover rows and cols of a block, all in parts."""
    row, col = (np.arange(*ends) + 0.5 for ends in (rows, cols))
    view = block[rows[0] - origin[0] : rows[1] - origin[0], cols[0] - origin[1] : cols[1] - origin[1]]
    for p in range(first, last):
        r0, c0 = (grid * corners[starts[p] : starts[p + 1]]).T
        r1, c1 = np.roll(r0, -1), np.roll(c0, -1)
        low, high, margin = np.minimum(r0, r1), np.maximum(r0, r1), off[p] * grid + SLACK
        crosses = (low - margin <= row[:, None]) & (row[:, None] <= high + margin)
        level = r1 == r0
        slope = (c1 - c0) / np.where(level, np.inf, r1 - r0)
        left, right = np.full(len(row), np.inf), np.full(len(row), -np.inf)
        for side in (-margin, margin):
            at = c0 + (np.clip(row[:, None] + side, low, high) - r0) * slope
            at = np.where(level & (side > 0), c1, at)
            left = np.minimum(left, np.where(crosses, at, np.inf).min(axis=1, initial=np.inf))
            right = np.maximum(right, np.where(crosses, at, -np.inf).max(axis=1, initial=-np.inf))
        view[(col >= (left - margin)[:, None]) & (col <= (right + margin)[:, None])] = value


def _parts(
    block: np.ndarray,
    origin: tuple[int, int],
    grid: int,
    hole: tuple[int, int, int, int],
    owner: np.ndarray,
    window: tuple[int, int],
    mine: int,
    k: int,
    n_cols: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return column and row on the focal plane, and pixel, of the parts marked in a block, in cells that are mine."""
    row, col = (at + first for at, first in zip(np.nonzero(block), origin, strict=True))
    kept = owner[row // grid - window[0], col // grid - window[1]] == mine
    kept &= ~((row >= hole[0]) & (row < hole[1]) & (col >= hole[2]) & (col < hole[3]))
    row, col, fine = row[kept], col[kept], k * grid
    return (col + 0.5) / fine, (row + 0.5) / fine, (row // fine * n_cols + col // fine).astype(np.int32)


def _lay_out(
    owner: np.ndarray,
    window: tuple[int, int],
    k: int,
    n_cols: int,
    x_of: np.ndarray,
    y_of: np.ndarray,
    x_fine: np.ndarray,
    y_fine: np.ndarray,
    pixel_fine: np.ndarray,
    weight_fine: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return direction (xyz, ray), pixel and weight of the rays through cells of owner 0, and of finer ones, by pixel."""
    rows, cols = owner.shape[0] // k, owner.shape[1] // k
    at = np.flatnonzero((owner == 0).reshape(rows, k, cols, k).transpose(0, 2, 1, 3))  # pixel by pixel
    row, col, cell_row, cell_col = np.unravel_index(at, (rows, cols, k, k))
    pixel = ((row + window[0] // k) * n_cols + col + window[1] // k).astype(np.int32)
    row, col = window[0] + row * k + cell_row, window[1] + col * k + cell_col
    x, y = np.broadcast_arrays(x_of, y_of)
    x, y, weight = x[row, col], y[row, col], np.full(len(pixel), 1.0 / k**2)
    if len(pixel_fine):
        pixel = np.concatenate([pixel, pixel_fine])
        order = np.argsort(pixel, kind="stable")
        pairs = (x, x_fine), (y, y_fine), (weight, weight_fine)
        x, y, weight = (np.concatenate(both)[order] for both in pairs)
        pixel = pixel[order]
    z = 1.0 / np.sqrt(1.0 + x * x + y * y)
    return np.stack([x * z, y * z, z]), pixel, weight
