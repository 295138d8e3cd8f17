"""Prediction of two bodies: against the orbit room, by differences, and the covariance of white accelerations."""

import datetime

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.orbit import J2, Epochs, State
from rso_lidar.track.navigation.two_orbits import accelerate, find_gradient, predict_orbits

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
POSITION, VELOCITY = np.array([5e6, -3e6, 4e6]), np.array([4.1e3, 6.1e3, -0.5e3])
NEAR = np.array([-300.0, 1000.0, 200.0, 0.5, -1.0, 0.2])
QUIET = {"own_m_s2_sqrt_hz": 0.0, "target_m_s2_sqrt_hz": 0.0}


def test_two_bodies_without_j2_fly_as_the_orbit_room_says():
    state = np.concatenate([POSITION, VELOCITY, NEAR])
    predicted, *_ = predict_orbits(state, 600.0, oblate=False, **QUIET)
    there = []
    for position, velocity in ((POSITION, VELOCITY), (POSITION + NEAR[:3], VELOCITY + NEAR[3:])):
        part = State(epoch_utc=START, position_m=tuple(position), velocity_m_s=tuple(velocity))
        flown = part.states(Epochs(START, np.array([600.0])))
        there.append(np.concatenate([flown.position_m[0], flown.velocity_m_s[0]]))
    np.testing.assert_allclose(predicted[:6], there[0], atol=1e-4)
    np.testing.assert_allclose(predicted[6:], there[1] - there[0], atol=1e-7)


def test_j2_is_the_gradient_of_its_potential():
    def potential(position):
        r = np.linalg.norm(position)
        legendre = 0.5 * (3.0 * (position[2] / r) ** 2 - 1.0)
        return units.EARTH_GM_M3_S2 / r * (1.0 - units.EARTH_J2 * (units.EARTH_ZONAL_RADIUS_M / r) ** 2 * legendre)

    steps = 10.0 * np.eye(3)
    found = [(potential(POSITION + step) - potential(POSITION - step)) / 20.0 for step in steps]
    np.testing.assert_allclose(accelerate(POSITION, oblate=True), found, rtol=1e-7)
    columns = [
        (accelerate(POSITION + step, oblate=False) - accelerate(POSITION - step, oblate=False)) / 20.0 for step in steps
    ]
    np.testing.assert_allclose(find_gradient(POSITION), np.array(columns).T, atol=1e-12)
    assert J2.__doc__  # the orbit room has mean elements with J2 only, so the potential is the check


@pytest.mark.parametrize("has_gravity", [True, False])
def test_the_transition_is_the_derivative_of_the_prediction(has_gravity):
    state = np.concatenate([POSITION, VELOCITY, NEAR])
    _, transition, _ = predict_orbits(state, 25.0, oblate=False, has_gravity=has_gravity, **QUIET)
    for k, step in enumerate(np.repeat([1.0, 1e-3, 1.0, 1e-3], 3)):
        moved = [
            predict_orbits(state + sign * step * np.eye(12)[k], 25.0, oblate=False, has_gravity=has_gravity, **QUIET)[0]
            for sign in (1.0, -1.0)
        ]
        np.testing.assert_allclose(transition[:, k], (moved[0] - moved[1]) / (2.0 * step), rtol=2e-5, atol=2e-6)


def test_the_gravity_on_a_target_far_off_is_that_of_its_own_place():
    """At 60 km the gradients differ by a fortieth: a shift of the follower alone changes the relative velocity."""
    relative = np.concatenate([[40e3, -30e3, 35e3], NEAR[3:]])
    state = np.concatenate([POSITION, VELOCITY, relative])
    _, transition, _ = predict_orbits(state, 25.0, oblate=False, **QUIET)
    shift = 10.0 * np.eye(12)
    moved = [[predict_orbits(state + s * shift[k], 25.0, oblate=False, **QUIET)[0] for k in range(3)] for s in (1, -1)]
    derivative = (np.array(moved[0]) - np.array(moved[1])).T / 20.0
    np.testing.assert_allclose(transition[9:, :3], derivative[9:], rtol=1e-2, atol=1e-9)
    assert np.abs(derivative[9:]).max() > 3e-7


def test_white_accelerations_add_what_they_integrate_to():
    """The follower's own acceleration moves it, and the target relative to it by as much the other way."""
    _, _, noise = predict_orbits(
        np.zeros(12), 4.0, own_m_s2_sqrt_hz=0.1, target_m_s2_sqrt_hz=0.2, has_gravity=False, oblate=False
    )
    assert noise[0, 0] == pytest.approx(0.01 * 4.0**3 / 3.0)
    assert noise[0, 3] == noise[3, 0] == pytest.approx(0.01 * 4.0**2 / 2.0)
    assert noise[3, 3] == pytest.approx(0.01 * 4.0)
    assert noise[9, 9] == pytest.approx((0.01 + 0.04) * 4.0)
    assert noise[3, 9] == pytest.approx(-0.01 * 4.0)
    long = predict_orbits(np.zeros(12), 25.0, own_m_s2_sqrt_hz=0.1, target_m_s2_sqrt_hz=0.2, has_gravity=False)[2]
    assert long[6, 6] == pytest.approx(0.05 * 25.0**3 / 3.0)  # three steps
