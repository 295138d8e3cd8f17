"""Oracle of `rso_lidar.optics.rays.cell_light`: the light of cells, leaf by leaf, without following any line."""

import math
from itertools import pairwise

import numpy as np

from rso_lidar.optics.rays.cell_light import VARIANCE_PER_BEND
from tests.reference.optics.cell_tree import find_leaf, leaves_of

BRIGHT_STEP, PER_SQUARED_STEP = 0.5, 1.0 / 60.0


def estimate_variance(root, first_row, first_col, nodes, chosen, light, is_hit, k, variance, least_step, brightest):
    """Write the variance of cells, and the least step of a contour that counts there."""
    tree = root, first_row, first_col, nodes
    for node in chosen.tolist():
        level, row, col = nodes[node, 1:].tolist()
        up, down, left, right = (
            find_leaf(*tree, level, row + r, col + c) for r, c in ((-1, 0), (1, 0), (0, -1), (0, 1))
        )
        own, (a, b, c, d) = light[node], (light[other] if other >= 0 else 0.0 for other in (up, down, left, right))
        bends = (own - 0.5 * (a + b)) ** 2 + (own - 0.5 * (c + d)) ** 2
        variance[node] = VARIANCE_PER_BEND * bends / (k * 3.0**level) ** 4
        is_inside = is_hit[node] and all(other >= 0 and is_hit[other] for other in (up, down, left, right))
        brightest[node] = max(own, a, b, c, d)
        least_step[node] = BRIGHT_STEP * brightest[node] if is_inside else 0.0


def mark_crossed(root, first_row, first_col, nodes, ends, steps, is_active, cells_per_pixel, least_step, step):
    """Write the greatest step of the contours that cross each leaf, by clipping each contour to each leaf."""
    for s, (x0, y0, x1, y1) in enumerate(ends * cells_per_pixel):
        if not is_active[s]:
            continue
        is_active[s] = False
        for node, (level, row, col) in leaves_of(root, nodes).items():
            side = 1.0 / 3**level
            begin, end = 0.0, 1.0
            for start, by, low in ((x0, x1 - x0, col * side), (y0, y1 - y0, row * side)):
                if by == 0.0:
                    begin = begin if low <= start < low + side else 2.0
                    continue
                one, other = sorted(((low - start) / by, (low + side - start) / by))
                begin, end = max(begin, one), min(end, other)
            if begin < end and (steps[s] < 0.0 or steps[s] > least_step[node]):
                step[node] = max(step[node], abs(steps[s]))
                is_active[s] = True


def settle_variance(nodes, chosen, k, least_step, step, variance):
    """Correct the variance of cells by what contours tell."""
    for node in chosen.tolist():
        if step[node] > 0.0:
            least = PER_SQUARED_STEP * step[node] ** 2 / (k * 3.0 ** nodes[node, 1]) ** 4
            variance[node] = max(variance[node], least)
        elif least_step[node] == 0.0:
            variance[node] = 0.0


def sum_pixels(nodes, leaves, light, variance, k, n_cols):
    """Return starts, pixels, photons, variances and counts of the leaves of each pixel."""
    size = k * 3.0 ** nodes[leaves, 1]
    pixel = np.floor((nodes[leaves, 2] + 0.5) / size) * n_cols + np.floor((nodes[leaves, 3] + 0.5) / size)
    pixels, starts = np.unique(pixel, return_index=True)  # leaves are in the order of pixels
    starts = np.append(starts, len(leaves))
    of = [slice(a, b) for a, b in pairwise(starts.tolist())]
    photons = [math.fsum(light[leaves[one]] / size[one] ** 2) for one in of]
    sums = [math.fsum(variance[leaves[one]]) for one in of]
    return starts, pixels, photons, sums, [int((variance[leaves[one]] > 0.0).sum()) for one in of]


def choose_cells(starts, leaves, variance, bound, order, most):
    """Return the cells of the first pixels of an order, above each pixel's bound, as long as they are not too many."""
    chosen = set()
    for p in order.tolist():
        more = {node for node in leaves[starts[p] : starts[p + 1]].tolist() if variance[node] > bound[p]}
        if len(chosen) + len(more) > most:
            break
        chosen |= more
    return [node for node in leaves.tolist() if node in chosen]
