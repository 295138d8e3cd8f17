"""Rays through the pixels: only those that can hit a target and are lit."""

import math
from functools import lru_cache

import numpy as np

from rso_lidar.arithmetic import compiled
from rso_lidar.optics.laser import Laser
from rso_lidar.optics.rays.cells import Outlines, boxes_in_cells, outlines_in_cells, tangents_of_cells, touched
from rso_lidar.optics.receiver import Receiver
from rso_lidar.records import Extent, Rays

# A cell of the k x k grid is refined at most this much along each side; finer than that a target is below 1e-5 pixel.
_FINEST = 2**14
_STEP = 16  # the grid, in parts of a cell, on which others are sampled beside a small target
_BEYOND = 2.0**20  # cells: a bound farther off is as good as none
_SLACK = 1e-3  # parts of a cell: the caster's float32 must not lose a ray that meets the rim

_Pair = tuple[int, int]


def pixel_rays(receiver: Receiver, laser: Laser, extent: Extent) -> Rays:
    """Return the rays of one flash: through the cells of each pixel's k x k grid that a target's bounds touch.

    Cells under a target that would get fewer than `min_rays_per_target` rays are refined m x m, and of these only the
    rays inside the bounds are made. A ray's weight is its share of the pixel's area (1/k², or 1/(k m)²), whatever
    becomes of its neighbours. Cells are even in the image, so a lens that distorts bends the rays. What the laser does not
    light is left out, unless it stands beside the lens or sunlight is asked for.
    """
    k = receiver.rays_per_side
    boxes = boxes_in_cells(receiver, extent, np.inf)
    fineness = [_fineness(box, receiver.min_rays_per_target) for box in boxes.tolist()]
    # One cell more than is lit: the edge's cells keep a share even where their centre is dark.
    reach = laser.half_width_tangent + receiver.pixel_tangent / k
    everywhere = laser.footprint == "gaussian" or laser.offset is not None or receiver.filter_width_nm is not None
    boxes = boxes if everywhere else boxes_in_cells(receiver, extent, reach)
    outlines = outlines_in_cells(receiver, extent)
    owner, window = _owned(boxes, fineness, outlines, receiver)
    fine = [
        part
        for t, m in enumerate(fineness)
        if m > 1
        for part in _fine_rays(boxes, owner, window, outlines, t, m, receiver)
    ]
    if not fine and owner.size == receiver.n_rows * receiver.n_cols * k * k and not owner.any():
        direction, pixel, weight = _full_grid(receiver)
    else:
        direction, pixel, weight = _rays(owner, window, fine, receiver)
    if laser.footprint != "gaussian" and laser.offset is None:
        direction, pixel, weight = _lit(direction, pixel, weight, laser, receiver)
    return Rays(receiver.shape, direction, pixel, weight)


def _owned(boxes: np.ndarray, fineness: list[int], outlines: Outlines, receiver: Receiver) -> tuple[np.ndarray, _Pair]:
    """Return who owns the cells (row, col) of a window of whole pixels, and the window's first row and column.

    -1: nobody; 0: any target of one ray a cell; t + 1: target t, of finer ones. The finest wins a cell.
    """
    if compiled():
        from rso_lidar.optics.rays.pixel_rays_loops import cover
    else:
        cover = _cover
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
        (r0, r1, c0, c1), of = spans[t], outlines.of[t]
        if fineness[t] > 1 or of is None:
            owner[r0 - first_row : r1 - first_row, c0 - first_col : c1 - first_col] = t + 1 if fineness[t] > 1 else 0
        else:
            area = (first_row, first_col), (r0, r1), (c0, c1)
            cover(owner, 0, *area, 1, outlines.corners, outlines.starts, outlines.off, *of, _SLACK)
    return owner, (first_row, first_col)


