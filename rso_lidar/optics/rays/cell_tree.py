"""Cells of the focal plane as trees: coarse cells, of which some are divided again and again into three by three.

A window of coarse cells covers the targets. Each coarse cell is the root of a tree, and each leaf has one ray, through its
middle. A row of the table of nodes holds the first of nine children, the level, and row and column among all cells of that
level. Children are stored together, row by row.
"""

import math
from typing import NamedTuple

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.optics.rays.cells import Outlines
from rso_lidar.optics.rays.coverage import clip_to_parts, cover, find_spans, find_window

CHILD, LEVEL, ROW, COL = range(4)  # columns of the table of nodes
LEAF, ABSENT = -1, -2  # instead of a child: a cell with a ray, and one that nothing covers
NO_ROOT = -1
_MIDDLE = 4  # number of the child in the middle
_DEEPEST = 9  # levels below a coarse cell: 1/19,683 of its side
_STACK = 8 * (_DEEPEST + 8) + 16  # rounds divide cells below the deepest that are planted, as SIDES allows
SIDES = 3.0 ** np.arange(_DEEPEST + 8)  # cells of a level along the side of a coarse cell
_MARGIN = 0.75  # cells: the middle of a cell that an outline touches is at most half a diagonal away from it


class CellTree(NamedTuple):
    """Trees of cells.

    `root` (row, col) i4 is the node of each coarse cell in a window of whole pixels, `NO_ROOT` for none. `first_row` and
    `first_col` are the window's first coarse cell. `nodes` (node, 4) i8 is the table of nodes.
    """

    root: np.ndarray
    first_row: int
    first_col: int
    nodes: np.ndarray


def find_levels(fineness: np.ndarray) -> np.ndarray:
    """Return the level of cells at least as fine as wanted, from the wanted number of cells along a coarse cell's side."""
    levels = np.ceil(np.log(np.maximum(fineness, 1.0)) / math.log(3.0) - 1e-9).astype(np.int64)
    return packed(np.minimum(levels, _DEEPEST))


def plant_cells(boxes: np.ndarray, levels: np.ndarray, outlines: Outlines, k: int, shape: tuple[int, int]) -> CellTree:
    """Make the cells that targets cover, each target's at its level or below.

    Parameters
    ----------
    boxes : (target, low_high, row_col) bounds of targets in coarse cells
    levels : (target) as `find_levels` returns them
    outlines : outlines of all targets in coarse cells
    k : coarse cells along each side of a pixel
    shape : rows and columns of pixels of the focal plane
    """
    return CellTree(*plant_roots(boxes, levels, *outlines, k, *shape))


