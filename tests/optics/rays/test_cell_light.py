"""The light of cells and the contours through them against their oracle."""

import numpy as np
import pytest

from rso_lidar.kernels import packed
from rso_lidar.optics.rays import cell_light, cell_tree
from tests.optics.rays.test_cell_tree import SHAPE, K, grown
from tests.reference.optics import cell_light as oracle


def scene(seed):
    """Return trees, their leaves, light of the nodes and which are hit, and contours across them."""
    rng = np.random.default_rng(seed)
    tree = grown(rng)
    n = len(tree[3])
    light = packed(np.where(rng.random(n) < 0.3, 0.0, rng.uniform(10.0, 90.0, n)))
    ends = rng.uniform(-1.0, 6.0, (40, 4))
    ends[::4, 2:] = ends[::4, :2] + rng.normal(0.0, 0.1, (10, 2))  # short ones
    ends[1::8, 2] = ends[1::8, 0]  # upright ones
    steps = np.where(rng.random(40) < 0.1, -5.0, rng.uniform(1.0, 200.0, 40))
    return tree, cell_tree.list_leaves(tree[0], tree[3], K), light, light > 0.0, packed(ends), packed(steps)


@pytest.mark.parametrize("seed", range(3))
def test_variance_and_contours(seed):
    tree, leaves, light, is_hit, ends, steps = scene(seed)
    made, expected = [], []
    for module, out in ((cell_light, made), (oracle, expected)):
        variance, least_step, step, brightest = np.zeros((4, len(light)))
        is_active = np.ones(len(steps), bool)
        module.estimate_variance(*tree, leaves, light, is_hit, K, variance, least_step, brightest)
        out += [variance.copy(), least_step, brightest]
        module.mark_crossed(*tree, ends, steps, is_active, K, least_step, step)
        module.settle_variance(tree[3], leaves, K, least_step, step, variance)
        out += [step, is_active, variance]
    assert expected[3].any() and not expected[4].all()
    for one, other in zip(made, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_sums_and_choice(seed):
    tree, leaves, light, _, _, _ = scene(seed)
    rng = np.random.default_rng(seed)
    variance = packed(np.where(rng.random(len(light)) < 0.5, 0.0, rng.uniform(0.0, 2.0, len(light))))
    made = cell_light.sum_pixels(tree[3], leaves, light, variance, K, SHAPE[1])
    for one, other in zip(made, oracle.sum_pixels(tree[3], leaves, light, variance, K, SHAPE[1]), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)
    bound = rng.uniform(0.0, 2.0, len(made[1]))
    order = packed(rng.permutation(len(made[1]))[:20])
    for most in (0, 30, 10_000):
        given = made[0], leaves, variance, bound, order, most
        chosen = cell_light.choose_cells(*given)
        assert chosen.tolist() == oracle.choose_cells(*given)
        assert len(chosen) <= most
