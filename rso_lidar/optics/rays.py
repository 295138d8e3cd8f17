"""Rays through the pixels: only those that can hit a target and are lit."""

import math
from functools import lru_cache

import numpy as np

from rso_lidar.optics.laser import Laser
from rso_lidar.optics.receiver import Receiver
from rso_lidar.records import Extent, Rays

# A cell of the k x k grid is refined at most this much along each side; finer than that a target is below 1e-5 pixel.
_FINEST = 2**14
_STEP = 16  # the grid, in parts of a cell, on which others are sampled beside a small target
_BEYOND = 2.0**20  # cells: a bound farther off is as good as none


def pixel_rays(receiver: Receiver, laser: Laser, extent: Extent) -> Rays:
    """Return the rays of one flash: through the cells of each pixel's k x k grid that a target's bounds touch.

    Cells under a target that would get fewer than `min_rays_per_target` rays are refined m x m, and of these only the
    rays inside the bounds are made. A ray's weight is its share of the pixel's area (1/k², or 1/(k m)²), whatever
    becomes of its neighbours. Cells are even in the image, so a lens that distorts bends the rays. What the laser does not
    light is left out, unless it stands beside the lens or sunlight is asked for.
    """
    k = receiver.rays_per_side
    boxes = _boxes(receiver, extent, np.inf)
    fineness = [_fineness(box, receiver) for box in boxes]
    # One cell more than is lit: the edge's cells keep a share even where their centre is dark.
    reach = laser.half_width_tangent + receiver.pixel_tangent / k
    everywhere = laser.footprint == "gaussian" or laser.offset is not None or receiver.filter_width_nm is not None
    boxes = _boxes(receiver, extent, np.inf if everywhere else reach)
    owner = np.full((receiver.n_rows * k, receiver.n_cols * k), -1, dtype=np.int16)
    for t in np.argsort(fineness, kind="stable"):  # the finest grid wins a cell
        rows, cols = _cells(boxes[t], owner.shape)
        outline = extent.outlines[t] if extent.outlines else None
        if fineness[t] > 1 or outline is None:
            owner[rows, cols] = t
        else:
            outline, off = _outline_in_cells(outline, receiver)
            if len(outline):
                owner[rows, cols][_inside(outline, rows, cols, off)] = t
    coarse = np.array([m == 1 for m in fineness] + [False])[owner]  # -1 picks the last: no ray
    parts = [_grid_rays(receiver, coarse)]
    for t, m in enumerate(fineness):
        if m > 1:
            parts.extend(_fine_rays(receiver, boxes, owner, t, m))
    direction, pixel, weight = (
        np.concatenate(column) if len(column) > 1 else column[0] for column in zip(*parts, strict=True)
    )
    if len(parts) > 1:
        order = np.argsort(pixel, kind="stable")
        direction, pixel, weight = _taken(direction, order), pixel[order], weight[order]
    if laser.footprint != "gaussian" and laser.offset is None:
        direction, pixel, weight = _lit(direction, pixel, weight, laser, receiver)
    return Rays(receiver.shape, direction, pixel, weight)


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


def _in_cells(points: np.ndarray, receiver: Receiver) -> np.ndarray:
    """Return points of the tangent plane (…, right_down) as cells (…, row_col), whole numbers at cell edges.

    Outside the field a distortion means nothing: there the cells go on as even ones.
    """
    k = receiver.rays_per_side
    if receiver.distortion is None:
        cells: np.ndarray = points[..., ::-1] * (k / receiver.pixel_tangent) + 0.5 * k * np.array(receiver.shape)
        return cells
    within = np.clip(points, -receiver.field_edge, receiver.field_edge)
    col, row = receiver.image_of(within[..., 0], within[..., 1])
    bent: np.ndarray = k * (np.stack([row, col], axis=-1) + (points - within)[..., ::-1] / receiver.pixel_tangent)
    return bent


def _bent(corners: np.ndarray, receiver: Receiver, pieces: int = 16) -> tuple[np.ndarray, float]:
    """Return an outline (corner, right_down) in cells (point, row_col) as a lens bends it, and how far off it may be."""
    share = (np.arange(pieces) / pieces)[:, None]
    along = (corners[:, None] + share * (np.roll(corners, -1, axis=0) - corners)[:, None]).reshape(-1, 2)
    cells = _in_cells(along, receiver)
    even, odd = cells[::2], cells[1::2]
    # A chord of half the length leaves a quarter of the arrow, of any curve that is smooth over it; twice that is sure.
    return cells, 0.5 * float(np.abs(odd - 0.5 * (even + np.roll(even, -1, axis=0))).max()) + 1e-6