@kernel
def plant_roots(
    boxes: np.ndarray,
    levels: np.ndarray,
    corners: np.ndarray,
    starts: np.ndarray,
    off: np.ndarray,
    outlines_of: np.ndarray,
    k: int,
    n_rows: int,
    n_cols: int,
) -> tuple[np.ndarray, int, int, np.ndarray]:
    """Make the cells that targets cover; the parameters are those of `plant_cells`.

    Parameters
    ----------
    boxes, levels : (target, low_high, row_col) bounds in coarse cells, and level of the cells of each target
    corners, starts, off, outlines_of : outlines of all targets, as in `cells.Outlines`
    k : coarse cells along each side of a pixel
    n_rows, n_cols : pixels of the focal plane

    Returns
    -------
    The fields of `CellTree`.
    """
    spans = find_spans(boxes, n_rows * k, n_cols * k)
    top, bottom, left, right = find_window(spans, k)
    if bottom <= top or right <= left:
        return np.empty((0, 0), np.int32), 0, 0, np.empty((0, 4), np.int64)
    mark = np.zeros((bottom - top, right - left), np.int16)
    for t in range(len(boxes)):
        r0, r1, c0, c1 = spans[t, 0], spans[t, 1], spans[t, 2], spans[t, 3]
        if levels[t] > 0 or r0 >= r1 or c0 >= c1:
            continue
        if outlines_of[t, 0] < 0:
            mark[r0 - top : r1 - top, c0 - left : c1 - left] = 1
        else:
            first, last = outlines_of[t, 0], outlines_of[t, 1]
            cover(mark, 1, (top, left), (r0, r1), (c0, c1), 1, corners, starts, off + _MARGIN, first, last)
    root = np.full(mark.shape, np.int32(NO_ROOT))
    count = 0
    for row in range(mark.shape[0]):
        for col in range(mark.shape[1]):
            count += mark[row, col]
    nodes, n = np.empty((count + 1024, 4), np.int64), 0
    for row in range(mark.shape[0]):
        for col in range(mark.shape[1]):
            if mark[row, col]:
                root[row, col] = n
                nodes[n, CHILD], nodes[n, LEVEL], nodes[n, ROW], nodes[n, COL] = LEAF, 0, top + row, left + col
                n += 1
    for t in range(len(boxes)):
        if levels[t] == 0 or spans[t, 0] >= spans[t, 1] or spans[t, 2] >= spans[t, 3]:
            continue
        grid = 3 ** levels[t]
        r0, r1 = clip_to_parts(boxes[t, 0, 0], boxes[t, 1, 0], float(spans[t, 0]), float(spans[t, 1]), grid)
        c0, c1 = clip_to_parts(boxes[t, 0, 1], boxes[t, 1, 1], float(spans[t, 2]), float(spans[t, 3]), grid)
        # One cell more on each side: a target thinner than a cell may lie between the middles of two.
        r0, r1 = max(r0 - 1, spans[t, 0] * grid), min(r1 + 1, spans[t, 1] * grid)
        c0, c1 = max(c0 - 1, spans[t, 2] * grid), min(c1 + 1, spans[t, 3] * grid)
        if r0 >= r1 or c0 >= c1:
            continue
        fine = np.zeros((r1 - r0, c1 - c0), np.int16)
        if outlines_of[t, 0] < 0:
            fine[:] = 1
        else:
            first, last = outlines_of[t, 0], outlines_of[t, 1]
            cover(fine, 1, (r0, c0), (r0, r1), (c0, c1), grid, corners, starts, off + _MARGIN / grid, first, last)
        for r in range(r0, r1):
            parent, first = (
                -1,
                0,
            )  # column of the parent of the last cell, and the first of its three children in this row
            for c in range(c0, c1):
                if not fine[r - r0, c - c0]:
                    continue
                if c // 3 != parent:
                    nodes, n, node = insert_cell(root, top, left, nodes, n, levels[t], r, c)
                    parent, first = c // 3, node - c % 3
                mark_covered(nodes, first + c - 3 * parent)
    return root, top, left, nodes[:n].copy()


