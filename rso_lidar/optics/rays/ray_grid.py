"""Kernels that make the rays of owned cells and of marked parts of cells, pixel by pixel."""

import math

import numpy as np

from rso_lidar.kernels import kernel
from rso_lidar.optics.rays.coverage import BEGIN, GRID, HEIGHT, LEFT, NO_OWNER, TOP, WIDTH


@kernel
def make_rays(
    owner: np.ndarray,
    first_row: int,
    first_col: int,
    single: int,
    blocks: np.ndarray,
    marks: np.ndarray,
    k: int,
    n_rows: int,
    n_cols: int,
    x_of: np.ndarray,
    y_of: np.ndarray,
    pixel_tangent: float,
    is_bent: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Make the rays through cells of owner 0 and through marked parts of cells, ordered by pixel.

    Parameters
    ----------
    owner, first_row, first_col, single : as `coverage.find_owners` returns them
    blocks, marks : as `coverage.mark_parts` returns them
    k : cells along each side of a pixel
    n_rows, n_cols : pixels of the focal plane
    x_of, y_of : (row, col) tangents of all cells; x with one row and y with one column, for a lens without distortion
    pixel_tangent : side of a pixel in the tangent plane

    Returns
    -------
    Unit vectors (xyz, ray), pixels (ray), weights (ray), and the indices of the rays through parts of cells. For a lens that
    distorts x and y are those of the tangent plane, or column and row on the focal plane for parts; z is not set.
    """
    n_fine = 0
    for part in range(len(marks)):
        n_fine += marks[part]
    direction, pixels, weight = (
        np.empty((3, single + n_fine)),
        np.empty(single + n_fine, np.int32),
        np.empty(single + n_fine),
    )
    x, y, share = direction[0], direction[1], 1.0 / k**2
    fine_at, n, n_fine = np.empty(n_fine, np.int64), 0, 0
    many_x, many_y = int(x_of.shape[0] > 1), int(y_of.shape[1] > 1)
    height, width = owner.shape
    for row in range(height // k):
        left, right = width, 0  # between them are all owned cells of this row of pixels
        for cell_row in range(row * k, row * k + k):
            begin, end = 0, width
            while begin < width and owner[cell_row, begin] == NO_OWNER:
                begin += 1
            while end > begin and owner[cell_row, end - 1] == NO_OWNER:
                end -= 1
            left, right = min(left, begin), max(right, end)
        for col in range(left // k, -(-right // k)):
            pixel_row, pixel_col = row + first_row // k, col + first_col // k
            pixel, start_of_pixel, has_parts = pixel_row * n_cols + pixel_col, n, False
            for cell_row in range(row * k, row * k + k):
                x_at, y_at = x_of[many_x * (first_row + cell_row)], y_of[first_row + cell_row]
                for cell_col in range(col * k, col * k + k):
                    of = owner[cell_row, cell_col]
                    if of == 0:
                        x[n], y[n] = x_at[first_col + cell_col], y_at[many_y * (first_col + cell_col)]
                        n += 1
                    has_parts = has_parts or of > 0
            for m in range(start_of_pixel, n):
                weight[m] = share
            for b in range(len(blocks) if has_parts else 0):
                block, fine, start = blocks[b], k * blocks[b, GRID], n
                begin, end = max(block[LEFT], pixel_col * fine), min(block[LEFT] + block[WIDTH], (pixel_col + 1) * fine)
                top, bottom = max(block[TOP], pixel_row * fine), min(block[TOP] + block[HEIGHT], (pixel_row + 1) * fine)
                for r in range(top, bottom):
                    at = block[BEGIN] + (r - block[TOP]) * block[WIDTH] - block[LEFT]
                    for c in range(begin, end):
                        if marks[at + c]:
                            x[n], y[n] = (c + 0.5) / fine, (r + 0.5) / fine
                            n += 1
                for m in range(start, n):
                    weight[m], fine_at[n_fine] = 1.0 / fine**2, m
                    n_fine += 1
                    if not is_bent:
                        x[m], y[m] = (x[m] - 0.5 * n_cols) * pixel_tangent, (y[m] - 0.5 * n_rows) * pixel_tangent
            for m in range(start_of_pixel, n):
                pixels[m] = pixel
    if not is_bent:
        normalise(direction)
    return direction, pixels, weight, fine_at


@kernel
def normalise(direction: np.ndarray) -> None:
    """Turn x and y (xyz, ray) of directions (x, y, 1) into unit vectors, in place."""
    x, y, z = direction[0], direction[1], direction[2]
    for m in range(direction.shape[1]):
        z[m] = 1.0 / math.sqrt(1.0 + x[m] * x[m] + y[m] * y[m])
        x[m] *= z[m]
        y[m] *= z[m]
