"""Light of cells: how much it may be wrong because each cell has one ray, and which cells to divide.

The light of a cell is compared with its neighbours'. Where the light bends between three cells in a row, it changes inside
them in a way that three rays do not show. Contours show where light changes although no ray has met the change.
"""

import math

import numpy as np

from rso_lidar.kernels import kernel
from rso_lidar.optics.rays.cell_tree import CHILD, COL, LEAF, LEVEL, NO_ROOT, ROW, SIDES, find_leaf

# The variance of a cell's light over the sum of its two squared bends. White noise gives 1/3. Rays through the middles of
# cells that an edge crosses do better. This and the next figure were fitted to eight spacecraft, so that the label says the
# true error: tests/physics/test_sampling_physics.py checks that it does.
VARIANCE_PER_BEND = 0.15
_PER_SQUARED_STEP = 1.0 / 60.0  # least variance of a cell that a contour crosses, over the contour's squared step
# Inside a target, a contour counts whose step is at least so many times the light around. A gap has the whole of it.
_BRIGHT_STEP = 0.5
_STACK = 80  # a line crosses at most five of nine children, and a tree is at most 17 levels deep


@kernel
def estimate_variance(
    root: np.ndarray,
    first_row: int,
    first_col: int,
    nodes: np.ndarray,
    chosen: np.ndarray,
    light: np.ndarray,
    is_hit: np.ndarray,
    k: int,
    variance: np.ndarray,
    least_step: np.ndarray,
    brightest: np.ndarray,
) -> None:
    """Estimate the variance of the light of some cells, and find how strong a contour must be to count there.

    Parameters
    ----------
    chosen : numbers of the cells
    light : (node) photons that a whole pixel would get, if all of it were as bright as the cell's ray
    is_hit : (node) whether the cell's ray meets a target
    k : coarse cells along each side of a pixel
    variance : (node), written
    least_step : (node) photons in a whole pixel, written. 0 beside the sky: there every contour counts
    brightest : (node) light of the brightest of the cell and its neighbours, written
    """
    for i in range(len(chosen)):
        node = chosen[i]
        level, row, col = int(nodes[node, LEVEL]), int(nodes[node, ROW]), int(nodes[node, COL])
        own, bends, most, is_inside = light[node], 0.0, light[node], is_hit[node]
        at_row, at_col, in_row, in_col = row - first_row, col - first_col, 0, 0
        if level > 0:
            in_row, in_col = row % 3, col % 3
        for axis in range(2):
            bend, place, stride = own, in_col if axis else in_row, 1 if axis else 3
            for way in range(-1, 2, 2):
                other = -1
                if level == 0:
                    r, c = at_row + way * (1 - axis), at_col + way * axis
                    if 0 <= r < root.shape[0] and 0 <= c < root.shape[1]:
                        other = int(root[r, c])
                elif 0 <= place + way <= 2:  # one of the same nine
                    other = node + way * stride
                if (level > 0 and other < 0) or (other >= 0 and nodes[other, CHILD] != LEAF):
                    other = find_leaf(
                        root, first_row, first_col, nodes, level, row + way * (1 - axis), col + way * axis
                    )
                if other >= 0:
                    bend -= 0.5 * light[other]
                    most = max(most, light[other])
                    is_inside = is_inside and is_hit[other]
                else:
                    is_inside = False
            bends += bend * bend
        size = k * SIDES[level]
        variance[node] = VARIANCE_PER_BEND * bends / size**4
        least_step[node] = _BRIGHT_STEP * most if is_inside else 0.0
        brightest[node] = most