def _outline_in_cells(outline: np.ndarray, receiver: Receiver) -> tuple[np.ndarray, float]:
    """Return a convex outline (corner, right_down) in cells (point, row_col), and by how much its rows may be off."""
    if receiver.distortion is None:
        return _in_cells(outline, receiver), 0.0
    for axis, side in ((0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)):
        outline = _cut(outline, axis, side, float(receiver.field_edge[axis]))
    return _bent(outline, receiver) if len(outline) else (outline, 0.0)


def _cut(outline: np.ndarray, axis: int, side: float, edge: float) -> np.ndarray:
    """Return the part of a convex outline (corner, right_down) with side * coordinate <= edge (Sutherland & Hodgman)."""
    if not len(outline):
        return outline
    over = side * outline[:, axis] - edge
    following, next_over = np.roll(outline, -1, axis=0), np.roll(over, -1)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = outline + (over / (over - next_over))[:, None] * (following - outline)
    both = np.stack([outline, crossing], axis=1).reshape(-1, 2)
    kept: np.ndarray = both[np.stack([over <= 0.0, (over <= 0.0) != (next_over <= 0.0)], axis=1).ravel()]
    return kept


def _inside(corners: np.ndarray, rows: slice, cols: slice, off: float) -> np.ndarray:
    """Return which cells of a block (row, col) have their centre within `off` of an outline (corner, row_col).

    The outline is convex, or has at least one piece of each row inside.
    """
    row = np.arange(rows.start, rows.stop)[:, None] + 0.5
    col = np.arange(cols.start, cols.stop) + 0.5
    (r0, c0), (r1, c1) = corners.T, np.roll(corners, -1, axis=0).T
    low, high = np.minimum(r0, r1), np.maximum(r0, r1)
    crosses = (low <= row + off) & (row - off <= high) & (r0 != r1)
    left, right = np.full(len(row), np.inf), np.full(len(row), -np.inf)
    for at_row in (row,) if off == 0.0 else (np.clip(row - off, low, high), np.clip(row + off, low, high)):
        with np.errstate(divide="ignore", invalid="ignore"):
            at = c0 + (at_row - r0) * (c1 - c0) / (r1 - r0)
        left = np.minimum(left, np.where(crosses, at, np.inf).min(axis=1))
        right = np.maximum(right, np.where(crosses, at, -np.inf).max(axis=1))
    margin = off + 1e-6  # rounding must not lose a ray that meets the rim
    inside: np.ndarray = (col >= (left - margin)[:, None]) & (col <= (right + margin)[:, None])
    return inside


def _boxes(receiver: Receiver, extent: Extent, reach: float) -> list[np.ndarray]:
    """Return each target's bounds in cells: [[first row, first col], [last row, last col]], whole at cell edges.

    Nothing beyond `reach` of the boresight in the tangent plane counts. A box reaches beyond the focal plane where the
    target does; it is empty where first > last.
    """
    low, high = np.maximum(extent.low, -reach), np.minimum(extent.high, reach)
    if receiver.distortion is None:
        return list(np.stack([_in_cells(low, receiver), _in_cells(high, receiver)], axis=1))
    boxes = []
    for ends in np.stack([low, high], axis=1):
        if np.any(ends[0] > ends[1]):
            boxes.append(np.array([[1.0, 1.0], [0.0, 0.0]]))
            continue
        within = np.clip(ends, -receiver.field_edge, receiver.field_edge)
        (x0, y0), (x1, y1) = within
        cells, off = _bent(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]), receiver)
        beyond = (ends - within)[:, ::-1] * (receiver.rays_per_side / receiver.pixel_tangent)
        boxes.append(np.stack([cells.min(axis=0) - off, cells.max(axis=0) + off]) + beyond)
    return boxes


def _fineness(box: np.ndarray, receiver: Receiver) -> int:
    """Return m, by which each side of a cell is refined under this target so that its bounds get enough rays."""
    wanted = receiver.min_rays_per_target
    sides = box[1] - box[0]
    if wanted == 0 or not np.all(np.isfinite(sides)) or np.any(sides < 0):
        return 1
    area = max(float(sides[0] * sides[1]), 1e-12)
    shortest, longest = max(float(sides.min()), 1e-9), max(float(sides.max()), 1e-6)
    enough = np.sqrt(wanted / area)
    if enough <= 1.0:
        return 1
    # Two rays across a sliver, so that none is missed; but an edge-on sheet is not sampled without end.
    m = min(max(enough, 2.0 / shortest), 4.0 * wanted / longest)
    m = int(np.clip(np.ceil(m), 1, _FINEST))
    return m if m <= _STEP else _STEP * math.ceil(m / _STEP)


