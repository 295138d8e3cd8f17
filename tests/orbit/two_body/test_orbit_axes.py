"""The rate of rtn axes against their difference from instant to instant."""

import numpy as np

from rso_lidar.orbit import rtn_axes, rtn_matrix

PLACE_M, VELOCITY_M_S = np.array([5.1e6, -3.9e6, 2.6e6]), np.array([4100.0, 5200.0, -3300.0])


def test_rtn_axes_turn_as_they_do_from_instant_to_instant_about_each_of_the_three():
    """The velocity of a model need not be the rate of its position, so the plane turns about the along-track axis too."""
    rates = VELOCITY_M_S + np.array([120.0, -80.0, 240.0]), np.array([-6.0, 3.5, 8.0])
    _, turning = rtn_matrix(PLACE_M, VELOCITY_M_S, rates)
    step_s = 0.1
    before, now, after = (
        rtn_matrix(PLACE_M + sign * step_s * rates[0], VELOCITY_M_S + sign * step_s * rates[1])[0]
        for sign in (-1, 0, 1)
    )
    skew = now.T @ (after - before) / (2.0 * step_s)
    expected = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    assert np.abs(expected).min() > 1e-5
    np.testing.assert_allclose(turning, expected, rtol=1e-6)


def test_a_fixed_plane_turns_by_the_momentum_over_the_squared_radius():
    rotation, turning = rtn_axes(PLACE_M, VELOCITY_M_S)
    momentum = np.cross(PLACE_M, VELOCITY_M_S)
    np.testing.assert_allclose(turning, [0.0, 0.0, np.linalg.norm(momentum) / (PLACE_M @ PLACE_M)], rtol=1e-12)
    np.testing.assert_allclose(rotation.apply([0.0, 0.0, 2.0]), 2.0 * momentum / np.linalg.norm(momentum), rtol=1e-12)
