"""Leaks: found if the ranges of a class differ, and not if classes differ by chance only."""

import numpy as np

from rso_lidar.dataset.checking.statistics import find_constants, find_leaks


def test_equal_laws_leak_in_no_case():
    rng = np.random.default_rng(2)
    for _ in range(50):
        columns = {"range": rng.lognormal(size=700), "energy": rng.random(700)}
        assert not find_leaks(columns, rng.integers(0, 7, 700), "abcdefg")


def test_a_nearest_range_that_differs_is_found():
    rng = np.random.default_rng(3)
    group = np.repeat([0, 1], 400)
    range_m = np.exp(rng.uniform(np.where(group == 0, np.log(60), np.log(90)), np.log(3000)))
    (line, *_) = find_leaks({"range": range_m}, group, ("small", "large"))
    assert "range tells the class" in line and "'large'" in line and "begins at 9" in line


def test_another_distribution_is_found():
    rng = np.random.default_rng(4)
    group = np.repeat([0, 1, 2], 200)
    lines = find_leaks({"energy": rng.normal(size=600) + (group == 1)}, group, "abc")
    assert any("'b'" in line and "Kolmogorov" in line for line in lines)


def test_few_samples_say_nothing():
    assert not find_leaks({"range": np.arange(8.0)}, np.repeat([0, 1], 4), "ab")


def test_a_target_that_is_always_centred_is_found():
    assert "centred" in find_constants(np.full(40, 0.5), np.full(40, 100))[0]
    assert not find_constants(np.linspace(0, 40, 40), np.full(40, 100))
    assert "25.0% of the frames" in find_constants(np.linspace(0, 40, 40), np.tile([0, 1, 1, 1, -1], 8))[0]
