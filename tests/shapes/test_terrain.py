"""Ground made by seed."""

import numpy as np
import pytest

from rso_lidar.errors import MeshError
from rso_lidar.shapes import Abundance, build_ground
from rso_lidar.shapes.terrain import height_at

CRATERS, ROCKS = Abundance(2.0, 16.0, 1.0), Abundance(0.5, 5.0, 0.1)


def test_the_same_seed_makes_the_same_ground():
    one, same, other = (build_ground(seed, 64.0, 0.5, CRATERS, ROCKS) for seed in (1, 1, 2))
    assert np.array_equal(one.heights_m, same.heights_m)
    assert np.array_equal(one.boulders.vertices, same.boulders.vertices)
    assert not np.allclose(one.heights_m, other.heights_m, atol=0.1)


def test_other_rocks_leave_the_craters_as_they_are():
    bare = build_ground(1, 64.0, 0.5, CRATERS, Abundance(0.5, 5.0, 0.0))
    assert bare.boulders is None
    assert np.array_equal(bare.heights_m, build_ground(1, 64.0, 0.5, CRATERS, ROCKS).heights_m)
    assert bare.heights_m.shape == (129, 129)
    assert abs(bare.heights_m.mean()) < 1e-12


def test_boulders_stand_on_the_ground():
    ground = build_ground(1, 64.0, 0.5, CRATERS, ROCKS)
    bodies = ground.boulders.vertices.reshape(-1, 50, 3)  # 4 rings of 12, the top, and the middle underneath
    top, under = bodies[:, -2], bodies[:, -1]
    level = height_at(ground.heights_m, 0.5, top[:, 0], top[:, 1])
    assert np.all(top[:, 2] > level)
    assert np.all(under[:, 2] < level)


def test_heights_between_those_of_a_grid():
    heights = np.array([[3.0, 4.0], [1.0, 2.0]])  # the north is above
    assert height_at(heights, 2.0, np.array([-1.0, 1.0, 0.0]), np.array([1.0, -1.0, 0.0])).tolist() == [3.0, 2.0, 2.5]


def test_too_many_boulders_are_refused_with_the_cure():
    with pytest.raises(MeshError, match=r"boulders of 0\.05 m .*raise boulder_min_m"):
        build_ground(1, 400.0, 4.0, CRATERS, Abundance(0.05, 5.0, 0.5))
