"""The choice between a probability in a plane and one in three dimensions, and the greatest over sizes of the covariance."""

import math

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import UncertainState, estimate_collision, foster_probability
from tests.orbit.collision.test_monte_carlo import make_pair


def scale(state, factor):
    return UncertainState(state.position_m, state.velocity_m_s, factor**2 * state.covariance)


def test_a_fast_encounter_is_taken_from_the_plane():
    pair = make_pair()
    estimate = estimate_collision(*pair, 10.0)
    assert estimate.method == "Foster" and not estimate.differs
    assert estimate.probability == foster_probability(*pair, 10.0)
    assert estimate.duration_share < 0.02 and estimate.farthest_share < 0.01


def test_a_slow_encounter_is_taken_from_three_dimensions():
    estimate = estimate_collision(*make_pair(miss_m=(40.0, 30.0, 5.0), angle_deg=0.01), 30.0, window_s=400.0)
    assert estimate.method == "3-D" and "of a revolution" in estimate.reason
    assert estimate.probability == estimate.integral.probability


def test_both_objects_may_be_swapped():
    first, second = make_pair(sigma_m=30.0)
    there, back = estimate_collision(first, second, 10.0), estimate_collision(second, first, 10.0)
    assert back.probability == pytest.approx(there.probability, rel=1e-9)
    assert back.mahalanobis == pytest.approx(there.mahalanobis, rel=1e-9)


def test_small_radii_and_great_errors_have_a_probability_by_area():
    """Far smaller than the errors, a disc holds its area times the density; that falls as one over their square."""
    first, second = make_pair(sigma_m=300.0)
    small, half = (estimate_collision(first, second, radius_m).probability for radius_m in (0.02, 0.01))
    assert small == pytest.approx(4.0 * half, rel=1e-4)
    near, far = (foster_probability(scale(first, factor), scale(second, factor), 10.0) for factor in (1e3, 2e3))
    assert near == pytest.approx(4.0 * far, rel=1e-4)


def test_the_greatest_probability_is_that_of_alfanos_closed_form():
    """Of a small disc: sigma = miss / sqrt(2) where the density is round (Alfano 2005), so r^2 / (e miss^2)."""
    first, second = make_pair(miss_m=(0.0, 0.0, 0.0), sigma_m=1000.0)
    moved = UncertainState(np.add(second.position_m, [60.0, 0.0, 0.0]), second.velocity_m_s, second.covariance)
    flat = np.diag([1e6] * 3 + [0.0] * 3)
    pair = [UncertainState(state.position_m, state.velocity_m_s, flat) for state in (first, moved)]
    estimate = estimate_collision(*pair, 0.1)
    assert estimate.greatest == pytest.approx(0.1**2 / (math.e * 60.0**2), rel=1e-3)
    assert estimate.greatest_scale == pytest.approx(60.0 / math.sqrt(2.0) / (1000.0 * math.sqrt(2.0)), rel=1e-2)
    assert estimate.mahalanobis == pytest.approx(60.0 / (1000.0 * math.sqrt(2.0)), rel=1e-6)
    assert estimate.is_diluted


def test_without_relative_velocity_there_is_no_plane():
    first, _ = make_pair()
    beside = UncertainState(np.add(first.position_m, [5.0, 0.0, 0.0]), first.velocity_m_s, first.covariance)
    estimate = estimate_collision(first, beside, 10.0)
    assert (estimate.foster, estimate.method) == (None, "3-D") and math.isnan(estimate.mahalanobis)


def test_a_radius_without_meaning():
    with pytest.raises(ScenarioError, match="radius_m"):
        estimate_collision(*make_pair(), -1.0)
