"""Pixels that outlines touch, against each pixel in turn."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from rso_lidar.optics.rays.outlines import cover_pixels
from tests.reference.optics import scan_lines as oracle

ROWS, COLS = 14, 18
NEAR = 0.75  # pixels: how far from the middle of a pixel an outline may be that still covers it


def draw_outline(rng):
    """Return a convex outline (corner, row_col) that may reach out of the focal plane: of any size and any width."""
    middle = rng.uniform(-1.0, [ROWS + 1, COLS + 1])
    points = middle + rng.normal(0.0, 1.0, (12, 2)) * rng.choice([0.02, 0.5, 4.0], 2)
    return points[ConvexHull(points).vertices]


@pytest.mark.parametrize("seed", range(12))
def test_outlines_cover_the_pixels_that_they_touch_and_few_others(seed):
    rng = np.random.default_rng(seed)
    outlines = [draw_outline(rng) for _ in range(4)]
    of, per_side = np.array([[0, 1], [-1, -1], [1, 3], [3, 4]]), np.array([7, 3, 2, 5])
    boxes = [(a.min(axis=0), a.max(axis=0)) for a in outlines]
    bounds = np.array(
        [
            boxes[0],
            ((2.5, 3.0), (3.9, 4.5)),
            (np.minimum(*[b[0] for b in boxes[1:3]]), np.maximum(*[b[1] for b in boxes[1:3]])),
            boxes[3],
        ]
    )
    starts = np.cumsum([0, *map(len, outlines)])
    sides, top, left = cover_pixels(bounds, np.concatenate(outlines), starts, np.zeros(4), of, per_side, ROWS, COLS)
    covered = np.zeros((ROWS, COLS), int)
    covered[top : top + sides.shape[0], left : left + sides.shape[1]] = sides
    least, most = np.zeros((2, ROWS, COLS), int)
    least[2:4, 3:5] = most[2:4, 3:5] = 3
    for row in range(ROWS):
        for col in range(COLS):
            for target, number in ((0, 0), (2, 1), (2, 2), (3, 3)):
                for found, half in ((least, 0.5 - 1e-9), (most, NEAR)):
                    if oracle.touches(outlines[number], (row + 0.5, col + 0.5), half):
                        found[row, col] = max(found[row, col], per_side[target])
    assert (covered >= least).all() and (covered <= most).all()


def test_targets_out_of_view_cover_nothing():
    corners, of = np.empty((0, 2)), np.array([[-1, -1]])
    for low, high in (((-3.0, 2.0), (-0.1, 4.0)), ((5.0, 5.0), (4.0, 6.0)), ((np.inf, np.inf), (-np.inf, -np.inf))):
        sides, *_ = cover_pixels(
            np.array([[low, high]]), corners, np.zeros(1, int), np.empty(0), of, np.array([2]), ROWS, COLS
        )
        assert sides.size == 0