@kernel
def mark_crossed(
    root: np.ndarray,
    first_row: int,
    first_col: int,
    nodes: np.ndarray,
    ends: np.ndarray,
    steps: np.ndarray,
    is_active: np.ndarray,
    cells_per_pixel: int,
    least_step: np.ndarray,
    step: np.ndarray,
) -> None:
    """Mark the leaves that contours cross, cell by cell along each (Amanatides and Woo 1987).

    Parameters
    ----------
    ends : (contour, 4) column and row of the first end, then of the second, on the focal plane [pixels]
    steps : (contour) photons in a whole pixel; negative for one that counts everywhere
    is_active : (contour), whether to follow it; written: whether it crosses a leaf where it counts
    cells_per_pixel : coarse cells along each side of a pixel
    least_step : (node) the least step that counts
    step : (node), the greatest step of the contours that cross a leaf and count there; written
    """
    height, width = root.shape
    stack, part = np.empty(_STACK, np.int64), np.empty((_STACK, 2))
    for s in range(len(ends)):
        if not is_active[s]:
            continue
        is_active[s] = False
        x, y = ends[s, 0] * cells_per_pixel - first_col, ends[s, 1] * cells_per_pixel - first_row
        across = ends[s, 2] * cells_per_pixel - first_col - x
        along = ends[s, 3] * cells_per_pixel - first_row - y
        begin, end = clip_line(x, across, float(width), 0.0, 1.0)
        begin, end = clip_line(y, along, float(height), begin, end)
        if begin > end:
            continue
        col, row = math.floor(x + begin * across), math.floor(y + begin * along)
        way_col, way_row = (1 if across > 0.0 else -1), (1 if along > 0.0 else -1)
        cells = abs(math.floor(x + end * across) - col) + abs(math.floor(y + end * along) - row) + 1
        by_col, by_row = 1.0 / max(abs(across), 1e-300), 1.0 / max(abs(along), 1e-300)
        next_col = (col + (across > 0.0) - x) * by_col * way_col
        next_row = (row + (along > 0.0) - y) * by_row * way_row
        at = begin
        for _ in range(cells):
            leave = min(next_col, next_row, end)
            node = int(root[row, col]) if 0 <= row < height and 0 <= col < width else NO_ROOT
            if node != NO_ROOT:
                stack[0], part[0, 0], part[0, 1], count = node, at, leave, 1
                while count > 0:
                    count -= 1
                    node, enter, exit_ = stack[count], part[count, 0], part[count, 1]
                    child = nodes[node, CHILD]
                    if child == LEAF:
                        if steps[s] < 0.0 or steps[s] > least_step[node]:
                            step[node] = max(step[node], abs(steps[s]))
                            is_active[s] = True
                    elif child >= 0:
                        count = enter_children(
                            nodes, node, x + first_col, y + first_row, across, along, enter, exit_, stack, part, count
                        )
            at = leave
            if next_col < next_row:
                next_col += by_col
                col += way_col
            else:
                next_row += by_row
                row += way_row


@kernel
def clip_line(start: float, by: float, high: float, begin: float, end: float) -> tuple[float, float]:
    """Return the part of a line, within begin to end, where start + by * part is between 0 and high.

    Parameters
    ----------
    begin, end : part of the line so far; begin > end for none
    """
    if by == 0.0:
        return (begin, end) if 0.0 <= start < high else (1.0, 0.0)
    at_zero, at_high = -start / by, (high - start) / by
    return max(begin, min(at_zero, at_high)), min(end, max(at_zero, at_high))


@kernel
def enter_children(
    nodes: np.ndarray,
    node: int,
    x: float,
    y: float,
    across: float,
    along: float,
    enter: float,
    leave: float,
    stack: np.ndarray,
    part: np.ndarray,
    count: int,
) -> int:
    """Put the children of a node that a contour crosses on a stack; return how many entries it has now.

    Parameters
    ----------
    x, y, across, along : start of the contour, and its way to the end [coarse cells]
    """
    side = SIDES[nodes[node, LEVEL] + 1]
    left, top = 3 * nodes[node, COL], 3 * nodes[node, ROW]
    x, y, across, along = x * side - left, y * side - top, across * side, along * side
    col = min(max(math.floor(x + enter * across), 0), 2)
    row = min(max(math.floor(y + enter * along), 0), 2)
    way_col, way_row = (1 if across > 0.0 else -1), (1 if along > 0.0 else -1)
    by_col, by_row = 1.0 / max(abs(across), 1e-300), 1.0 / max(abs(along), 1e-300)
    next_col = (col + (across > 0.0) - x) * by_col * way_col
    next_row = (row + (along > 0.0) - y) * by_row * way_row
    at = enter
    while 0 <= col <= 2 and 0 <= row <= 2:
        until = min(next_col, next_row, leave)
        stack[count], part[count, 0], part[count, 1] = nodes[node, CHILD] + 3 * row + col, at, until
        count += 1
        if until >= leave:
            break
        at = until
        if next_col < next_row:
            next_col += by_col
            col += way_col
        else:
            next_row += by_row
            row += way_row
    return count


