"""The avalanche as a loop: tables draw word for word as with NumPy, and the two paths make samples of one distribution."""

import numpy as np
import pytest
from scipy import stats

from rso_lidar.detector import Apd, multiply_rows
from rso_lidar.detector.settings.apd import cumulants
from rso_lidar.detector.stages import avalanche
from rso_lidar.detector.stages.alias_tables import (
    NORMAL_PER_SIGMA,
    NORMAL_ZERO,
    build_normal_table,
    build_tables,
    draw_from_table,
)
from rso_lidar.detector.stages.row_noise import AVALANCHE
from tests.detector.row_noise_for_tests import multiply, row_noise
from tests.reference import philox
from tests.reference.detector import avalanche as reference
from tests.reference.detector.alias_tables import draw, look_up, words


def test_a_word_draws_the_same_from_a_table_either_way():
    weights = np.random.default_rng(1).random((3, 37))
    tables = build_tables([np.r_[np.zeros(5), weights[0]], weights[1], weights[2]])
    row = np.arange(3000) % 3
    by_numpy = draw(tables, np.random.default_rng(2), 3000, row)
    one_by_one = [
        draw_from_table(word, tables.columns_log2, tables.cells, k, tables.first[k])
        for word, k in zip(words(np.random.default_rng(2), 3000), row, strict=True)
    ]
    assert np.array_equal(by_numpy, one_by_one)
    assert by_numpy[row == 0].min() >= 5.0


def test_the_normal_table_is_standard():
    """A million draws: mean, variance, fourth moment to 4.5 standard errors; and the whole distribution on the grid."""
    n = 1_000_000
    x = (draw(build_normal_table(), np.random.default_rng(3), n) - NORMAL_ZERO) / NORMAL_PER_SIGMA
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
    for seed, by in enumerate((avalanche.multiply, reference.multiply)):
        samples.append(multiply(np.full(200_000, mean), Apd(), np.random.default_rng(seed), base=4.9, by=by))
    assert stats.ks_2samp(*samples).pvalue > 1e-4


def test_steps_do_not_know_of_each_other():
    """Steps of every kind side by side: each kind has the mean of its own, and neighbours do not correlate; 5 sigma."""
    means = np.tile(np.array([4.9, 4.9, 5.0, 30.3, 150.0, 500.0, 0.3, 0.0], np.float32), (50_000, 1))
    x = multiply(means, Apd(), np.random.default_rng(5), base=4.9)
    assert multiply(means[:0], Apd(), np.random.default_rng(5), base=4.9).shape == (0, 8)
    assert np.all(np.abs(x.mean(axis=0) - 10.0 * means[0]) <= 5.0 * np.sqrt(352.0 * means[0] / 50_000))
    assert np.corrcoef(x[:, :7].T) == pytest.approx(np.eye(7), abs=5.0 / np.sqrt(50_000))
    assert len(multiply_rows.dispatcher.signatures) == 1


class Given:
    """Normal numbers that were drawn before, in place of a generator."""

    def __init__(self, numbers):
        self.numbers = numbers

    def standard_normal(self, size, dtype):
        return self.numbers.astype(dtype)


@pytest.mark.parametrize("mean", [100.5, 300.0, 1e4])  # varies fastest: tables of a gain are made once
@pytest.mark.parametrize("ionisation_ratio", [0.0, 0.2, 0.6])
@pytest.mark.parametrize("gain", [1.0, 10.0, 60.0])
def test_large_means_bend_a_normal_number_alike(mean, gain, ionisation_ratio):
    """By series and Newton's rounds, or in closed form: float32's rounding, and 1e-5 of the noise."""
    apd = Apd(gain=gain, ionisation_ratio=ionisation_ratio)
    noise = row_noise(np.random.default_rng(1))
    word = philox.rows(noise.key, noise.start, noise.pixel, AVALANCHE, 1000)[0]
    z = (look_up(build_normal_table(), word) - NORMAL_ZERO) / NORMAL_PER_SIGMA
    assert z.min() < -2.5 and z.max() > 2.5
    lam = np.full(len(z), mean, np.float32)
    made = avalanche.multiply(lam, avalanche.build_avalanche(apd), noise, base=1.0)
    noise = np.sqrt(cumulants(apd)[1] * mean)
    assert np.abs(made - reference.draw_bent(lam, apd, Given(z))).max() < 1e-5 * noise + 4e-7 * made.max()


def test_a_small_rest_is_poisson_too():
    """Gain 1 counts the primaries: two and three of 0.12 expected come as often as Poisson's law says, 4.5 sigma."""
    n = 2_000_000
    counted = multiply(np.full(n, 0.12), Apd(gain=1.0), np.random.default_rng(7), base=0.0)
    for number in (0, 1, 2, 3):
        share = stats.poisson.pmf(number, 0.12)
        assert abs(np.count_nonzero(counted == number) - n * share) < 4.5 * np.sqrt(n * share)
