"""Rays through the pixels: only those that can hit a target and are lit."""

from functools import lru_cache

import numpy as np

from rso_lidar.optics.laser import Laser
from rso_lidar.optics.receiver import Receiver
from rso_lidar.records import Extent, Rays

# A cell of the k x k grid is refined at most this much along each side; finer than that a target is below 1e-5 pixel.
_FINEST = 2**14


def pixel_rays(receiver: Receiver, laser: Laser, extent: Extent) -> Rays:
    """Return the rays of one flash: through the cells of each pixel's k x k grid that a target's bounds touch.

    Cells under a target that would get fewer than `min_rays_per_target` rays are refined m x m, and of these only the
    rays inside the bounds are made. A ray's weight is its share of the pixel's area (1/k², or 1/(k m)²), whatever
    becomes of its neighbours.
    """
    k = receiver.rays_per_side
    boxes = _boxes(receiver, extent, np.inf)
    fineness = [_fineness(box, receiver) for box in boxes]
    boxes = _boxes(receiver, extent, np.inf if laser.footprint == "gaussian" else laser.half_width)
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

    A cell that the edge of a square footprint cuts keeps the share of its area that is lit, and its ray goes through
    the middle of that share, so that a narrow beam loses no energy to the grid. A circle's edge is sampled at the
    centres of cells.
    """
    half_field = 0.5 * max(receiver.shape) * receiver.pixel_tangent
    reach = laser.half_width / np.sqrt(2.0) if laser.footprint == "circle" else laser.half_width
    if half_field <= reach * (1.0 + 1e-12):
        return direction, pixel, weight
    x, y = direction[:, 0] / direction[:, 2], direction[:, 1] / direction[:, 2]
    if laser.footprint == "circle":
        inside = np.flatnonzero(laser.lit(x, y))
        return _taken(direction, inside), pixel[inside], weight[inside]
    half_cell = 0.5 * np.sqrt(weight) * receiver.pixel_tangent
    edges = [(np.maximum(v - half_cell, -reach), np.minimum(v + half_cell, reach)) for v in (x, y)]
    (left, right), (top, bottom) = edges
    inside = np.flatnonzero((right > left) & (bottom > top))
    width, height = (right - left)[inside], (bottom - top)[inside]
    x, y = 0.5 * (left + right)[inside], 0.5 * (top + bottom)[inside]
    return _unit(x, y), pixel[inside], width * height / receiver.pixel_tangent**2


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
    longest = max(float(sides.max()), 1e-6)
    m = min(np.sqrt(wanted / area), 4.0 * wanted / longest)  # an edge-on sheet is not sampled without end
    return int(np.clip(np.ceil(m), 1, _FINEST))


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
    """Return direction, pixel and weight of the refined rays in the cells that target t owns.

    A nearer or farther target may show in the same cells; its rays there are made on the same fine grid, once each.
    """
    k = receiver.rays_per_side
    n_rows, n_cols = receiver.shape
    rows, cols = _cells(boxes[t], owner.shape)
    made = []
    for s, box in enumerate(boxes):
        low = np.maximum(box[0], [rows.start, cols.start])
        high = np.minimum(box[1], [rows.stop, cols.stop])
        first = np.ceil(low * m - 0.5).astype(np.int64)
        last = np.ceil(high * m - 0.5).astype(np.int64)
        if np.any(last <= first):
            continue
        row, col = (np.arange(a, b) for a, b in zip(first, last, strict=True))
        keep = owner[row[:, None] // m, col // m] == t
        for other in boxes[:s]:
            inside = [
                (v >= low_v * m - 0.5) & (v < high_v * m - 0.5)
                for v, low_v, high_v in zip((row, col), *other, strict=True)
            ]
            keep &= ~(inside[0][:, None] & inside[1])
        at_row, at_col = np.nonzero(keep)
        row, col = row[at_row], col[at_col]
        y = ((row + 0.5) / (k * m) - 0.5 * n_rows) * receiver.pixel_tangent
        x = ((col + 0.5) / (k * m) - 0.5 * n_cols) * receiver.pixel_tangent
        pixel = (row // (k * m)) * n_cols + col // (k * m)
        made.append((_unit(x, y), pixel.astype(np.int32), np.full(len(pixel), 1.0 / (k * m) ** 2)))
    return made
