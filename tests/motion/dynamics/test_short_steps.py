"""Short steps: as exact as the integrator behind them, whatever is asked for in which order."""

import numpy as np
import pytest

from rso_lidar.errors import PropagationError
from rso_lidar.motion.dynamics import short_steps
from rso_lidar.motion.dynamics.short_steps import FIRST_STEP_S, ShortSolution
from rso_lidar.orbit import OdeSolution
from tests.reference.motion import short_steps as reference

TOLERANCES = {"rtol": 1e-10, "atol": 1e-9}


def oscillator(rate_rad_s):
    return lambda t, x, u=None: np.array([x[1], -(rate_rad_s**2) * x[0]])


def make_short(f, x0, begin_s=0.0):
    return ShortSolution(f, begin_s, np.array(x0), np.zeros(0), panel_s=1.0, name="f", **TOLERANCES)


@pytest.mark.parametrize("rate_rad_s", [1e-3, 0.5, 20.0, 2000.0])
def test_an_oscillator_is_followed_within_the_tolerance(rate_rad_s):
    """In closed form x = cos(w t). At 2000 rad/s the first step is too long, and the other integrator takes over."""
    solution = make_short(oscillator(rate_rad_s), [1.0, 0.0])
    times = np.array([0.0, 0.001, 0.02, 0.0313, 0.5, 3.0])
    found = solution(times)
    np.testing.assert_allclose(found[:, 0], np.cos(rate_rad_s * times), atol=1e-6 if rate_rad_s > 100 else 3e-8)
    if rate_rad_s in (1e-3, 2000.0):
        assert (solution._rest is not None) == (rate_rad_s == 2000.0)


def test_the_bits_do_not_depend_on_what_else_is_requested():
    times = np.linspace(0.0, 2.0, 41)

    def make():
        return make_short(oscillator(0.3), [1.0, 0.2])

    together, backward = make()(times), make()
    apart = np.concatenate([backward(np.array([one])) for one in times[::-1]])[::-1]
    np.testing.assert_array_equal(together, apart)


def test_dynamics_that_fail_are_told_as_by_the_other_integrator():
    def failing(t, x, u=None):
        if t > 2.5 * FIRST_STEP_S:
            raise PropagationError("beyond", np.array([True]))
        return np.array([1.0])

    solution = make_short(failing, [0.0])
    assert solution(np.array([1.9 * FIRST_STEP_S]))[0, 0] == pytest.approx(1.9 * FIRST_STEP_S, abs=1e-15)
    for one in (solution, OdeSolution(failing, np.zeros(1), panel_s=1.0, name="f", **TOLERANCES)):
        with pytest.raises(PropagationError, match="beyond"):
            one(np.array([3.0 * FIRST_STEP_S]))


def test_time_and_inputs_reach_the_dynamics():
    """x' = t u from t = 3 s on: x = u ((3 s + s)^2 - 3^2) / 2 after a span s."""
    solution = ShortSolution(
        lambda t, x, u: t * u, 3.0, np.zeros(1), np.array([2.0]), panel_s=1.0, name="f", **TOLERANCES
    )
    span = np.array([0.01, 0.4, 2.5])
    np.testing.assert_allclose(solution(span)[:, 0], (3.0 + span) ** 2 - 9.0, rtol=1e-12)


def test_the_sums_over_stages_are_those_of_numpy():
    """`find_slopes` returns the sum of squares over the entries, and writes the weights of s, s2, s3, s4 for each entry."""
    rng = np.random.default_rng(5)
    x, rates = rng.normal(size=13), rng.normal(size=(7, 13))
    stages, _, errors, dense = short_steps._tableau()
    for weights in stages:
        expected = reference.extrapolate(x, rates, weights, 0.02)
        np.testing.assert_allclose(short_steps.extrapolate(x, rates, weights, 0.02), expected, rtol=1e-13, atol=1e-15)
    end, slopes, expected_slopes = rng.normal(size=13), np.empty((13, 4)), np.empty((13, 4))
    limits = (0.02, 1e-3, 1e-2)
    squared = short_steps.find_slopes(x, end, rates, errors, dense, limits, slopes)
    expected = reference.find_slopes(x, end, rates, errors, dense, limits, expected_slopes)
    np.testing.assert_allclose(squared, expected, rtol=1e-11)
    np.testing.assert_allclose(slopes, expected_slopes, rtol=1e-11, atol=1e-13)
