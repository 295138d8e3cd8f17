"""The random order of samples is a permutation of all, and splits have their shares in each ten samples of a class."""

import numpy as np
import pytest
from scipy.stats import chi2

from rso_lidar.dataset.drawing.sample_order import assign_splits, shuffle_samples


@pytest.mark.parametrize("count", [1, 2, 5, 14, 15, 100, 2801])
def test_every_place_occurs_once(count):
    places = shuffle_samples(3, np.arange(count), count)
    assert sorted(places) == list(range(count))
    chosen = np.arange(count)[::-3]
    assert np.array_equal(shuffle_samples(3, chosen, count), places[chosen])  # each by itself


@pytest.mark.parametrize("count", [5, 14])
def test_every_place_is_equally_likely(count):
    seeds = 2000
    places = np.array([shuffle_samples(seed, np.arange(count), count) for seed in range(seeds)])
    table = np.array([np.bincount(column, minlength=count) for column in places.T])
    statistic = ((table - seeds / count) ** 2 / (seeds / count)).sum()
    assert chi2.ppf(1e-4, (count - 1) ** 2) < statistic < chi2.ppf(1.0 - 1e-4, (count - 1) ** 2)
    after = (places[:, 1] - places[:, 0]) % count  # from 1 to count - 1, if the order of two samples is random too
    counts = np.bincount(after, minlength=count)[1:]
    assert ((counts - seeds / (count - 1)) ** 2 / (seeds / (count - 1))).sum() < chi2.ppf(1.0 - 1e-4, count - 2)


@pytest.mark.parametrize(
    ("val", "test", "expected"),
    [
        (0.0, 0.4, [24, 0, 16]),
        (0.1, 0.2, [28, 4, 8]),
        (0.25, 0.0, [30, 10, 0]),
        (0.05, 0.05, [35, 3, 2]),  # the first ten hold one of each, which is one more than their share
        (0.01, 0.98, [1, 1, 38]),
    ],
)
def test_forty_samples_are_divided_by_their_shares(val, test, expected):
    for seed in range(5):
        splits = assign_splits(seed, "a", np.arange(40), val, test)
        assert np.bincount(splits, minlength=3).tolist() == expected
        assert np.array_equal(assign_splits(seed, "a", np.arange(17, 23), val, test), splits[17:23])
        kinds = 1 + (val > 0.0) + (test > 0.0)
        assert len({*splits[:kinds].tolist()}) == kinds  # a class of so few samples is in all splits


def test_twelve_samples_of_a_class_are_divided_six_three_three():
    for seed in range(20):
        splits = assign_splits(seed, "a", np.arange(13), 0.25, 0.25)
        assert [np.bincount(splits[:size], minlength=3).tolist() for size in (4, 8, 12)] == [
            [2, 1, 1],
            [4, 2, 2],
            [6, 3, 3],
        ]
        assert np.array_equal(assign_splits(seed, "a", np.arange(200), 0.25, 0.25)[:13], splits)  # a class that grows


def test_which_samples_are_tested_is_random():
    seeds = 2000
    tested = np.array([assign_splits(seed, "a", np.arange(20), 0.0, 0.4) == 2 for seed in range(seeds)])
    assert not np.array_equal(tested[0, :10], tested[0, 10:]) and not np.array_equal(tested[0], tested[1])
    # of the first two samples one is tested, then three of eight, then four of ten
    expected = np.repeat([0.5, 3 / 8, 0.4], [2, 8, 10])
    assert np.abs(tested.mean(axis=0) - expected).max() < 4.5 * np.sqrt(0.25 / seeds)
