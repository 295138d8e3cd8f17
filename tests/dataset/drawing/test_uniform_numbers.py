"""Uniform numbers by address: the kernel against NumPy, and independence of other draws."""

import numpy as np
from scipy import stats

from rso_lidar.dataset.drawing.uniform_numbers import HaltonPoints, draw_seed, draw_shares, fill_shares
from rso_lidar.kernels import packed
from tests.reference.dataset import uniform_numbers as reference


def test_against_the_oracle():
    key = packed(np.array([123456789, 987654321], np.uint32))
    number = np.array([0, 1, 77, 2**31 + 5])
    made, expected = np.empty((4, 3)), np.empty((4, 3))
    fill_shares(key, number, 0xDEADBEEF, 0x12345678, made)
    reference.fill_shares(key, number, 0xDEADBEEF, 0x12345678, expected)
    assert np.array_equal(made, expected)


def test_a_share_depends_on_its_own_address_only():
    many = draw_shares(3, "a", np.arange(50), "range", 2)
    assert np.array_equal(draw_shares(3, "a", np.array([17]), "range", 2)[0], many[17])
    for other in (
        draw_shares(4, "a", np.arange(50), "range", 2),
        draw_shares(3, "b", np.arange(50), "range", 2),
        draw_shares(3, "a", np.arange(50), "energy", 2),
    ):
        assert not np.isclose(other, many).any()


def test_shares_are_even():
    many = draw_shares(1, "a", np.arange(20_000), "range", 2)
    assert many.min() >= 0.0 and many.max() < 1.0
    assert all(stats.kstest(column, "uniform").pvalue > 1e-6 for column in many.T)
    assert abs(np.corrcoef(many.T)[0, 1]) < 5 / np.sqrt(20_000)


def test_seeds_of_noise_differ():
    seeds = {draw_seed(1, name, number, draw) for name in "ab" for number in range(20) for draw in range(3)}
    assert len(seeds) == 120 and all(0 <= seed < 2**63 for seed in seeds)


def test_halton_points_cover_better_than_random_ones():
    points = HaltonPoints(1, "a", 2)
    halton = np.array([points.at(number) for number in range(256)])
    assert np.array_equal(HaltonPoints(1, "a", 2).at(200), halton[200])
    random = draw_shares(1, "a", np.arange(256), "range", 2)
    assert stats.qmc.discrepancy(halton) < 0.2 * stats.qmc.discrepancy(random)


def test_a_halton_point_costs_the_same_at_any_number():
    points, beyond = HaltonPoints(1, "a", 2), HaltonPoints(1, "a", 2).at(10**15)  # one by one it would take years
    assert np.array_equal(points.at(10**15), beyond) and not np.array_equal(points.at(10**15 + 1), beyond)
    sequence = HaltonPoints(1, "a", 2)._sequence
    assert np.array_equal(sequence.random(6)[5], points.at(5))