def _fine_rays(
    boxes: np.ndarray, owner: np.ndarray, window: _Pair, outlines: Outlines, t: int, m: int, receiver: Receiver
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, float]]:
    """Return column and row on the focal plane, pixel and weight of rays in the cells that target t owns, refined m x m.

    Another target may show in the same cells: about t's bounds its rays are on the same fine grid, and farther off on a
    grid `_STEP` times finer than the cells, so that a speck before a wall costs no million rays.
    """
    if compiled():
        from rso_lidar.optics.rays.pixel_rays_loops import cover, parts
    else:
        cover, parts = _cover, _parts
    k = receiver.rays_per_side
    r0, r1, c0, c1 = touched(boxes[t].tolist(), (receiver.n_rows * k, receiver.n_cols * k))
    cells, step = np.array([[r0, c0], [r1, c1]], dtype=float), min(m, _STEP)
    near = np.stack([np.floor(boxes[t, 0] * step), np.ceil(boxes[t, 1] * step)])
    made = []
    for grid in (m, step) if m > step else (m,):
        low, high = np.maximum(boxes[:, 0], cells[0]), np.minimum(boxes[:, 1], cells[1])
        if grid > step:
            low, high = np.maximum(low, near[0] / step), np.minimum(high, near[1] / step)
        # Parts of cells whose middles lie between two ends.
        low, high = (np.ceil(np.clip(ends, -_BEYOND, _BEYOND) * grid - 0.5).astype(int) for ends in (low, high))
        seen = np.flatnonzero((low < high).all(axis=1))
        if not len(seen):
            continue
        begin, end = low[seen].min(axis=0), high[seen].max(axis=0)
        origin = int(begin[0]), int(begin[1])
        block = np.zeros(end - begin, dtype=np.int16)
        for s in seen.tolist():
            (top, left), (bottom, right), of = low[s].tolist(), high[s].tolist(), outlines.of[s]
            if of is None:
                block[top - origin[0] : bottom - origin[0], left - origin[1] : right - origin[1]] = 1
            else:
                area = origin, (top, bottom), (left, right)
                cover(block, 1, *area, grid, outlines.corners, outlines.starts, outlines.off, *of, _SLACK)
        (top, left), (bottom, right) = near.astype(int).tolist()
        hole = (top, bottom, left, right) if grid < m else (0, 0, 0, 0)
        found = parts(block, origin, grid, hole, owner, window, t + 1, k, receiver.n_cols)
        made.append((*found, 1.0 / (k * grid) ** 2))
    return made


