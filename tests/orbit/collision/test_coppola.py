"""The integral over time and sphere: Foster's where the encounter is fast, closed forms, and what it refuses."""

import math

import numpy as np
import pytest
from scipy.stats import ncx2

from rso_lidar import units
from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.orbit import (
    KnownTooWellError,
    UncertainState,
    foster_probability,
    integrate_collisions,
    sample_collisions,
)
from rso_lidar.orbit.collision.coppola import _probability_inside
from tests.orbit.collision.test_monte_carlo import RADIUS, SPEED, make_pair


@pytest.mark.parametrize("sigma_m", [3.0, 20.0, 300.0])
@pytest.mark.parametrize("radius_m", [1.0, 12.0])
def test_a_fast_encounter_is_fosters(sigma_m, radius_m):
    """Also where the position is known to a quarter of the radius."""
    first, second = make_pair(sigma_m=sigma_m)
    found = integrate_collisions(first, second, radius_m)
    assert found.probability == pytest.approx(foster_probability(first, second, radius_m), rel=2e-3)
    assert found.inside < 1e-9 * found.entries
    assert found.window_s < 10.0


@pytest.mark.parametrize("off_m", [(10.0, 0.0, 0.0), (0.0, 10.0, 0.0), (0.0, 0.0, 10.0)])
def test_means_at_rest_to_each_other_have_a_probability(off_m):
    """Of which most is that of the position at first: the part of a normal distribution in a sphere."""
    first, second = make_pair(miss_m=off_m, angle_deg=0.0, sigma_m=10.0)
    found = integrate_collisions(first, second, 15.0, window_s=1.0)
    drawn = np.random.default_rng(5).multivariate_normal(off_m, np.diag([200.0, 800.0, 200.0]), size=400_000)
    assert found.probability == pytest.approx(np.mean(np.linalg.norm(drawn, axis=1) < 15.0), rel=0.03)


def test_a_slow_encounter_is_that_of_monte_carlo():
    """Side by side for a twelfth of a revolution, one is overtaken by the other."""
    first, second = make_pair(miss_m=(40.0, 30.0, 5.0), angle_deg=0.01)
    found = integrate_collisions(first, second, 30.0, window_s=400.0)
    drawn = sample_collisions(first, second, 30.0, rng=np.random.default_rng(4), samples=40_000, window_s=400.0)
    assert abs(found.probability - drawn.probability) < 4.0 * drawn.standard_error + 2e-3 * found.probability


@pytest.mark.parametrize("miss_m", [0.0, 9.0, 30.0])
@pytest.mark.parametrize("sigma_m", [0.5, 5.0, 50.0])
def test_what_is_inside_follows_a_chi_squared_law(miss_m, sigma_m):
    mean, covariance = np.array([0.6, 0.8, 0.0, 0.0, 0.0, 0.0]) * miss_m, np.eye(6) * sigma_m**2
    expected = ncx2.cdf((10.0 / sigma_m) ** 2, 3, max((miss_m / sigma_m) ** 2, 1e-12))
    assert _probability_inside(mean, covariance, 10.0) == pytest.approx(expected, rel=1e-3, abs=1e-12)


def test_objects_that_stay_together_are_inside_from_the_start():
    state = [RADIUS, 0.0, 0.0], [0.0, SPEED, 0.0]
    covariance = np.diag([4.0] * 3 + [1e-10] * 3)
    found = integrate_collisions(UncertainState(*state, covariance), UncertainState(*state, covariance), 100.0)
    assert found.inside == pytest.approx(1.0, abs=1e-3)  # half a revolution spreads them by some 30 m
    assert found.inside < found.probability <= 1.0  # whoever drifts out may come in again
    assert found.window_s == pytest.approx(math.pi * math.sqrt(RADIUS**3 / units.EARTH_GM_M3_S2), rel=1e-9)


@pytest.mark.parametrize("covariance", [np.zeros((6, 6)), np.diag([1e-6, 1e-6, 1e4, 0.0, 0.0, 0.0])])
def test_positions_that_are_known_too_well_are_refused(covariance):
    first, second = (UncertainState(s.position_m, s.velocity_m_s, covariance) for s in make_pair())
    with pytest.raises(KnownTooWellError, match=r"covariance: the relative position .* use Foster"):
        integrate_collisions(first, second, 10.0)


@pytest.mark.parametrize("window_s", [0.0, -1.0, math.nan, 1e9])
def test_windows_without_meaning(window_s):
    with pytest.raises(ScenarioError, match="window_s: "):
        integrate_collisions(*make_pair(), 10.0, window_s=window_s)


def test_a_state_that_leaves_the_earth():
    first, second = make_pair()
    away = UncertainState(second.position_m, 2.0 * second.velocity_m_s, second.covariance)
    with pytest.raises(PropagationError, match="not on an ellipse"):
        integrate_collisions(first, away, 10.0)
