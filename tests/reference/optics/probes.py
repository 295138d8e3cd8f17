"""The oracle of `rso_lidar.optics.rays.probes`: probes, fronts and points one by one, depths by intersecting planes."""

import math

import numpy as np


def place_probes(sides, per_side, first_row, first_col, n_cols):
    """Return points (col_row, probe), pixels and weights of probes, pixel by pixel."""
    share = (np.arange(per_side) + 0.5) / per_side
    points, pixels = [], []
    for row, col in zip(*np.nonzero(sides), strict=True):
        for y in share:
            for x in share:
                points.append((first_col + col + x, first_row + row + y))
                pixels.append((first_row + row) * n_cols + first_col + col)
    return np.array(points).reshape(-1, 2).T, np.array(pixels), np.full(len(pixels), 1.0 / per_side**2)


def image_fronts(sides, per_side, direction, fronts, apart, error):
    """Return the image (4, row, col): fronts at their places, and by what factor 1/z must be less in the cell of four."""
    shape = sides.shape[0] * per_side, sides.shape[1] * per_side
    image, n = np.zeros((4, *shape)), 0
    for row, col in zip(*np.nonzero(sides), strict=True):
        for i in range(per_side):
            for j in range(per_side):
                a, b, _ = fronts[:, n]
                w = np.dot(fronts[:, n], direction[:, n] / direction[2, n])
                if max(abs(a), abs(b)) <= 20.0 * w:
                    image[:3, row * per_side + i, col * per_side + j] = w, a * apart, b * apart
                n += 1
    finer = 0.02 / error
    for i in range(shape[0] - 1):
        for j in range(shape[1] - 1):
            w, right, down = image[:3, i : i + 2, j : j + 2]
            if (w == 0.0).any():
                image[3, i, j] = math.inf
                continue
            off = [
                abs((w[r, c] + right[r, c] * (x - c) + down[r, c] * (y - r)) / w[y, x] - 1.0)
                for r in (0, 1)
                for c in (0, 1)
                for y in (0, 1)
                for x in (0, 1)
            ]
            image[3, i, j] = 1.0 + min(0.25 * max(off) + 0.02 * apart * finer, 0.15 * apart * finer)
    return image


def is_hidden(x, y, dx, dy, w, dw, fronts, per_side):
    """Return whether one, two, three or more points of a piece are each behind the planes of the four probes around."""
    length = max(abs(dx), abs(dy)) * per_side
    points = 1 if length < 0.5 else 2 if length < 1.5 else max(3, math.ceil(length - 1.0))
    for share in (np.arange(points) + 0.5) / points:
        right, down = (x + share * dx) * per_side - 0.5, (y + share * dy) * per_side - 0.5
        i, j = math.floor(down), math.floor(right)
        if not (0 <= i < fronts.shape[1] - 1 and 0 <= j < fronts.shape[2] - 1):
            return False
        rows, cols = np.mgrid[i : i + 2, j : j + 2]
        planes = fronts[:3, rows, cols]
        here = planes[0] + planes[1] * (right - cols) + planes[2] * (down - rows)
        if (here < (w + share * dw) * fronts[3, i, j]).any():
            return False
    return True


def find_unexpected(point, ray, depth_m, first_row, first_col, fronts, per_side):
    """Return whether each ray (ray) meets a point that counts as hidden."""
    found = np.zeros(point.shape[1], bool)
    for r, depth in zip(ray, depth_m, strict=True):
        if per_side:
            x, y = point[:, r] - [first_col, first_row]
            found[r] = is_hidden(x, y, 0.0, 0.0, 1.0 / depth, 0.0, fronts, per_side)
    return found


def distrust_fronts(fronts, per_side, pixels):
    """Return fronts that hide nothing in some pixels (row, col): no cell that touches one does."""
    changed = fronts.copy()
    for row, col in zip(*np.nonzero(pixels), strict=True):
        for i in range(fronts.shape[1]):
            for j in range(fronts.shape[2]):
                if row * per_side - 1 <= i < (row + 1) * per_side and col * per_side - 1 <= j < (col + 1) * per_side:
                    changed[3, i, j] = math.inf
    return changed
