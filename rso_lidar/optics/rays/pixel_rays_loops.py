"""The loops of rays: cells covered by outlines, parts of cells under small targets, and rays laid out pixel by pixel."""

import math

import numpy as np

from rso_lidar.arithmetic import loop


@loop
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
    slack: float,
) -> None:
    """Write `value` where outlines first to last cover rows and cols of a block that begins at `origin`, all in parts.

    One loop over the edges finds, for each row, how far left and right the outline reaches.
    """
    height = max(0, rows[1] - rows[0])
    left, right = np.full(height, np.inf), np.full(height, -np.inf)
    for p in range(first, last):
        a, b = starts[p], starts[p + 1]
        margin = off[p] * grid + slack
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


@loop
def parts(
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
    """Return column and row on the focal plane, and pixel, of the parts marked in a block, in cells that are mine.

    Parts in the hole (first row, one past the last, first col, one past the last) are left out.
    """
    fine, most, found = k * grid, 0, 0
    for down in range(block.shape[0]):
        for across in range(block.shape[1]):
            most += block[down, across] != 0
    at_col, at_row, pixel = np.empty(most), np.empty(most), np.empty(most, dtype=np.int32)
    for down in range(block.shape[0]):
        row = down + origin[0]
        for across in range(block.shape[1]):
            col = across + origin[1]
            if (
                block[down, across] == 0
                or owner[row // grid - window[0], col // grid - window[1]] != mine
                or (hole[0] <= row < hole[1] and hole[2] <= col < hole[3])
            ):
                continue
            at_col[found], at_row[found] = (col + 0.5) / fine, (row + 0.5) / fine
            pixel[found] = row // fine * n_cols + col // fine
            found += 1
    return at_col[:found], at_row[:found], pixel[:found]


@loop
def laid(
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
    first_row, first_col = window[0] // k, window[1] // k
    made = len(pixel_fine)
    for cell_row in range(owner.shape[0]):
        for cell_col in range(owner.shape[1]):
            made += owner[cell_row, cell_col] == 0
    begins, order = sorted_by(pixel_fine, n_cols, first_row, first_col, rows, cols)
    direction, pixels, weight = np.empty((3, made)), np.empty(made, dtype=np.int32), np.empty(made)
    x, y, z = direction[0], direction[1], direction[2]
    share, n = 1.0 / k**2, 0
    many_x, many_y = int(x_of.shape[0] > 1), int(y_of.shape[1] > 1)  # without distortion one row, one column serve all
    for row in range(rows):
        begin = n
        for col in range(cols):
            pixel, before = (first_row + row) * n_cols + first_col + col, n
            for cell_row in range(row * k, row * k + k):
                x_at, y_at = x_of[many_x * (window[0] + cell_row)], y_of[window[0] + cell_row]
                for cell_col in range(col * k, col * k + k):
                    if owner[cell_row, cell_col] == 0:
                        x[n], y[n], pixels[n] = x_at[window[1] + cell_col], y_at[many_y * (window[1] + cell_col)], pixel
                        n += 1
            for m in range(before, n):
                weight[m] = share
            if len(order):
                for m in order[begins[row * cols + col] : begins[row * cols + col + 1]]:
                    x[n], y[n], pixels[n], weight[n] = x_fine[m], y_fine[m], pixel, weight_fine[m]
                    n += 1
        for m in range(begin, n):
            z[m] = 1.0 / math.sqrt(1.0 + x[m] * x[m] + y[m] * y[m])
            x[m] *= z[m]
            y[m] *= z[m]
    return direction, pixels, weight


@loop
def sorted_by(
    pixel: np.ndarray, n_cols: int, first_row: int, first_col: int, rows: int, cols: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return where each pixel of a window begins in the order by pixel, and that order, which keeps equals as they are."""
    order = np.empty(len(pixel), dtype=np.int64)
    begins = np.zeros(rows * cols + 2 if len(pixel) else 0, dtype=np.int64)
    for n in range(len(pixel)):
        begins[(pixel[n] // n_cols - first_row) * cols + pixel[n] % n_cols - first_col + 2] += 1
    for p in range(2, len(begins)):
        begins[p] += begins[p - 1]
    for n in range(len(pixel)):
        p = (pixel[n] // n_cols - first_row) * cols + pixel[n] % n_cols - first_col + 1
        order[begins[p]] = n
        begins[p] += 1
    return begins, order