@kernel
def insert_cell(
    root: np.ndarray, top: int, left: int, nodes: np.ndarray, n: int, level: int, row: int, col: int
) -> tuple[np.ndarray, int, int]:
    """Divide cells until one of a level exists.

    Parameters
    ----------
    root, top, left : the window of coarse cells; new roots are written

    Returns
    -------
    The table, which may be a larger copy, the number of nodes, and the number of the cell.
    """
    if n + 9 * level + 1 > len(nodes):
        larger = np.empty((2 * len(nodes) + 9 * level + 1, 4), np.int64)
        larger[:n] = nodes[:n]
        nodes = larger
    side = 3**level
    at_row, at_col = row // side - top, col // side - left
    node = int(root[at_row, at_col])
    if node == NO_ROOT:
        node = n
        root[at_row, at_col] = node
        nodes[n, CHILD], nodes[n, LEVEL], nodes[n, ROW], nodes[n, COL] = ABSENT, 0, row // side, col // side
        n += 1
    for _ in range(level):
        if nodes[node, CHILD] < 0:
            add_children(nodes, node, n, nodes[node, CHILD])
            n += 9
        side //= 3
        node = nodes[node, CHILD] + 3 * (row // side % 3) + col // side % 3
    return nodes, n, node


@kernel
def add_children(nodes: np.ndarray, node: int, first: int, state: int) -> None:
    """Write the nine children of a node."""
    nodes[node, CHILD] = first
    for j in range(9):
        nodes[first + j, CHILD], nodes[first + j, LEVEL] = state, nodes[node, LEVEL] + 1
        nodes[first + j, ROW], nodes[first + j, COL] = 3 * nodes[node, ROW] + j // 3, 3 * nodes[node, COL] + j % 3


@kernel
def mark_covered(nodes: np.ndarray, node: int) -> None:
    """Turn all absent cells of a tree into leaves."""
    if nodes[node, CHILD] == ABSENT:
        nodes[node, CHILD] = LEAF
    if nodes[node, CHILD] == LEAF:
        return
    stack, height = np.empty(_STACK, np.int64), 1
    stack[0] = node
    while height > 0:
        height -= 1
        at = stack[height]
        if nodes[at, CHILD] == ABSENT:
            nodes[at, CHILD] = LEAF
        elif nodes[at, CHILD] >= 0:
            for j in range(9):
                stack[height + j] = nodes[at, CHILD] + j
            height += 9


@kernel
def divide_cells(nodes: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Divide leaves into nine each, and return a larger table of nodes.

    Parameters
    ----------
    chosen : numbers of the leaves. The children of leaf i begin at ``len(nodes) + 9 * i``
    """
    n = len(nodes)
    larger = np.empty((n + 9 * len(chosen), 4), np.int64)
    larger[:n] = nodes
    for i in range(len(chosen)):
        add_children(larger, chosen[i], n + 9 * i, LEAF)
    return larger


@kernel
def list_leaves(root: np.ndarray, nodes: np.ndarray, k: int) -> np.ndarray:
    """Return the numbers of all leaves (leaf) i4, pixel by pixel.

    Parameters
    ----------
    k : coarse cells along each side of a pixel
    """
    leaves, n = np.empty(len(nodes), np.int32), 0
    stack = np.empty(_STACK, np.int64)
    for top in range(0, root.shape[0], k):
        for left in range(0, root.shape[1], k):
            for row in range(top, top + k):
                for col in range(left, left + k):
                    at = int(root[row, col])
                    if at == NO_ROOT:
                        continue
                    if nodes[at, CHILD] == LEAF:
                        leaves[n] = at
                        n += 1
                        continue
                    stack[0], height = at, 1
                    while height > 0:
                        height -= 1
                        at = stack[height]
                        if nodes[at, CHILD] == LEAF:
                            leaves[n] = at
                            n += 1
                        elif nodes[at, CHILD] >= 0:
                            for j in range(9):
                                stack[height + j] = nodes[at, CHILD] + 8 - j
                            height += 9
    return leaves[:n].copy()


@kernel
def place_rays(nodes: np.ndarray, chosen: np.ndarray, k: int, n_cols: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the rays of cells: points (col_row, ray) on the focal plane [pixels], pixels and weights (ray).

    Parameters
    ----------
    chosen : numbers of the cells
    k : coarse cells along each side of a pixel
    n_cols : columns of pixels
    """
    n = len(chosen)
    point, pixel, weight = np.empty((2, n)), np.empty(n, np.int32), np.empty(n)
    for i in range(n):
        node = chosen[i]
        size, row, col = k * SIDES[nodes[node, LEVEL]], nodes[node, ROW], nodes[node, COL]
        point[0, i], point[1, i] = (col + 0.5) / size, (row + 0.5) / size
        pixel[i] = math.floor(point[1, i]) * n_cols + math.floor(point[0, i])
        weight[i] = 1.0 / (size * size)
    return point, pixel, weight


@kernel
def find_leaf(
    root: np.ndarray, first_row: int, first_col: int, nodes: np.ndarray, level: int, row: int, col: int
) -> int:
    """Return the leaf that holds the middle of a cell, -1 where there is none.

    Parameters
    ----------
    level, row, col : the cell, which need not exist
    """
    # In floats, which divide faster than integers; halves keep the quotients away from whole numbers.
    if level == 0:
        at_row, at_col = row - first_row, col - first_col
        if at_row < 0 or at_row >= root.shape[0] or at_col < 0 or at_col >= root.shape[1]:
            return -1
        node = int(root[at_row, at_col])
        while node >= 0 and nodes[node, CHILD] >= 0:
            node = nodes[node, CHILD] + _MIDDLE
        return node if node >= 0 and nodes[node, CHILD] == LEAF else -1
    side = SIDES[level]
    down, across = math.floor((row + 0.5) / side), math.floor((col + 0.5) / side)
    at_row, at_col = down - first_row, across - first_col
    if at_row < 0 or at_row >= root.shape[0] or at_col < 0 or at_col >= root.shape[1]:
        return -1
    node = int(root[at_row, at_col])
    if node == NO_ROOT:
        return -1
    left_row, left_col = row + 0.5 - down * side, col + 0.5 - across * side
    while nodes[node, CHILD] >= 0:
        if side > 1.0:
            side = np.round(side / 3.0)
            down, across = int(left_row / side), int(left_col / side)
            left_row, left_col = left_row - down * side, left_col - across * side
            node = nodes[node, CHILD] + 3 * down + across
        else:
            node = nodes[node, CHILD] + _MIDDLE
    return node if nodes[node, CHILD] == LEAF else -1