def _rays(
    owner: np.ndarray,
    window: _Pair,
    fine: list[tuple[np.ndarray, np.ndarray, np.ndarray, float]],
    receiver: Receiver,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return direction (ray, xyz), pixel and weight of the rays of a window of cells and of finer ones, by pixel."""
    if compiled():
        from rso_lidar.optics.rays.pixel_rays_loops import laid
    else:
        laid = _laid
    none = np.empty(0), np.empty(0), np.empty(0, np.int32), 0.0
    col, row, pixel, share = zip(*(fine or [none]), strict=True)
    weight = np.repeat(share, [len(values) for values in pixel])
    x, y = receiver.tangents_at(np.concatenate(col), np.concatenate(row))
    x_of, y_of = tangents_of_cells(receiver, (window[0], window[0] + owner.shape[0]))
    k, n_cols = receiver.rays_per_side, receiver.n_cols
    direction, pixels, weight = laid(owner, window, k, n_cols, x_of, y_of, x, y, np.concatenate(pixel), weight)
    return direction.T, pixels, weight


@lru_cache(maxsize=2)
def _full_grid(receiver: Receiver) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return direction (ray, xyz), pixel and weight of the rays through all cells."""
    k = receiver.rays_per_side
    made = _rays(np.zeros((receiver.n_rows * k, receiver.n_cols * k), np.int16), (0, 0), [], receiver)
    for values in made:
        values.flags.writeable = False
    return made


def _fineness(box: list[list[float]], wanted: int) -> int:
    """Return m, by which each side of a cell is refined under a target so that its bounds get `wanted` rays."""
    sides = [high - low for low, high in zip(*box, strict=True)]
    if wanted == 0 or not (0.0 <= sides[0] < math.inf and 0.0 <= sides[1] < math.inf):
        return 1
    shortest, longest = max(min(sides), 1e-9), max(*sides, 1e-6)
    enough = math.sqrt(wanted / max(sides[0] * sides[1], 1e-12))
    if enough <= 1.0:
        return 1
    # Two rays across a sliver, so that none is missed; but an edge-on sheet is not sampled without end.
    m: int = min(max(math.ceil(min(max(enough, 2.0 / shortest), 4.0 * wanted / longest)), 1), _FINEST)
    return m if m <= _STEP else _STEP * math.ceil(m / _STEP)


# --------------------------------------------------------------------------- what rays_loops does, in NumPy


def _cover(
    block: np.ndarray,
    value: int,
    origin: _Pair,
    rows: _Pair,
    cols: _Pair,
    grid: int,
    corners: np.ndarray,
    starts: np.ndarray,
    off: np.ndarray,
    first: int,
    last: int,
    slack: float,
) -> None:
    """Write `value` where outlines first to last, off by at most `off`, cover rows and cols of a block, all in parts."""
    row, col = (np.arange(*ends) + 0.5 for ends in (rows, cols))
    view = block[rows[0] - origin[0] : rows[1] - origin[0], cols[0] - origin[1] : cols[1] - origin[1]]
    for p in range(first, last):
        r0, c0 = (grid * corners[starts[p] : starts[p + 1]]).T
        r1, c1 = np.roll(r0, -1), np.roll(c0, -1)
        low, high, margin = np.minimum(r0, r1), np.maximum(r0, r1), off[p] * grid + slack
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
    origin: _Pair,
    grid: int,
    hole: tuple[int, int, int, int],
    owner: np.ndarray,
    window: _Pair,
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


def _laid(
    owner: np.ndarray,
    window: _Pair,
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
    return _unit(x, y).T, pixel, weight


# ------------------------------------------------------------------------------------------------ the beam's edge


def _lit(
    direction: np.ndarray, pixel: np.ndarray, weight: np.ndarray, laser: Laser, receiver: Receiver
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the rays inside a footprint with an edge; where sunlight is asked for, those outside as well.

    A cell that the edge cuts keeps the share of its area that is lit, and its ray goes through the middle of that share,
    so that a narrow beam loses no energy to the grid. For sunlight the rest gets a ray of its own, through the cell's
    farthest corner.
    """
    half_field = float(receiver.field_edge.max())
    circle, reach = laser.footprint == "circle", laser.half_width_tangent
    if half_field * (math.sqrt(2.0) if circle else 1.0) <= reach * (1.0 + 1e-12):
        return direction, pixel, weight
    x, y = direction[:, 0] / direction[:, 2], direction[:, 1] / direction[:, 2]
    half_cell = 0.5 * np.sqrt(weight) * receiver.pixel_tangent
    if receiver.distortion is not None:
        half_cell *= np.sqrt(receiver.distortion.area_seen(x, y))
    farthest = [np.abs(v) + (1.0 - 1e-6) * half_cell for v in (x, y)]
    share, x, y = _in_circle(x, y, half_cell, reach) if circle else _in_square(x, y, half_cell, reach)
    kept = np.flatnonzero(share > 1e-9)  # less is rounding
    lit = _unit(x[kept], y[kept]), pixel[kept], weight[kept] * share[kept]
    if receiver.filter_width_nm is None:
        return lit
    rest = np.flatnonzero(share < 1.0 - 1e-9)
    cut = share[rest] > 1e-9
    unlit = _taken(direction, rest)
    unlit[cut] = _unit(*(np.copysign(farthest[axis][rest[cut]], unlit[cut, axis]) for axis in (0, 1)))
    dark = unlit, pixel[rest], weight[rest] * (1.0 - np.where(cut, share[rest], 0.0))
    direction, pixel, weight = (np.concatenate(column) for column in zip(lit, dark, strict=True))
    order = np.argsort(pixel, kind="stable")
    return _taken(direction, order), pixel[order], weight[order]


def _in_square(x: np.ndarray, y: np.ndarray, half_cell: np.ndarray, reach: float) -> tuple[np.ndarray, ...]:
    """Return the lit share of square cells about (x, y), and the middle of that share: exact."""
    (left, right), (top, bottom) = (
        (np.maximum(v - half_cell, -reach), np.minimum(v + half_cell, reach)) for v in (x, y)
    )
    share = np.maximum(right - left, 0.0) * np.maximum(bottom - top, 0.0) / (2.0 * half_cell) ** 2
    return share, 0.5 * (left + right), 0.5 * (top + bottom)


def _in_circle(x: np.ndarray, y: np.ndarray, half_cell: np.ndarray, reach: float) -> tuple[np.ndarray, ...]:
    """Return the lit share of square cells about (x, y), and the middle of that share, from 32 x 32 points of each."""
    radius, half_diagonal = np.hypot(x, y), math.sqrt(2.0) * half_cell
    share = (radius < reach).astype(float)
    # 1024 points give a share to some 1e-3, and the errors of many cells cancel.
    edge = np.flatnonzero(np.abs(radius - reach) <= half_diagonal)
    offset = (np.arange(32) + 0.5) / 16.0 - 1.0
    x, y = x.copy(), y.copy()
    for some in np.array_split(edge, 1 + len(edge) // 2048):
        across = x[some, None, None] + half_cell[some, None, None] * offset
        down = y[some, None, None] + half_cell[some, None, None] * offset[:, None]
        inside = across**2 + down**2 <= reach**2
        count = np.maximum(inside.sum(axis=(1, 2)), 1)
        share[some] = inside.mean(axis=(1, 2))
        x[some] = (across * inside).sum(axis=(1, 2)) / count
        y[some] = (down * inside).sum(axis=(1, 2)) / count
    return share, x, y


def _unit(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    direction = np.empty((x.size, 3), order="F")  # x, y and z each in one piece, as casting wants them
    direction[:, 2] = 1.0 / np.sqrt(1.0 + x * x + y * y)
    direction[:, 0] = x * direction[:, 2]
    direction[:, 1] = y * direction[:, 2]
    return direction


def _taken(direction: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Return some of the directions, still with x, y and z each in one piece."""
    taken = np.empty((len(chosen), 3), order="F")
    for axis in range(3):
        np.take(direction[:, axis], chosen, out=taken[:, axis], mode="clip")
    return taken