def _cells(box: np.ndarray, shape: tuple[int, int]) -> tuple[slice, slice]:
    """Return the slices of cells that a box touches, within the focal plane."""
    (r0, c0), (r1, c1) = np.clip(box, -1, max(shape) + 1)
    rows = slice(max(0, int(np.floor(r0))), max(0, min(shape[0], int(np.floor(r1)) + 1)))
    cols = slice(max(0, int(np.floor(c0))), max(0, min(shape[1], int(np.floor(c1)) + 1)))
    return rows, cols


@lru_cache(maxsize=4)
def _full_grid(receiver: Receiver) -> tuple[np.ndarray, np.ndarray]:
    """Return directions (ray, xyz) and pixels (ray) of all cells, pixel by pixel."""
    (n_rows, n_cols), k = receiver.shape, receiver.rays_per_side
    centres = ((np.arange(n_cols * k) + 0.5) / k)[None, :], ((np.arange(n_rows * k) + 0.5) / k)[:, None]
    x, y = receiver.tangents_at(*(np.broadcast_arrays(*centres) if receiver.distortion else centres))
    direction = _unit(*(_by_pixel(axis, receiver.shape, k) for axis in np.broadcast_arrays(x, y)))
    pixel = np.repeat(np.arange(n_rows * n_cols, dtype=np.int32), k * k)
    direction.flags.writeable = pixel.flags.writeable = False
    return direction, pixel


def _by_pixel(cells: np.ndarray, shape: tuple[int, int], k: int) -> np.ndarray:
    """Return an array over cells (row of cells, col of cells) flattened pixel by pixel."""
    return cells.reshape(shape[0], k, shape[1], k).transpose(0, 2, 1, 3).ravel()


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


def _grid_rays(receiver: Receiver, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return direction, pixel and weight of the cells wanted, at one ray a cell."""
    k = receiver.rays_per_side
    direction, pixel = _full_grid(receiver)
    if not wanted.all():
        chosen = np.flatnonzero(_by_pixel(wanted, receiver.shape, k))
        direction, pixel = _taken(direction, chosen), pixel[chosen]
    return direction, pixel, np.full(len(pixel), 1.0 / k**2)


def _fine_rays(
    receiver: Receiver, boxes: list[np.ndarray], owner: np.ndarray, t: int, m: int
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return direction, pixel and weight of the rays in the cells that target t owns, refined m x m.

    Another target may show in the same cells: about t's bounds its rays are on the same fine grid, and farther off on a
    grid `_STEP` times finer than the cells, so that a speck before a wall costs no million rays. No point is covered
    twice, since the border between the two grids lies on both.
    """
    rows, cols = _cells(boxes[t], owner.shape)
    cells = np.array([[rows.start, cols.start], [rows.stop, cols.stop]], dtype=float)
    step = min(m, _STEP)
    near = np.stack([np.floor(boxes[t][0] * step), np.ceil(boxes[t][1] * step)]) / step if m > step else cells
    made = []
    for s, box in enumerate(boxes):
        seen = _common(box, cells)
        for grid, region, without in ((m, _common(seen, near), boxes[:s]), (step, seen, [*boxes[:s], near])):
            if s == t and grid != m:
                continue  # its own bounds lie in the fine grid
            row, col = (np.arange(*_centres(region[:, axis], grid)) for axis in (0, 1))
            keep = owner[row[:, None] // grid, col // grid] == t
            for other in without:
                (r0, r1), (c0, c1) = _centres(other[:, 0], grid), _centres(other[:, 1], grid)
                keep &= ~(((row >= r0) & (row < r1))[:, None] & (col >= c0) & (col < c1))
            at_row, at_col = np.nonzero(keep)
            made.append(_rays_at(row[at_row], col[at_col], receiver, grid))
            if m == step:
                break  # one grid serves all
    return made


def _common(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the box that two boxes share; empty where first > last."""
    return np.stack([np.maximum(a[0], b[0]), np.minimum(a[1], b[1])])


def _centres(ends: np.ndarray, grid: int) -> tuple[int, int]:
    """Return the range of parts of a cell whose centres lie between two ends, each cell cut into `grid` parts."""
    low, high = np.clip(ends, -_BEYOND, _BEYOND)
    return math.ceil(low * grid - 0.5), math.ceil(high * grid - 0.5)


def _rays_at(
    row: np.ndarray, col: np.ndarray, receiver: Receiver, grid: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return direction, pixel and weight of the rays through parts of cells, by row and col of parts."""
    fine = receiver.rays_per_side * grid
    x, y = receiver.tangents_at((col + 0.5) / fine, (row + 0.5) / fine)
    pixel = (row // fine) * receiver.n_cols + col // fine
    return _unit(x, y), pixel.astype(np.int32), np.full(len(pixel), 1.0 / fine**2)
