"""At least m of n pixels, and k of n flashes, against all outcomes counted one by one."""

from itertools import product

import numpy as np
import pytest

from rso_lidar.detector import at_least, estimate_k_of_n, k_of_n


@pytest.mark.parametrize("least", [1, 2, 3, 5, 6])
def test_at_least_is_the_sum_over_all_outcomes(least):
    each = np.array([0.0, 0.1, 0.35, 0.5, 0.8, 1.0])
    wanted = sum(
        np.prod(np.where(outcome, each, 1.0 - each))
        for outcome in product((False, True), repeat=6)
        if sum(outcome) >= least
    )
    assert at_least(each, least) == pytest.approx(wanted, abs=1e-12)


def test_at_least_of_many_sure_pixels_is_certain_and_of_too_few_impossible():
    assert at_least(np.full(5000, 0.9), 100) == 1.0
    assert at_least(np.ones(3), 4) == at_least(np.zeros(10), 1) == at_least(np.empty(0), 1) == 0.0


def test_k_of_n_is_the_binomial_law():
    p = np.array([0.0, 0.2, 0.7, 1.0])
    np.testing.assert_allclose(k_of_n(p, 2, 3), 3.0 * p**2 * (1.0 - p) + p**3, atol=1e-12)
    np.testing.assert_allclose(k_of_n(p, 1, 1), p, atol=1e-15)


@pytest.mark.parametrize(("needed", "flashes"), [(1, 1), (2, 3), (3, 3), (1, 4)])
def test_the_estimate_from_trials_is_unbiased(needed, flashes):
    tried, p = 7, 0.37
    law = [k_of_n(np.array([p]), s, tried)[0] - k_of_n(np.array([p]), s + 1, tried)[0] for s in range(1, tried)]
    law = [(1.0 - p) ** tried, *law, p**tried]
    mean = sum(weight * estimate_k_of_n(s, tried, needed, flashes) for s, weight in enumerate(law))
    assert mean == pytest.approx(float(k_of_n(np.array(p), needed, flashes)), abs=1e-12)
