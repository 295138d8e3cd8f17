import numpy as np
import pytest
from scipy import stats

from rso_lidar.detector.curve_fit.curve_prediction import CurveReference
from rso_lidar.detector.curve_fit.likelihood import count_informative, find_residuals
from tests.detector.curve_fit.bench_for_tests import make_curve


def refer(n, scatter=1.0, kurtosis=3.0, trials=np.inf):
    none = np.zeros(n)
    return CurveReference(none, none, np.full(n, scatter), np.full(n, kurtosis), trials)


def test_the_squares_of_a_rate_are_twice_the_loss_of_likelihood():
    curve = make_curve("detection_rate", [1.0, 1.0], [0.3, 0.0], [50, 50])
    expected = np.array([0.4, 0.02])
    best, model = (stats.binom.logpmf([15, 0], 50, p) for p in ([0.3, 0.0], expected))
    assert find_residuals(curve, expected, refer(2)) ** 2 == pytest.approx(2.0 * (best - model), rel=1e-9)


def test_the_squares_of_dark_counts_are_twice_the_loss_of_likelihood():
    curve = make_curve("dark_counts", [0.0, 0.0], [7.0, 0.0], [1.0, 1.0])
    expected = np.array([4.2, 1.5])
    loss = stats.poisson.logpmf([7, 0], [7.0, 0.0]) - stats.poisson.logpmf([7, 0], expected)
    assert find_residuals(curve, expected, refer(2)) ** 2 == pytest.approx(2.0 * loss, rel=1e-9)


@pytest.mark.parametrize("law", ["normal", "uniform", "laplace"])
def test_residuals_of_scatters_have_variance_one_whatever_the_law(law):
    rng = np.random.Generator(np.random.Philox(5))
    draw = {"normal": rng.standard_normal, "uniform": lambda size: rng.uniform(-1, 1, size), "laplace": rng.laplace}
    some = rng.laplace(size=(4000, 400)) if law == "laplace" else draw[law](size=(4000, 400))
    kurtosis = {"normal": 3.0, "uniform": 1.8, "laplace": 6.0}[law]
    scatter = {"normal": 1.0, "uniform": 3.0**-0.5, "laplace": 2.0**0.5}[law]
    curve = make_curve("range_scatter", np.ones(4000), some.std(axis=1), np.full(4000, 400))
    residuals = find_residuals(curve, np.full(4000, scatter), refer(4000, scatter, kurtosis))
    # Standard error of a variance of 4000 numbers: 2.2 %. The logarithm adds some % where tails are long.
    assert residuals.var() == pytest.approx(1.0, abs=0.12)


def test_a_walk_has_a_free_constant():
    curve = make_curve("walk", np.ones(3), np.array([0.51, 0.49, 0.50]), np.full(3, 100))
    shifted = make_curve("walk", np.ones(3), curve.value + 7.0, curve.trials)
    first, second = (find_residuals(one, np.zeros(3), refer(3, 0.1)) for one in (curve, shifted))
    assert first == pytest.approx(second, abs=1e-9)
    assert first == pytest.approx([1.0, -1.0, 0.0], abs=1e-9)
    assert count_informative(curve, np.zeros(3)) == 2


def test_own_trials_and_errors_of_the_bench_lower_the_weight():
    curve = make_curve("range_mean", [1.0], [0.03], [100])
    assert find_residuals(curve, np.zeros(1), refer(1, 0.1)) == pytest.approx([3.0])
    assert find_residuals(curve, np.zeros(1), refer(1, 0.1, trials=100)) == pytest.approx([3.0 / 2.0**0.5])


def test_rates_near_one_count_for_less_than_a_point():
    curve = make_curve("detection_rate", np.ones(3), [0.5, 1.0, 1.0], np.full(3, 100))
    rng = np.random.Generator(np.random.Philox(6))
    expected = np.array([0.5, 0.99, 0.9999])
    drawn = rng.binomial(100, expected, (20_000, 3)) / 100.0
    mean = sum(
        float((find_residuals(make_curve("detection_rate", np.ones(3), row, curve.trials), expected, refer(3)) ** 2).sum())
        for row in drawn[:2000]
    ) / 2000.0  # fmt: skip
    # A point beyond 1 counts as 1; the standard error of the mean is 3 %.
    assert count_informative(curve, expected) == pytest.approx(mean, abs=0.3)
    assert count_informative(curve, expected) < 2.2


def test_points_that_a_detector_does_not_report_have_large_residuals():
    curve = make_curve("counts_mean", np.ones(2), [5.0, 6.0], [10, 10])
    assert abs(find_residuals(curve, np.array([np.nan, 6.0]), refer(2)))[0] > 50.0
