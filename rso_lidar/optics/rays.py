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
    becomes of its neighbours.
    """
    k = receiver.rays_per_side
    boxes = _boxes(receiver, extent, np.inf)
    fineness = [_fineness(box, receiver) for box in boxes]
    # One cell more than is lit: the edge's cells keep a share even where their centre is dark.
    reach = laser.half_width_tangent + receiver.pixel_tangent / k
    boxes = _boxes(receiver, extent, np.inf if laser.footprint == "gaussian" else reach)
    owner = np.full((receiver.n_rows * k, receiver.n_cols * k), -1, dtype=np.int16)
    for t in np.argsort(fineness, kind="stable"):  # the finest grid wins a cell
        rows, cols = _cells(boxes[t], owner.shape)
        outline = extent.outlines[t] if extent.outlines else None
        if fineness[t] > 1 or outline is None:
            owner[rows, cols] = t
        else:
            owner[rows, cols][_inside(_in_cells(outline, receiver), rows, cols)] = t
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
    if laser.footprint != "gaussian":
        direction, pixel, weight = _lit(direction, pixel, weight, laser, receiver)
    return Rays(receiver.shape, direction, pixel, weight)


def _lit(
    direction: np.ndarray, pixel: np.ndarray, weight: np.ndarray, laser: Laser, receiver: Receiver
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the rays inside a footprint with an edge.

    A cell that the edge cuts keeps the share of its area that is lit, and its ray goes through the middle of that share,
    so that a narrow beam loses no energy to the grid.
    """
    half_field = 0.5 * max(receiver.shape) * receiver.pixel_tangent
    circle, reach = laser.footprint == "circle", laser.half_width_tangent
    if half_field * (math.sqrt(2.0) if circle else 1.0) <= reach * (1.0 + 1e-12):
        return direction, pixel, weight
    x, y = direction[:, 0] / direction[:, 2], direction[:, 1] / direction[:, 2]
    half_cell = 0.5 * np.sqrt(weight) * receiver.pixel_tangent
    share, x, y = _in_circle(x, y, half_cell, reach) if circle else _in_square(x, y, half_cell, reach)
    kept = np.flatnonzero(share > 1e-9)  # less is rounding
    return _unit(x[kept], y[kept]), pixel[kept], weight[kept] * share[kept]


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
    """Return points of the tangent plane (…, right_down) as cells (…, row_col), whole numbers at cell edges."""
    middle = 0.5 * receiver.rays_per_side * np.array(receiver.shape)
    cells: np.ndarray = points[..., ::-1] * (receiver.rays_per_side / receiver.pixel_tangent) + middle
    return cells


def _inside(corners: np.ndarray, rows: slice, cols: slice) -> np.ndarray:
    """Return which cells of a block (row, col) have their centre in a convex outline of corners (corner, row_col)."""
    row = np.arange(rows.start, rows.stop)[:, None] + 0.5
    col = np.arange(cols.start, cols.stop) + 0.5
    (r0, c0), (r1, c1) = corners.T, np.roll(corners, -1, axis=0).T
    crosses = (np.minimum(r0, r1) <= row) & (row <= np.maximum(r0, r1)) & (r0 != r1)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = c0 + (row - r0) * (c1 - c0) / (r1 - r0)
    edge = 1e-6  # of a cell: rounding must not lose a ray that meets the rim
    left = np.where(crosses, at, np.inf).min(axis=1) - edge
    right = np.where(crosses, at, -np.inf).max(axis=1) + edge
    inside: np.ndarray = (col >= left[:, None]) & (col <= right[:, None])
    return inside


def _boxes(receiver: Receiver, extent: Extent, reach: float) -> list[np.ndarray]:
    """Return each target's bounds in cells: [[first row, first col], [last row, last col]], whole at cell edges.

    Nothing beyond `reach` of the boresight in the tangent plane counts. A box reaches beyond the focal plane where the
    target does; it is empty where first > last.
    """
    low = _in_cells(np.maximum(extent.low, -reach), receiver)
    high = _in_cells(np.minimum(extent.high, reach), receiver)
    return list(np.stack([low, high], axis=1))


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
def _full_grid(shape: tuple[int, int], k: int, pixel_tangent: float) -> tuple[np.ndarray, np.ndarray]:
    """Return directions (ray, xyz) and pixels (ray) of all cells, pixel by pixel."""
    n_rows, n_cols = shape
    y = ((np.arange(n_rows * k) + 0.5) / k - 0.5 * n_rows) * pixel_tangent
    x = ((np.arange(n_cols * k) + 0.5) / k - 0.5 * n_cols) * pixel_tangent
    direction = _unit(*(_by_pixel(axis, shape, k) for axis in np.broadcast_arrays(x[None, :], y[:, None])))
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
    direction, pixel = _full_grid(receiver.shape, k, receiver.pixel_tangent)
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
    n_rows, n_cols = receiver.shape
    y = ((row + 0.5) / fine - 0.5 * n_rows) * receiver.pixel_tangent
    x = ((col + 0.5) / fine - 0.5 * n_cols) * receiver.pixel_tangent
    pixel = (row // fine) * n_cols + col // fine
    return _unit(x, y), pixel.astype(np.int32), np.full(len(pixel), 1.0 / fine**2)
