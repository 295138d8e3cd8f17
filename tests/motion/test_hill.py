"""Clohessy-Wiltshire motion: its closed-form special cases, a hop, rtn axes, and where it stops being valid."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.motion.hill import Hill, rtn_axes, two_impulse_hop, validity

N = math.sqrt(units.EARTH_GM_M3_S2 / 42164e3**3)
PERIOD = math.tau / N
TIMES = np.linspace(0.0, PERIOD, 101)


def hill(position, velocity):
    return Hill(relative_to="chief", position_m=position, velocity_m_s=velocity)


def test_hold_on_the_v_bar():
    position, velocity = hill((0.0, -500.0, 0.0), (0.0, 0.0, 0.0)).relative(TIMES, N)
    np.testing.assert_array_equal(position, np.broadcast_to([0.0, -500.0, 0.0], position.shape))
    np.testing.assert_array_equal(velocity, np.zeros_like(velocity))


def test_two_by_one_ellipse():
    # x0 = b, vy0 = -2 n b: x = b cos nt, y = -2 b sin nt
    b = 100.0
    position, velocity = hill((b, 0.0, 0.0), (0.0, -2 * N * b, 0.0)).relative(TIMES, N)
    c, s = np.cos(N * TIMES), np.sin(N * TIMES)
    # 6 (s - nt) x0 and 3 nt vy0 / n cancel: rounding of 12 pi b
    np.testing.assert_allclose(position, np.stack([b * c, -2 * b * s, 0 * c], axis=1), rtol=0, atol=1e-16 * 100 * b)
    np.testing.assert_allclose(
        velocity, np.stack([-b * N * s, -2 * b * N * c, 0 * c], axis=1), rtol=0, atol=1e-16 * 100 * b * N
    )


def test_radial_offset_drifts():
    # a body x0 higher, on its own circle, falls back 3/2 n x0 per second; its velocity here is the shear
    x0 = 50.0
    position, velocity = hill((x0, 0.0, 0.0), (0.0, -1.5 * N * x0, 0.0)).relative(TIMES, N)
    np.testing.assert_allclose(position[:, 0], x0, rtol=1e-14)
    np.testing.assert_allclose(position[:, 1], -1.5 * N * x0 * TIMES, rtol=0, atol=1e-15 * 100 * x0)
    np.testing.assert_allclose(velocity[:, 1], -1.5 * N * x0, rtol=1e-14)


def test_release_at_rest_drifts_six_pi_and_oscillates():
    # CW: y gains -12 pi x0 each revolution
    x0 = 10.0
    position, _ = hill((x0, 0.0, 0.0), (0.0, 0.0, 0.0)).relative(np.array([PERIOD, 2 * PERIOD]), N)
    np.testing.assert_allclose(position[:, 1], [-12 * math.pi * x0, -24 * math.pi * x0], rtol=1e-14)


def test_cross_track_is_a_pendulum():
    position, velocity = hill((0.0, 0.0, 30.0), (0.0, 0.0, 0.002)).relative(TIMES, N)
    np.testing.assert_allclose(
        position[:, 2], 30 * np.cos(N * TIMES) + 0.002 / N * np.sin(N * TIMES), rtol=0, atol=1e-13
    )
    np.testing.assert_allclose(
        velocity[:, 2], 0.002 * np.cos(N * TIMES) - 30 * N * np.sin(N * TIMES), rtol=0, atol=1e-17
    )


def test_velocity_is_the_slope_in_the_turning_axes():
    part, h = hill((300.0, -2000.0, 150.0), (0.02, -0.1, 0.03)), 1.0
    ahead, behind = part.relative(TIMES + h, N)[0], part.relative(TIMES - h, N)[0]
    # the cut-off of central differences: h^2 / 6 times the third derivative, at most n^3 times the path's size
    size = 2e4
    np.testing.assert_allclose((ahead - behind) / (2 * h), part.relative(TIMES, N)[1], rtol=0, atol=N**3 * size + 1e-11)


def test_it_satisfies_hills_equations():
    part, h = hill((300.0, -2000.0, 150.0), (0.02, -0.1, 0.03)), 1.0
    (x, _, z), (u, v, _) = (values.T for values in part.relative(TIMES, N))
    pull = (part.relative(TIMES + h, N)[1] - part.relative(TIMES - h, N)[1]) / (2 * h)
    expected = np.stack([3 * N**2 * x + 2 * N * v, -2 * N * u, -(N**2) * z], axis=1)
    np.testing.assert_allclose(pull, expected, rtol=0, atol=N**4 * 2e4 + 1e-15)


def test_hop_arrives():
    aim = np.array([0.0, -300.0, 20.0])
    velocity = two_impulse_hop((0.0, -3000.0, 0.0), aim, 2700.0, N)
    position, _ = hill((0.0, -3000.0, 0.0), tuple(velocity.tolist())).relative(np.array([2700.0]), N)
    np.testing.assert_allclose(position[0], aim, rtol=0, atol=1e-9)


def test_hop_along_the_v_bar_has_a_closed_form():
    # Solve x(t) = 0: u = -2 (1 - c) v / s, in y(t) - y0 = [(4 s - 3 nt) v - 2 (1 - c) u] / n
    duration = 2700.0
    s, c, nt = math.sin(N * duration), math.cos(N * duration), N * duration
    along = 2700.0 * N / (4 * s - 3 * nt + 4 * (1 - c) ** 2 / s)
    velocity = two_impulse_hop((0.0, -3000.0, 0.0), (0.0, -300.0, 0.0), duration, N)
    np.testing.assert_allclose(velocity, [-2 * (1 - c) / s * along, along, 0.0], rtol=1e-10, atol=1e-15)


@pytest.mark.parametrize("duration", [0.0, PERIOD, 0.5 * PERIOD])
def test_hop_without_an_answer(duration):
    with pytest.raises(ScenarioError, match="change the duration"):
        two_impulse_hop((0.0, -3000.0, 0.0), (0.0, -300.0, 10.0), duration, N)


def test_rtn_axes_of_a_known_state():
    rotation, rate = rtn_axes(np.array([0.0, 7e6, 0.0]), np.array([0.0, 100.0, 7500.0]))
    # x radially out = +y; z along r x v = +x; y = z x x = +z
    np.testing.assert_allclose(rotation.as_matrix(), [[0, 0, 1], [1, 0, 0], [0, 1, 0]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(rate, [0, 0, 7500.0 / 7e6], rtol=1e-15)


def test_rtn_rate_is_the_turn_of_the_axes():
    from rso_lidar.motion.kepler import propagate

    r0, v0 = np.array([7e6, 1e6, -2e6]), np.array([-1000.0, 6000.0, 5500.0])
    times, h = np.linspace(0.0, 9000.0, 50), 0.05
    rotation, rate = rtn_axes(*propagate(r0, v0, times))
    ahead, behind = rtn_axes(*propagate(r0, v0, times + h))[0], rtn_axes(*propagate(r0, v0, times - h))[0]
    turned = (behind.inv() * ahead).as_rotvec() / (2 * h)
    # rounding of a rotation vector over 2 h = 0.1 s, and h^2 / 6 times the rate's second derivative (about n^3)
    np.testing.assert_allclose(turned, rate, rtol=0, atol=1e-14 + h**2 * 0.0015**3)
    assert isinstance(rotation, Rotation)
    np.testing.assert_array_equal(
        rotation[3].as_quat(), rtn_axes(*(a[0] for a in propagate(r0, v0, times[3:4])))[0].as_quat()
    )


def test_validity():
    near, far = np.array([[0.0, -9000.0, 0.0]]), np.array([[0.0, -9000.0, 0.0], [0.0, -12345.0, 0.0]])
    assert validity(near, 0.001) == []
    (only,) = validity(far, 0.001)
    assert "12.3 km" in only
    (only,) = validity(near, 0.02)
    assert "0.0200" in only
    assert len(validity(far, 0.02)) == 2
