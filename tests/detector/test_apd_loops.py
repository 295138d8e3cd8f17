"""The avalanche as a loop: tables draw word for word as with NumPy, and the two paths make samples of one distribution."""

import numpy as np
import pytest
from scipy import stats

from rso_lidar import arithmetic
from rso_lidar.detector.alias import NORMAL_PER_SIGMA, NORMAL_ZERO, draw, normal_table, table, words
from rso_lidar.detector.apd import Apd, multiply
from rso_lidar.detector.apd_loops import drawn, multiplied


def test_a_word_draws_the_same_from_a_table_either_way():
    weights = np.random.default_rng(1).random((3, 37))
    tables = table([np.r_[np.zeros(5), weights[0]], weights[1], weights[2]])
    row = np.arange(3000) % 3
    by_numpy = draw(tables, np.random.default_rng(2), 3000, row)
    one_by_one = [drawn(word, tables, k) for word, k in zip(words(np.random.default_rng(2), 3000), row, strict=True)]
    assert np.array_equal(by_numpy, one_by_one)
    assert by_numpy[row == 0].min() >= 5.0


def test_the_normal_table_is_standard():
    """A million draws: mean, variance, fourth moment to 4.5 standard errors; and the whole distribution on the grid."""
    n = 1_000_000
    x = (draw(normal_table(), np.random.default_rng(3), n) - NORMAL_ZERO) / NORMAL_PER_SIGMA
    for power, moment, spread in ((1, 0.0, 1.0), (2, 1.0, 2.0), (4, 3.0, 96.0)):
        assert abs((x.astype(float) ** power).mean() - moment) < 4.5 * np.sqrt(spread / n)
    edges = np.arange(-4.0, 4.0, 0.125)
    above = np.searchsorted(np.sort(x), edges + 0.5 / NORMAL_PER_SIGMA) / n
    assert np.abs(above - stats.norm.cdf(edges + 0.5 / NORMAL_PER_SIGMA)).max() < 2.2 / np.sqrt(n)  # Kolmogorov, 1e-4
    assert np.abs(x).max() > 4.4


@pytest.mark.parametrize("mean", [4.9, 4.95, 8.3, 60.7, 110.0, 400.0])
def test_paths_draw_from_one_distribution(mean):
    """Two samples of 200,000: Kolmogorov-Smirnov, 1e-4."""
    samples = []
    for seed, path in enumerate(arithmetic.CHOICES):
        with arithmetic.using(path):
            samples.append(multiply(np.full(200_000, mean), Apd(), np.random.default_rng(seed), base=4.9))
    assert stats.ks_2samp(*samples).pvalue > 1e-4


def test_steps_do_not_know_of_each_other():
    """Steps of every kind side by side: each kind has the mean of its own, and neighbours do not correlate; 5 sigma."""
    means = np.tile(np.array([4.9, 4.9, 5.0, 30.3, 150.0, 500.0, 0.3, 0.0], np.float32), (50_000, 1))
    with arithmetic.using("numba"):
        x = multiply(means, Apd(), np.random.default_rng(5), base=4.9)
        assert multiply(means[:0], Apd(), np.random.default_rng(5), base=4.9).shape == (0, 8)
    assert np.all(np.abs(x.mean(axis=0) - 10.0 * means[0]) <= 5.0 * np.sqrt(352.0 * means[0] / 50_000))
    assert np.corrcoef(x[:, :7].T) == pytest.approx(np.eye(7), abs=5.0 / np.sqrt(50_000))
    assert len(multiplied.signatures) == 1
