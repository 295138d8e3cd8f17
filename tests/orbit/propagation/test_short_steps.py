"""Short steps: as exact as the integrator behind them, whatever is asked for in which order."""

import numpy as np
import pytest

from rso_lidar.errors import PropagationError
from rso_lidar.orbit.propagation.integrator import OdeSolution
from rso_lidar.orbit.propagation.short_steps import FIRST_STEP_S, ShortSolution

TOLERANCES = {"rtol": 1e-10, "atol": 1e-9}


def oscillator(rate_rad_s):
    return lambda t, x: np.array([x[1], -(rate_rad_s**2) * x[0]])


@pytest.mark.parametrize("rate_rad_s", [1e-3, 0.5, 20.0, 2000.0])
def test_an_oscillator_is_followed_within_the_tolerance(rate_rad_s):
    """In closed form x = cos(w t). At 2000 rad/s the first step is too long, and the other integrator takes over."""
    solution = ShortSolution(oscillator(rate_rad_s), np.array([1.0, 0.0]), panel_s=1.0, name="oscillator", **TOLERANCES)
    times = np.array([0.0, 0.001, 0.02, 0.0313, 0.5, 3.0])
    found = solution(times)
    np.testing.assert_allclose(found[:, 0], np.cos(rate_rad_s * times), atol=1e-6 if rate_rad_s > 100 else 3e-8)
    if rate_rad_s in (1e-3, 2000.0):
        assert (solution._rest is not None) == (rate_rad_s == 2000.0)


def test_the_bits_do_not_depend_on_what_else_is_requested():
    times = np.linspace(0.0, 2.0, 41)

    def make():
        return ShortSolution(oscillator(0.3), np.array([1.0, 0.2]), panel_s=1.0, name="oscillator", **TOLERANCES)

    together, backward = make()(times), make()
    apart = np.concatenate([backward(np.array([one])) for one in times[::-1]])[::-1]
    np.testing.assert_array_equal(together, apart)


def test_dynamics_that_fail_are_told_as_by_the_other_integrator():
    def failing(t, x):
        if t > 2.5 * FIRST_STEP_S:
            raise PropagationError("beyond", np.array([True]))
        return np.array([1.0])

    made = {"panel_s": 1.0, "name": "f", **TOLERANCES}
    solution = ShortSolution(failing, np.zeros(1), **made)
    assert solution(np.array([1.9 * FIRST_STEP_S]))[0, 0] == pytest.approx(1.9 * FIRST_STEP_S, abs=1e-15)
    for one in (solution, OdeSolution(failing, np.zeros(1), **made)):
        with pytest.raises(PropagationError, match="beyond"):
            one(np.array([3.0 * FIRST_STEP_S]))
