"""States with covariances: what is refused, factors, and the plane of an encounter."""

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import UncertainSeparation, UncertainState, check_radius

PLACE, SPEED = np.array([7e6, 0.0, 0.0]), np.array([0.0, 7.5e3, 0.0])


def make_covariance(seed):
    """Return a covariance of position and velocity with correlations: metres and millimetres per second."""
    root = np.random.default_rng(seed).normal(size=(6, 6)) * np.array([50.0, 50.0, 50.0, 0.05, 0.05, 0.05])[:, None]
    return root @ root.T


def test_the_factor_times_its_transpose_is_the_covariance():
    state = UncertainState(PLACE, SPEED, make_covariance(3))
    assert state.factor() @ state.factor().T == pytest.approx(make_covariance(3), rel=1e-9, abs=1e-12)


def test_a_covariance_of_position_alone_leaves_the_velocity_exact():
    state = UncertainState(PLACE, SPEED, np.diag([1.0, 4.0, 9.0]))
    assert state.covariance.shape == (6, 6)
    assert not state.covariance[3:].any()
    drawn = np.random.default_rng(1).normal(size=(4000, 6)) @ state.factor().T
    assert drawn.std(axis=0) == pytest.approx([1.0, 2.0, 3.0, 0.0, 0.0, 0.0], rel=0.05)


@pytest.mark.parametrize(
    ("covariance", "said"),
    [
        (np.diag([1.0, -1.0, 1.0]), "is not positive semidefinite: a variance is below 0"),
        ([[1.0, 0.5, 0.0], [0.1, 1.0, 0.0], [0.0, 0.0, 1.0]], "is not symmetric"),
        ([[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]], "is not positive semidefinite"),
        ([[0.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]], "is not"),
        (np.full((3, 3), np.nan), "needs finite numbers of shape"),
        (np.eye(4), r"needs finite numbers of shape \(3, 3\) or \(6, 6\)"),
        ("large", "needs finite numbers"),
    ],
)
def test_what_no_distribution_has_is_refused(covariance, said):
    with pytest.raises(ScenarioError, match=f"^covariance: {said}"):
        UncertainState(PLACE, SPEED, covariance)


def test_the_plane_is_normal_to_the_relative_velocity_and_keeps_the_miss_and_the_trace():
    first = UncertainState(PLACE, SPEED, make_covariance(1))
    second = UncertainState(
        PLACE + np.array([30.0, 400.0, -20.0]), SPEED + np.array([10.0, 3.0, 200.0]), make_covariance(2)
    )
    between = UncertainSeparation.between(first, second)
    miss, covariance = between.encounter_plane()
    along = between.velocity_m_s / between.speed_m_s
    closest = between.position_m - (between.position_m @ along) * along
    assert np.linalg.norm(miss) == pytest.approx(np.linalg.norm(closest), rel=1e-12)
    both = first.covariance[:3, :3] + second.covariance[:3, :3]
    assert np.trace(covariance) == pytest.approx(np.trace(both) - along @ both @ along, rel=1e-12)
    assert between.closest_s == pytest.approx(-(between.position_m @ along) / between.speed_m_s)


def test_without_relative_velocity_there_is_no_plane():
    one = UncertainState(PLACE, SPEED, np.eye(3))
    between = UncertainSeparation.between(one, UncertainState(PLACE + np.array([1.0, 0.0, 0.0]), SPEED, np.eye(3)))
    assert np.isnan(between.closest_s)
    with pytest.raises(ScenarioError, match=r"^encounter: has no relative velocity"):
        between.encounter_plane()


@pytest.mark.parametrize("radius", [0.0, -1.0, float("nan"), 2e5, "ten", [1.0, 2.0], None])
def test_a_radius_without_meaning_is_refused(radius):
    with pytest.raises(ScenarioError, match=r"^radius_m: "):
        check_radius(radius)
