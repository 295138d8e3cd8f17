"""Kernels that find the cells of the focal plane that targets cover, and how finely each is sampled."""

import math

import numpy as np

from rso_lidar.kernels import kernel

# A cell of the k x k grid is refined at most this much along each side; finer than that a target is below 1e-5 pixel.
FINEST = 2**14
STEP = 16  # the grid, in parts of a cell, on which others are sampled beside a small target
BEYOND = 2.0**20  # cells: a bound farther off is treated as none
SLACK = 1e-3  # parts of a cell: margin for the caster's float32, so that no ray at the rim is lost
NO_OWNER = -1  # the owner of a cell without rays; 0 is any target of one ray a cell


@kernel
def find_fineness(boxes: np.ndarray, wanted: int) -> np.ndarray:
    """Find by how much each side of a cell is refined under each target, so that its bounds get `wanted` rays.

    Parameters
    ----------
    boxes : (target, low_high, row_col) bounds of targets in cells
    wanted : least number of rays within a target's bounds; 0 refines nothing

    Returns
    -------
    (target) i8, at most `FINEST`; above `STEP` a multiple of it.
    """
    fineness = np.ones(len(boxes), np.int64)
    for t in range(len(boxes)):
        height, width = boxes[t, 1, 0] - boxes[t, 0, 0], boxes[t, 1, 1] - boxes[t, 0, 1]
        if wanted == 0 or not (0.0 <= height < math.inf and 0.0 <= width < math.inf):
            continue
        shortest, longest = max(min(height, width), 1e-9), max(height, width, 1e-6)
        enough = math.sqrt(wanted / max(height * width, 1e-12))
        if enough <= 1.0:
            continue
        # Two rays across a sliver, so that none is missed; the length bounds the rays of an edge-on sheet.
        m = math.ceil(min(max(enough, 2.0 / shortest), 4.0 * wanted / longest))
        m = min(max(m, 1), FINEST)
        fineness[t] = m if m <= STEP else STEP * -(-m // STEP)
    return fineness


@kernel
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
    """Write `value` into the parts of a block that convex outlines cover.

    One loop over the edges finds, for each row, how far left and right an outline reaches.

    Parameters
    ----------
    block : (row, col) i2, parts of cells, written to
    origin : row and column of the block's first part
    rows, cols : first part and one past the last that may be written
    grid : parts along each side of a cell
    corners, starts, off : outlines, as in `cells.Outlines`
    """
    height = max(0, rows[1] - rows[0])
    left, right = np.full(height, np.inf), np.full(height, -np.inf)
    for p in range(first, last):
        a, b = starts[p], starts[p + 1]
        margin = off[p] * grid + SLACK
        top, bottom = rows[1], rows[0]
        for i in range(a, b):
            j = i + 1 if i + 1 < b else a
            r0, c0, r1, c1 = grid * corners[i, 0], grid * corners[i, 1], grid * corners[j, 0], grid * corners[j, 1]
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
                block[r - origin[0], c - origin[1]] = value
            left[n], right[n] = np.inf, -np.inf


@kernel
def find_spans(boxes: np.ndarray, n_rows: int, n_cols: int) -> np.ndarray:
    """Find the cells of a focal plane of n_rows x n_cols cells that boxes touch.

    Parameters
    ----------
    boxes : (target, low_high, row_col) in cells; empty where low > high
    n_rows, n_cols : cells of the focal plane

    Returns
    -------
    (target, 4) i8: first row, one past the last, first column, one past the last.
    """
    most = float(max(n_rows, n_cols) + 1)
    spans = np.empty((len(boxes), 4), np.int64)
    for t in range(len(boxes)):
        for axis in range(2):
            size = n_cols if axis else n_rows
            low, high = min(max(boxes[t, 0, axis], -1.0), most), min(max(boxes[t, 1, axis], -1.0), most)
            spans[t, 2 * axis] = max(0, math.floor(low))
            spans[t, 2 * axis + 1] = max(0, min(size, math.floor(high) + 1))
    return spans


@kernel
def find_window(spans: np.ndarray, k: int) -> tuple[int, int, int, int]:
    """Return the window of whole pixels about all spans: first row, one past the last, and columns alike [cells].

    Parameters
    ----------
    spans : (target, 4) as `find_spans` returns them. Without any the window is empty
    k : cells along each side of a pixel
    """
    top, bottom, left, right = 2**62, 0, 2**62, 0
    for t in range(len(spans)):
        if spans[t, 0] < spans[t, 1] and spans[t, 2] < spans[t, 3]:
            top, bottom = min(top, spans[t, 0]), max(bottom, spans[t, 1])
            left, right = min(left, spans[t, 2]), max(right, spans[t, 3])
    return top // k * k, -(-bottom // k) * k, left // k * k, -(-right // k) * k


@kernel
def find_owners(
    boxes: np.ndarray,
    fineness: np.ndarray,
    corners: np.ndarray,
    starts: np.ndarray,
    off: np.ndarray,
    outlines_of: np.ndarray,
    k: int,
    n_rows: int,
    n_cols: int,
) -> tuple[np.ndarray, int, int, int]:
    """Find the owner of each cell in a window of whole pixels: of several targets the one with the finest rays.

    Parameters
    ----------
    boxes : (target, low_high, row_col) bounds of targets in cells
    fineness : (target) parts along each side of a cell
    corners, starts, off, outlines_of : outlines of all targets, as in `cells.Outlines`
    k : cells along each side of a pixel
    n_rows, n_cols : pixels of the focal plane

    Returns
    -------
    (row, col) i2: -1 without rays, 0 any target of one ray a cell, t + 1 target t of finer rays. Then row and column of the
    window's first cell, and the number of cells whose owner is 0.
    """
    spans = find_spans(boxes, n_rows * k, n_cols * k)
    top, bottom, left, right = find_window(spans, k)
    if bottom <= top or right <= left:
        return np.empty((0, 0), np.int16), 0, 0, 0
    owner = np.full((bottom - top, right - left), np.int16(NO_OWNER))
    level = 0
    while True:  # from coarse targets to fine ones
        finer = FINEST + 1
        for t in range(len(boxes)):
            if fineness[t] > level:
                finer = min(finer, fineness[t])
        if finer > FINEST:
            break
        level = finer
        for t in range(len(boxes)):
            r0, r1, c0, c1 = spans[t, 0], spans[t, 1], spans[t, 2], spans[t, 3]
            if fineness[t] != level or r0 >= r1 or c0 >= c1:
                continue
            if level > 1 or outlines_of[t, 0] < 0:
                owner[r0 - top : r1 - top, c0 - left : c1 - left] = t + 1 if level > 1 else 0
            else:
                first, last = outlines_of[t, 0], outlines_of[t, 1]
                cover(owner, 0, (top, left), (r0, r1), (c0, c1), 1, corners, starts, off, first, last)
    single = 0
    for row in range(len(owner)):
        for col in range(owner.shape[1]):
            single += owner[row, col] == 0
    return owner, top, left, single


@kernel
def clip_to_parts(low: float, high: float, first: float, last: float, grid: int) -> tuple[int, int]:
    """Return the first part and one past the last whose middles lie between two bounds and two edges.

    Parameters
    ----------
    low, high : bounds [cells]
    first, last : edges [cells]
    grid : parts along each side of a cell
    """
    begin = min(max(low, first, -BEYOND), BEYOND)
    end = min(max(min(high, last), -BEYOND), BEYOND)
    return math.ceil(begin * grid - 0.5), math.ceil(end * grid - 0.5)


# Columns of a table of blocks.
TARGET, GRID, TOP, LEFT, HEIGHT, WIDTH, BEGIN = range(7)


@kernel
def mark_parts(
    boxes: np.ndarray,
    fineness: np.ndarray,
    corners: np.ndarray,
    starts: np.ndarray,
    off: np.ndarray,
    outlines_of: np.ndarray,
    owner: np.ndarray,
    first_row: int,
    first_col: int,
    k: int,
    n_rows: int,
    n_cols: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Mark the parts of cells, under refined targets, through which rays go.

    Another target may show in the same cells. About the bounds of the refined target its rays are on the same fine
    grid. Farther off they are on a grid `STEP` times finer than the cells, so that a speck before a wall costs no
    million rays.

    Parameters
    ----------
    boxes : (target, low_high, row_col) bounds of targets in cells
    fineness : (target) parts along each side of a cell
    corners, starts, off, outlines_of : outlines of all targets, as in `cells.Outlines`
    owner, first_row, first_col : as `find_owners` returns them
    k : cells along each side of a pixel
    n_rows, n_cols : pixels of the focal plane

    Returns
    -------
    A table (block, column) i8 of blocks of parts, and all their marks (part) i2: 1 where a ray goes. Marks run block after
    block and row by row.
    """
    n = len(boxes)
    spans = find_spans(boxes, n_rows * k, n_cols * k)
    blocks, count, size = np.zeros((2 * n, 7), np.int64), 0, 0
    for t in range(n):
        if fineness[t] == 1 or spans[t, 0] >= spans[t, 1] or spans[t, 2] >= spans[t, 3]:
            continue
        step = min(fineness[t], STEP)
        for turn in range(2 if fineness[t] > step else 1):
            grid = fineness[t] if turn == 0 else step
            top, left, bottom, right = 2**62, 2**62, -(2**62), -(2**62)
            for s in range(n):
                r0, r1, c0, c1 = find_parts(boxes, spans, t, s, grid, step)
                if r0 < r1 and c0 < c1:
                    top, left, bottom, right = min(top, r0), min(left, c0), max(bottom, r1), max(right, c1)
            if top >= bottom:
                continue
            row = blocks[count]
            row[TARGET], row[GRID], row[BEGIN] = t, grid, size
            row[TOP], row[LEFT], row[HEIGHT], row[WIDTH] = top, left, bottom - top, right - left
            size += row[HEIGHT] * row[WIDTH]
            count += 1
    marks = np.zeros(size, np.int16)
    for b in range(count):
        row = blocks[b]
        t, grid, top, left = row[TARGET], row[GRID], row[TOP], row[LEFT]
        step, bottom, right = min(fineness[t], STEP), top + row[HEIGHT], left + row[WIDTH]
        block = marks[row[BEGIN] : row[BEGIN] + row[HEIGHT] * row[WIDTH]].reshape(row[HEIGHT], row[WIDTH])
        for s in range(n):
            r0, r1, c0, c1 = find_parts(boxes, spans, t, s, grid, step)
            if r0 >= r1 or c0 >= c1:
                continue
            if outlines_of[s, 0] < 0:
                block[r0 - top : r1 - top, c0 - left : c1 - left] = 1
            else:
                first, last = outlines_of[s, 0], outlines_of[s, 1]
                cover(block, 1, (top, left), (r0, r1), (c0, c1), grid, corners, starts, off, first, last)
        for cell_row in range(top // grid, -(-bottom // grid)):
            for cell_col in range(left // grid, -(-right // grid)):
                if owner[cell_row - first_row, cell_col - first_col] != t + 1:
                    r0, r1 = max(cell_row * grid, top), min(cell_row * grid + grid, bottom)
                    c0, c1 = max(cell_col * grid, left), min(cell_col * grid + grid, right)
                    block[r0 - top : r1 - top, c0 - left : c1 - left] = 0
        if grid < fineness[t]:  # the finer grid of t has the rays about its bounds
            r0, r1 = math.floor(boxes[t, 0, 0] * step) - top, math.ceil(boxes[t, 1, 0] * step) - top
            c0, c1 = math.floor(boxes[t, 0, 1] * step) - left, math.ceil(boxes[t, 1, 1] * step) - left
            block[max(r0, 0) : max(r1, 0), max(c0, 0) : max(c1, 0)] = 0
    return blocks[:count], marks


@kernel
def find_parts(boxes: np.ndarray, spans: np.ndarray, t: int, s: int, grid: int, step: int) -> tuple[int, int, int, int]:
    """Return first row, one past the last, first column and one past the last of the parts of target s in cells of t.

    Parameters
    ----------
    boxes, spans : bounds of targets in cells, and the cells that they touch
    t, s : the refined target, and any target that may show there
    grid : parts along each side of a cell; where it is finer than `step`, only those about the bounds of t count
    step : parts along each side of a cell of the coarser of t's grids
    """
    top, bottom = float(spans[t, 0]), float(spans[t, 1])
    left, right = float(spans[t, 2]), float(spans[t, 3])
    if grid > step:
        top, left = (
            max(top, math.floor(boxes[t, 0, 0] * step) / step),
            max(left, math.floor(boxes[t, 0, 1] * step) / step),
        )
        bottom = min(bottom, math.ceil(boxes[t, 1, 0] * step) / step)
        right = min(right, math.ceil(boxes[t, 1, 1] * step) / step)
    r0, r1 = clip_to_parts(boxes[s, 0, 0], boxes[s, 1, 0], top, bottom, grid)
    c0, c1 = clip_to_parts(boxes[s, 0, 1], boxes[s, 1, 1], left, right, grid)
    return r0, r1, c0, c1
