import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import scene
from tests.optics.bench_for_tests import box, place, plate, sphere, surface, truth_of


def bounds(triangles, lidar_from_target):
    extent = scene.extent([surface("target", triangles)], truth_of(target=lidar_from_target))
    return np.stack([extent.low[0], extent.high[0]])


def test_bounds_of_a_box_ahead_by_hand():
    """The near face, at 10 - 1.5 m, is what shows."""
    expected = np.array([[0.5 - 1, -0.5 - 0.5], [0.5 + 1, -0.5 + 0.5]]) / 8.5
    seen = bounds(box(2, 1, 3), place((0.5, -0.5, 10)))
    assert seen[0] == pytest.approx([min(expected[0, 0], -0.5 / 11.5), expected[0, 1]], rel=1e-12)
    assert seen[1] == pytest.approx([expected[1, 0], max(0.0, 0.0)], abs=1e-12)


def test_bounds_hold_every_vertex_of_a_turned_mesh():
    rng = np.random.default_rng(8)
    for triangles in (sphere(3.0, 4), plate(6, n=8), box(4, 0.2, 1)):
        for _ in range(20):
            pose = place(rng.uniform([-5, -5, 8], [5, 5, 100]), Rotation.random(rng=rng))
            corners = pose.apply(triangles.reshape(-1, 3))
            low, high = bounds(triangles, pose)
            seen = corners[:, :2] / corners[:, 2:]
            # A flat sheet of many facets is bounded by its box, which may show a little more.
            assert np.all(low <= seen.min(axis=0) + 1e-12) and np.all(high >= seen.max(axis=0) - 1e-12)
            assert np.all(high - low <= 2 * np.ptp(seen, axis=0) + 1e-3)


def test_behind_the_lidar_nothing_and_beside_it_everywhere():
    low, high = bounds(box(1, 1, 1), place((0, 0, -10)))
    assert np.all(low > high)
    low, high = bounds(box(4, 4, 4), place((0, 1, 0)))  # the lidar stands inside
    assert np.all(low == -np.inf) and np.all(high == np.inf)


def test_targets_keep_their_order():
    targets = [surface(name, box(1, 1, 1)) for name in ("a", "b", "c")]
    truth = truth_of(a=place((1, 0, 10)), b=place((-1, 0, 10)), c=place((0, 0, -10)))
    extent = scene.extent(targets, truth)
    assert extent.low[0, 0] > 0 > extent.high[1, 0]
    assert extent.low[2, 0] == np.inf
