"""Trees of cells against their oracle, which knows only sets of cells."""

import numpy as np
import pytest

from rso_lidar.kernels import packed
from rso_lidar.optics.rays import cell_tree
from rso_lidar.optics.rays.cells import Outlines
from tests.reference.optics import cell_tree as oracle

K, SHAPE = 2, (4, 5)


def targets(rng, levels):
    """Return bounds and outlines of one triangle for each level, about the focal plane, in coarse cells."""
    corners = rng.uniform(0.0, 9.0, (len(levels), 1, 2)) + rng.uniform(-1.0, 1.0, (len(levels), 3, 2)) * (
        4.0 / 3.0 ** np.array(levels)[:, None, None]
    )
    boxes = np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1)
    n = len(levels)
    of = np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)
    return packed(boxes), Outlines(packed(corners.reshape(-1, 2)), np.arange(0, 3 * n + 1, 3), np.zeros(n), packed(of))


def grown(rng, levels=(0, 1, 2), rounds=2):
    """Return trees of three targets, with some leaves divided again."""
    boxes, outlines = targets(rng, levels)
    tree = cell_tree.plant_cells(boxes, packed(np.array(levels)), outlines, K, SHAPE)
    nodes = tree.nodes
    for _ in range(rounds):
        leaves = cell_tree.list_leaves(tree.root, nodes, K)
        if len(leaves):
            nodes = cell_tree.divide_cells(nodes, packed(np.sort(rng.choice(leaves, len(leaves) // 9, replace=False))))
    return tree.root, tree.first_row, tree.first_col, nodes


@pytest.mark.parametrize("seed", range(6))
def test_planted_cells_are_those_that_targets_cover(seed):
    rng = np.random.default_rng(seed)
    levels = np.array([(0,), (2,), (0, 1), (1, 0, 3), (0, 2, 1), (0, 0)][seed])
    boxes, outlines = targets(rng, levels)
    tree = cell_tree.plant_cells(boxes, levels, outlines, K, SHAPE)
    expected = oracle.plant_roots(boxes, levels, *outlines, K, *SHAPE)
    assert set(oracle.leaves_of(tree.root, tree.nodes).values()) == expected
    assert len(expected) > 0


@pytest.mark.parametrize("seed", range(3))
def test_leaves_rays_and_neighbours(seed):
    rng = np.random.default_rng(seed)
    root, first_row, first_col, nodes = grown(rng)
    leaves = cell_tree.list_leaves(root, nodes, K)
    assert leaves.tolist() == oracle.list_leaves(root, nodes, K)
    for made, expected in zip(
        cell_tree.place_rays(nodes, leaves, K, SHAPE[1]),
        oracle.place_rays(nodes, leaves, K, SHAPE[1]),
        strict=True,
    ):
        np.testing.assert_allclose(made, expected, rtol=1e-14)
    pixel, weight = cell_tree.place_rays(nodes, leaves, K, SHAPE[1])[1:]
    assert (np.diff(pixel) >= 0).all()
    assert np.bincount(pixel, weight).max() <= 1.0 + 1e-12
    for _ in range(60):
        level = int(rng.integers(0, 5))
        row, col = rng.integers(-2, 11 * 3**level, 2).tolist()
        place = root, first_row, first_col, nodes, level, row, col
        assert cell_tree.find_leaf(*place) == oracle.find_leaf(*place)


def test_divided_cells_keep_their_area():
    rng = np.random.default_rng(5)
    root, _, _, nodes = grown(rng, rounds=0)
    leaves = cell_tree.list_leaves(root, nodes, K)
    chosen = packed(leaves[::5])
    np.testing.assert_array_equal(cell_tree.divide_cells(nodes, chosen), oracle.divide_cells(nodes, chosen))
    after = cell_tree.divide_cells(nodes, chosen)
    areas = [cell_tree.place_rays(t, cell_tree.list_leaves(root, t, K), K, SHAPE[1])[2].sum() for t in (nodes, after)]
    assert areas[0] == pytest.approx(areas[1], rel=1e-12)


def test_no_target_in_the_field_gives_no_cells():
    boxes = np.array([[[-9.0, -9.0], [-5.0, -5.0]]])
    outlines = Outlines(np.zeros((0, 2)), np.zeros(1, np.int64), np.zeros(0), np.array([[-1, -1]]))
    tree = cell_tree.plant_cells(boxes, np.array([0]), outlines, K, SHAPE)
    assert tree.root.size == 0
    assert len(cell_tree.list_leaves(tree.root, tree.nodes, K)) == 0


def test_cells_are_divided_below_the_deepest_that_are_planted():
    boxes, outlines = targets(np.random.default_rng(3), (9,))
    tree = cell_tree.plant_cells(boxes, np.array([9]), outlines, K, SHAPE)
    nodes = tree.nodes
    for _ in range(3):
        nodes = cell_tree.divide_cells(nodes, packed(cell_tree.list_leaves(tree.root, nodes, K)[-1:]))
    leaves = cell_tree.list_leaves(tree.root, nodes, K)
    assert nodes[leaves, 1].max() == 12
    assert set(leaves.tolist()) == set(oracle.leaves_of(tree.root, nodes))