@kernel
def settle_variance(
    nodes: np.ndarray, chosen: np.ndarray, k: int, least_step: np.ndarray, step: np.ndarray, variance: np.ndarray
) -> None:
    """Correct the variance of cells by what contours tell: none crosses, or one does and no ray shows it.

    Parameters
    ----------
    chosen : numbers of the cells
    k : coarse cells along each side of a pixel
    least_step, step : (node) as `mark_crossed` leaves them
    variance : (node), written
    """
    for i in range(len(chosen)):
        node = chosen[i]
        if step[node] > 0.0:
            size = k * SIDES[nodes[node, LEVEL]]
            variance[node] = max(variance[node], _PER_SQUARED_STEP * step[node] ** 2 / size**4)
        elif least_step[node] == 0.0:
            variance[node] = 0.0


@kernel
def sum_pixels(
    nodes: np.ndarray, leaves: np.ndarray, light: np.ndarray, variance: np.ndarray, k: int, n_cols: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Sum the light of the leaves of each pixel.

    Parameters
    ----------
    light, variance : (node) photons in a whole pixel as bright as the cell, and variance of the cell's photons
    k : coarse cells along each side of a pixel
    n_cols : columns of pixels

    Returns
    -------
    Where the leaves of each pixel begin (pixel + 1), its number, photons, their variance, and how many of its leaves
    contribute to it (pixel).
    """
    n = len(leaves)
    starts, pixels, counts = np.empty(n + 1, np.int64), np.empty(n, np.int32), np.empty(n, np.int64)
    photons, variances = np.empty(n), np.empty(n)
    at = -1
    for i in range(n):
        node = leaves[i]
        size = k * SIDES[nodes[node, LEVEL]]
        pixel = math.floor((nodes[node, ROW] + 0.5) / size) * n_cols + math.floor((nodes[node, COL] + 0.5) / size)
        if at < 0 or pixels[at] != pixel:
            at += 1
            starts[at], pixels[at], counts[at] = i, pixel, 0
            photons[at] = variances[at] = 0.0
        photons[at] += light[node] / (size * size)
        variances[at] += variance[node]
        counts[at] += variance[node] > 0.0
    at += 1
    starts[at] = n
    return (
        starts[: at + 1].copy(),
        pixels[:at].copy(),
        photons[:at].copy(),
        variances[:at].copy(),
        counts[:at].copy(),
    )


@kernel
def choose_cells(
    starts: np.ndarray,
    leaves: np.ndarray,
    variance: np.ndarray,
    bound: np.ndarray,
    order: np.ndarray,
    most: int,
) -> np.ndarray:
    """Choose the cells to divide, (cell) i4 in the order of the leaves.

    Parameters
    ----------
    starts, leaves : leaves pixel by pixel, and where each pixel's begin
    variance : (node)
    bound : (pixel) least variance of a cell that is divided
    order : pixels that are not known well enough, the most urgent first. All such cells of a pixel are divided, or none:
        to choose among them by what their rays have met would bias the pixel's light
    most : number of cells at most
    """
    is_chosen, count = np.zeros(len(bound), np.bool_), 0
    for p in order:
        cells = 0
        for i in range(starts[p], starts[p + 1]):
            cells += variance[leaves[i]] > bound[p]
        if count + cells > most:
            break
        is_chosen[p] = True
        count += cells
    chosen, n = np.empty(count, np.int32), 0
    for p in range(len(bound)):
        if is_chosen[p]:
            for i in range(starts[p], starts[p + 1]):
                if variance[leaves[i]] > bound[p]:
                    chosen[n] = leaves[i]
                    n += 1
    return chosen
