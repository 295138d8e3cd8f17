"""Orders that tell the class are found: cycles, blocks, sorted files; random orders are not."""

import numpy as np
import pytest

from rso_lidar.dataset.checking.order_leaks import find_order_leaks

INDEX = np.arange(700)


@pytest.mark.parametrize(
    ("group", "rule"),
    [
        (INDEX % 7, "modulo 7 predicts it in 100% of 350 samples, and the most frequent class is right in 14%"),
        (INDEX // 100, "predicts it in"),
        (INDEX // 350, "blocks predicts it in 100%"),
        (np.where(INDEX % 5 == 3, 1, 0), "modulo 5 predicts it in 100% of 350 samples"),
        ((INDEX * 101 // 700) % 2, "predicts it in"),  # evenly interleaved with a period above those that are tried
        (INDEX // 2 % 7, "modulo 14 predicts it in 100%"),
    ],
)
def test_a_class_that_follows_from_the_number_is_found(group, rule):
    shuffled = np.random.default_rng(1).permutation(700)  # in whatever order the frames are read
    (line,) = find_order_leaks({"sample": shuffled}, group[shuffled])
    assert line.startswith("sample tells the class: ") and rule in line


def test_a_weak_trend_along_the_file_is_found():
    rng = np.random.default_rng(5)
    group = (rng.random(4000) < np.linspace(0.3, 0.7, 4000)).astype(int)
    (line,) = find_order_leaks({"place": np.arange(4000), "random": rng.permutation(4000)}, group)
    assert line.startswith("place tells the class") and "blocks" in line


def test_random_orders_raise_no_alarm():
    for seed in range(100):  # of 4,000 seeds none raised an alarm; 4 are allowed
        rng = np.random.default_rng(seed)
        sizes = (40, 40, 40, 40) if seed % 2 else (100, 30, 10)
        group = rng.permutation(np.repeat(np.arange(len(sizes)), sizes))
        place = np.where(rng.random(len(group)) < 0.6, np.arange(len(group)), -1)
        assert not find_order_leaks({"sample": np.arange(len(group)), "place": place}, group)


def test_few_samples_and_one_class_say_nothing():
    assert not find_order_leaks({"sample": np.arange(6)}, np.arange(6) % 2)
    assert not find_order_leaks({"sample": INDEX}, np.zeros(700, int))
    assert not find_order_leaks({"sample": np.full(20, -1)}, np.arange(20) % 2)
