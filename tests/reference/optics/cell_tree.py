"""Oracle of `rso_lidar.optics.rays.cell_tree`: trees of cells as sets of leaves, cell by cell."""

import numpy as np

from rso_lidar.optics.rays.cell_tree import CHILD, COL, LEAF, LEVEL, NO_ROOT, ROW
from tests.reference.optics.pixel_rays import cover, touched

MARGIN = 0.75  # cells


def leaves_of(root, nodes):
    """Return {node: (level, row, col)} of all leaves, in the order of the roots and then of the children."""
    found = {}

    def visit(node):
        child = int(nodes[node, CHILD])
        if child == LEAF:
            found[node] = tuple(int(nodes[node, column]) for column in (LEVEL, ROW, COL))
        elif child >= 0:
            for j in range(9):
                visit(child + j)

    for node in root.ravel():
        if node != NO_ROOT:
            visit(int(node))
    return found


def plant_roots(boxes, levels, corners, starts, off, outlines_of, k, n_rows, n_cols):
    """Return the leaves {(level, row, col)}: a covered cell, unless others cover parts of it at a finer level."""
    marked = set()
    for t, level in enumerate(levels.tolist()):
        r0, r1, c0, c1 = touched(boxes[t].tolist(), (n_rows * k, n_cols * k))
        if r0 >= r1 or c0 >= c1:
            continue
        grid = 3**level
        block = np.zeros(((r1 - r0) * grid, (c1 - c0) * grid), np.int16)
        area = (r0 * grid, c0 * grid), (r0 * grid, r1 * grid), (c0 * grid, c1 * grid)
        if level > 0:  # with one cell to spare on each side
            area = (
                area[0],
                *(
                    (max(low, int(np.ceil(box[0] * grid - 0.5)) - 1), min(high, int(np.ceil(box[1] * grid - 0.5)) + 1))
                    for (low, high), box in zip(area[1:], boxes[t].T, strict=True)
                ),
            )
        if outlines_of[t, 0] < 0:
            (top, bottom), (left, right) = area[1:]
            block[top - r0 * grid : bottom - r0 * grid, left - c0 * grid : right - c0 * grid] = 1
        else:
            cover(block, 1, *area, grid, corners, starts, off + MARGIN / grid, *outlines_of[t].tolist())
        marked |= {(level, r0 * grid + row, c0 * grid + col) for row, col in np.argwhere(block).tolist()}
    above = set()
    for level, row, col in marked:
        while level > 0:
            level, row, col = level - 1, row // 3, col // 3
            above.add((level, row, col))
    leaves = set()

    def visit(cell, is_covered):
        is_covered = is_covered or cell in marked
        if cell in above:
            level, row, col = cell
            for j in range(9):
                visit((level + 1, 3 * row + j // 3, 3 * col + j % 3), is_covered)
        elif is_covered:
            leaves.add(cell)

    for cell in {cell for cell in marked | above if cell[0] == 0}:
        visit(cell, False)
    return leaves


def list_leaves(root, nodes, k):
    """Return the numbers of all leaves, by pixel, then by coarse cell, then by the order of the children."""
    leaves = leaves_of(root, nodes)

    def order(node):
        level, row, col = leaves[node]
        path = [(row // 3**up, col // 3**up) for up in range(level, -1, -1)]
        return path[0][0] // k, path[0][1] // k, path

    return sorted(leaves, key=order)


def divide_cells(nodes, chosen):
    """Return the table of nodes with nine children for each chosen leaf."""
    larger = nodes.tolist()
    for node in chosen.tolist():
        _, level, row, col = nodes[node].tolist()
        larger[node][CHILD] = len(larger)
        larger += [[LEAF, level + 1, 3 * row + r, 3 * col + c] for r in range(3) for c in range(3)]
    return np.array(larger, np.int32)


def place_rays(nodes, chosen, k, n_cols):
    """Return points (col_row, ray), pixels and weights of the rays through the middles of cells."""
    size = k * 3.0 ** nodes[chosen, LEVEL]
    point = np.stack([nodes[chosen, COL] + 0.5, nodes[chosen, ROW] + 0.5]) / size
    return point, np.floor(point[1]).astype(int) * n_cols + np.floor(point[0]).astype(int), size**-2.0


def find_leaf(root, first_row, first_col, nodes, level, row, col):
    """Return the leaf that holds the middle of a cell, -1 where there is none."""
    y, x = (row + 0.5) / 3**level, (col + 0.5) / 3**level
    for node, (deep, r, c) in leaves_of(root, nodes).items():
        side = 3**deep
        if r <= y * side < r + 1 and c <= x * side < c + 1:
            return node
    return -1
