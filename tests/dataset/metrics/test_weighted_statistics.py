import numpy as np
import pytest

from rso_lidar.dataset.metrics.resampling import EncounterIndex
from rso_lidar.dataset.metrics.weighted_statistics import Mean, Quantile, Ratios

SAMPLES = np.array([3, 3, 4, 5, 5, 6, 7, 8, 9, 9])
VALUES = np.array([1.0, 5.0, 2.0, 8.0, 3.0, 9.0, 4.0, 0.5, 7.0, 6.0])


def draw(count=40):
    encounters = EncounterIndex(SAMPLES)
    return encounters, np.concatenate([*encounters.draw(count)])


def repeated(encounters, weights, values):
    """Return values with each frame repeated as often as its encounter was drawn."""
    return np.repeat(values, weights[encounters.index].astype(int))


def test_a_weight_is_a_number_of_copies():
    encounters, drawn = draw()
    everywhere = np.ones(10)
    mean, rms = (Ratios(encounters, part, everywhere, root=root) for part, root in ((VALUES, False), (VALUES**2, True)))
    median, high = (Quantile(encounters, VALUES, everywhere > 0, level) for level in (0.5, 0.9))
    for weights in drawn:
        copies = repeated(encounters, weights, VALUES)
        assert mean.evaluate(weights[None])[0] == pytest.approx(copies.mean())
        assert rms.evaluate(weights[None])[0] == pytest.approx(np.sqrt(np.mean(copies**2)))
        assert median.evaluate(weights[None])[0] == pytest.approx(np.median(copies))
        assert high.evaluate(weights[None])[0] == pytest.approx(
            np.quantile(copies, 0.9, method="averaged_inverted_cdf")
        )


def test_columns_without_anything_are_left_out_of_the_mean():
    encounters = EncounterIndex(np.arange(4))
    above = np.array([[1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 1, 0]])
    below = np.array([[1, 1, 0], [1, 1, 0], [0, 1, 0], [0, 1, 0]])
    assert Ratios(encounters, above, below).evaluate(np.ones((1, 4)))[0] == pytest.approx((1.0 + 0.75) / 2)
    assert np.isnan(Ratios(encounters, above[:, 2], below[:, 2]).evaluate(np.ones((1, 4)))[0])
    assert Ratios(encounters, above, below).count() == (4, 4)


def test_failures_are_infinite_and_move_the_median():
    encounters = EncounterIndex(np.arange(4))
    values = np.array([1.0, 2.0, np.inf, np.inf])
    assert Quantile(encounters, values, np.array([1, 1, 1, 0], bool)).evaluate(np.ones((1, 4)))[0] == 2.0
    assert Quantile(encounters, values, np.ones(4, bool)).evaluate(np.ones((1, 4)))[0] == np.inf
    assert np.isnan(Quantile(encounters, values, np.zeros(4, bool)).evaluate(np.ones((1, 4)))[0])


def test_means_leave_out_what_has_no_value():
    encounters = EncounterIndex(np.arange(3))
    parts = [
        Ratios(encounters, np.array(one), np.array(two)) for one, two in (([1, 0, 0], [1, 1, 0]), ([0] * 3, [0] * 3))
    ]
    assert Mean(tuple(parts)).evaluate(np.ones((2, 3))).tolist() == [0.5, 0.5]
    assert np.isnan(Mean((parts[1],)).evaluate(np.ones((1, 3)))[0])


def test_few_encounters_have_no_interval():
    encounters = EncounterIndex(np.arange(5))
    statistic = Quantile(encounters, np.arange(5.0), np.ones(5, bool))
    low, high, method = statistic.find_interval(np.linspace(0, 4, 100), 0.95)
    assert np.isnan(low) and np.isnan(high) and "fewer than 8" in method


def test_bootstrap_intervals_of_a_median_cover():
    rng, covered, trials = np.random.default_rng(5), 0, 150
    encounters = EncounterIndex(np.repeat(np.arange(50), 3))
    drawn = np.concatenate([*encounters.draw(300)])
    for _ in range(trials):
        values = np.repeat(rng.normal(size=50), 3) + 0.3 * rng.normal(size=150)  # median 0, by symmetry
        statistic = Quantile(encounters, values, np.ones(150, bool))
        low, high, _ = statistic.find_interval(statistic.evaluate(drawn), 0.9)
        covered += low <= 0.0 <= high
    assert 0.82 < covered / trials < 0.97  # 0.9, and three standard deviations of 150 trials
