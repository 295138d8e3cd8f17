"""Craters: how many of which size, and their shape."""

import numpy as np
import pytest

from rso_lidar.shapes.craters import DEPTH, EQUILIBRIUM, RIM, add_craters, crater_diameters, crater_heights


def test_numbers_follow_the_law_of_equilibrium():
    found = crater_diameters(1e6, 1.0, 100.0, 0.5, np.random.default_rng(1))
    for diameter in (1.0, 3.0, 10.0):
        expected = 0.5 * EQUILIBRIUM * (diameter**-2 - 100.0**-2) * 1e6
        # Poisson: five standard deviations.
        assert np.sum(found >= diameter) == pytest.approx(expected, abs=5.0 * expected**0.5)
    assert found.min() >= 1.0
    assert found.max() <= 100.0
    assert np.all(np.diff(found) <= 0.0)


def test_a_fresh_crater_has_pikes_depth_and_rim():
    assert crater_heights(np.array([0.0]))[0] == pytest.approx(RIM - DEPTH, abs=1e-15)
    assert crater_heights(np.array([1.0]))[0] == pytest.approx(RIM, abs=1e-15)
    assert crater_heights(np.array([1.0 - 1e-9]))[0] == pytest.approx(RIM, abs=1e-8)  # no step at the crest
    assert crater_heights(np.array([3.0, 9.0])).tolist() == [0.0, 0.0]


def test_few_craters_leave_most_of_the_ground_as_it_was():
    # 7.5 craters of 40 to 60 m are expected on 0.27 km2, half of it in the grid; their blankets cover 16 % of it each.
    x = np.linspace(-200.0, 200.0, 401)
    heights = add_craters(x, -x, 40.0, 60.0, 1.0, np.random.default_rng(2))
    assert heights.min() < -1.0
    assert heights.max() > 0.1
    assert np.mean(heights == 0.0) > 0.3


def test_a_grid_of_twice_the_cells_is_the_same_ground():
    coarse, fine = np.linspace(-64.0, 64.0, 65), np.linspace(-64.0, 64.0, 129)
    made = [add_craters(at, -at, 4.0, 32.0, 1.0, np.random.default_rng(3)) for at in (coarse, fine)]
    assert np.allclose(made[0], made[1][::2, ::2], rtol=0.0, atol=1e-12)  # rounding


def test_craters_outside_reach_in():
    # As many craters at the edge as in the middle: the spread of heights is alike there, within what 12 fields scatter.
    x = np.linspace(-64.0, 64.0, 129)
    fields = np.array([add_craters(x, -x, 4.0, 32.0, 1.0, np.random.default_rng(k)) for k in range(12)])
    edge, middle = fields[:, :, :16].std(axis=(1, 2)), fields[:, :, 56:72].std(axis=(1, 2))
    apart = (edge - middle).mean()
    assert abs(apart) < 4.0 * (edge - middle).std(ddof=1) / np.sqrt(12)
