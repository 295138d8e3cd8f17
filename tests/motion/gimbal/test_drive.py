import math

import numpy as np
import pytest
from scipy.linalg import expm

from rso_lidar.errors import ScenarioError
from rso_lidar.kernels import packed
from rso_lidar.motion import FirstOrder, Ideal, SecondOrder, StateSpaceDrive
from rso_lidar.motion.gimbal.drive import TICK_S, advance_first_order, advance_second_order, second_order_transition
from rso_lidar.units import DEG
from tests.reference.motion.gimbal import drive as reference


def advance(response, dt, axes, held):
    """Return (angle, rate) of pan and of tilt after each row of `held` (tick, 2) [rad] was asked for `dt` [s]."""
    return response.advance(0.0, dt, axes, (), held)[0]


def answer(response, pan_rad, ticks, start=((0.0, 0.0), (0.0, 0.0))):
    """Return angle and rate (tick, 2) of pan, tick by tick, to a step or a sequence of demands."""
    asked = np.broadcast_to(pan_rad, ticks)
    state, course = start, []
    for pan in asked:
        state = advance(response, TICK_S, state, np.array([[pan, 0.0]]))
        course.append(state[0])
    return np.array(course)


def second_order_step(natural_hz, damping, time):
    """Return the unit step response of a second-order system (Ogata, Modern Control Engineering, 5th ed. section 5-3)."""
    w = 2 * math.pi * natural_hz
    if damping < 1:
        wd, phase = w * math.sqrt(1 - damping**2), math.acos(damping)
        return 1 - np.exp(-damping * w * time) / math.sqrt(1 - damping**2) * np.sin(wd * time + phase)
    if damping == 1:
        return 1 - np.exp(-w * time) * (1 + w * time)
    root = math.sqrt(damping**2 - 1)
    s1, s2 = (damping + root) * w, (damping - root) * w
    return 1 + w / (2 * root) * (np.exp(-s1 * time) / s1 - np.exp(-s2 * time) / s2)


@pytest.mark.parametrize("damping", [0.0, 0.2, 0.7, 1.0, 1.5, 8.0])
@pytest.mark.parametrize("natural_hz", [0.5, 4.0, 300.0])
def test_second_order_step_is_the_closed_form_at_every_tick(natural_hz, damping):
    course = answer(SecondOrder(natural_hz=natural_hz, damping=damping), 0.3, 1500)
    time = np.arange(1, 1501) * TICK_S
    np.testing.assert_allclose(course[:, 0], 0.3 * second_order_step(natural_hz, damping, time), atol=1e-9)


@pytest.mark.parametrize("damping", [0.1, 0.5, 0.7])
def test_second_order_overshoots_as_its_damping_says(damping):
    course = answer(SecondOrder(natural_hz=2.0, damping=damping), 1.0, 2000)
    overshoot = math.exp(-math.pi * damping / math.sqrt(1 - damping**2))
    # the peak is met within half a tick: (w dt / 2)^2 / 2 = 2e-5 of the overshoot
    assert course[:, 0].max() - 1.0 == pytest.approx(overshoot, rel=1e-4)


@pytest.mark.parametrize("damping", [0.3, 1.0, 1.0 + 1e-12, 3.0])
def test_second_order_is_the_matrix_exponential(damping):
    w = 2 * math.pi * 5.0
    phi = expm(np.array([[0, 1], [-w * w, -2 * damping * w]]) * 0.7e-3)
    start = ((0.4, -0.2), (0.1, 0.5))
    (pan, tilt) = advance(SecondOrder(natural_hz=5.0, damping=damping), 0.7e-3, start, np.array([[0.25, -0.1]]))
    np.testing.assert_allclose(pan, phi @ [0.15, -0.2] + [0.25, 0], rtol=1e-12)
    np.testing.assert_allclose(tilt, phi @ [0.2, 0.5] + [-0.1, 0], rtol=1e-12)


def test_first_order_step_is_the_closed_form_at_every_tick():
    course = answer(FirstOrder(time_constant_s=0.25), -0.3, 1500)
    time = np.arange(1, 1501) * TICK_S
    np.testing.assert_allclose(course[:, 0], -0.3 * (1 - np.exp(-time / 0.25)), atol=1e-13)
    np.testing.assert_allclose(course[:, 1], -0.3 / 0.25 * np.exp(-time / 0.25), atol=1e-12)


@pytest.mark.parametrize("response", [FirstOrder(time_constant_s=0.05), SecondOrder(natural_hz=4, damping=0.7)])
def test_limits_bite(response):
    limited = response.replace(max_rate_deg_s=30.0, max_acceleration_deg_s2=100.0)
    course = answer(limited, 60 * DEG, 4000) / DEG
    time = np.arange(1, 4001) * TICK_S
    assert np.abs(course[:, 1]).max() <= 30.0 * (1 + 1e-12)
    # the rates of one tick and the next differ by the greatest acceleration at most, from rest at the very start
    assert np.abs(np.diff(course[:, 1], prepend=0.0)).max() <= 100.0 * TICK_S * (1 + 1e-9)
    ramp = time < 0.3
    np.testing.assert_allclose(course[ramp, 1], 100.0 * time[ramp], rtol=1e-9)
    cruise = (time > 0.31) & (time < 1.5)
    np.testing.assert_allclose(np.diff(course[cruise, 0]) / TICK_S, 30.0, rtol=1e-9)
    assert course[-1, 0] == pytest.approx(60.0, abs=0.1)  # and it arrives


@pytest.mark.parametrize(
    ("response", "lag"), [(FirstOrder(time_constant_s=0.05), 0.5), (SecondOrder(natural_hz=4, damping=0.7), 0.0)]
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_angle_on_a_ramp_is_the_sum_of_its_rates(response, lag, sign):
    """a t²/2 while it speeds up, by the mean rate of each tick; a first-order drive goes by the new rate, a t dt/2 more.

    Then the greatest rate times the time: both from rest, with start and demand on either side of zero.
    """
    limited = response.replace(max_rate_deg_s=30.0, max_acceleration_deg_s2=100.0)
    start = ((sign * 5.0 * DEG, 0.0), (0.0, 0.0))
    course = sign * answer(limited, sign * 95.0 * DEG, 2000, start)[:, 0] / DEG - 5.0
    time = np.arange(1, 2001) * TICK_S
    speeding = time < 0.3 - 1e-9
    ramp = 0.5 * 100.0 * time**2 + lag * 100.0 * time * TICK_S
    np.testing.assert_allclose(course[speeding], ramp[speeding], rtol=1e-9)
    cruise = (time > 0.3 + 1e-9) & (time < 1.5)
    at_full_rate = 0.5 * 30.0 * 0.3 + lag * 30.0 * TICK_S + 30.0 * (time - 0.3)
    np.testing.assert_allclose(course[cruise], at_full_rate[cruise], rtol=1e-9)


@pytest.mark.parametrize("response", [FirstOrder(time_constant_s=0.05), SecondOrder(natural_hz=4, damping=0.7)])
def test_wide_limits_change_no_bit(response):
    wide = response.replace(max_rate_deg_s=1e9, max_acceleration_deg_s2=1e12, pan_limits_deg=(-1e5, 1e5))
    assert np.array_equal(answer(wide, 0.3, 500), answer(response, 0.3, 500))


def test_a_drive_that_swings_past_the_end_of_its_travel_stops_there():
    response = SecondOrder(natural_hz=2.0, damping=0.2, pan_limits_deg=(-10, 10))
    course = answer(response, 10 * DEG, 1000) / DEG  # would overshoot by half
    assert course[:, 0].max() == pytest.approx(10.0, abs=1e-12)
    stopped = course[np.argmax(course[:, 0] >= 10.0 * (1 - 1e-12)) :]
    assert np.abs(stopped).max() <= 10.0 + 1e-12
    assert stopped[0, 1] == 0.0


def test_many_ticks_at_once_are_the_same_bits_as_one_by_one():
    rng = np.random.default_rng(1)
    asked = rng.normal(size=(400, 2))
    response = SecondOrder(natural_hz=3, damping=0.5, max_rate_deg_s=40, max_acceleration_deg_s2=900)
    state = ((0.0, 0.0), (0.0, 0.0))
    for row in asked:
        state = advance(response, TICK_S, state, row[None])
    assert state == advance(response, TICK_S, ((0.0, 0.0), (0.0, 0.0)), asked)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Ideal(pan_limits_deg=(10, -10)),
        lambda: FirstOrder(time_constant_s=0.0),
        lambda: SecondOrder(natural_hz=4, damping=-0.1),
        lambda: SecondOrder(natural_hz=4, damping=1, max_rate_deg_s=0),
        lambda: Ideal(max_rate_deg_s=3),
    ],
)
def test_impossible_drives_are_refused(make):
    with pytest.raises(ScenarioError):
        make()


@pytest.mark.parametrize("response", [FirstOrder(time_constant_s=0.05), SecondOrder(natural_hz=3.0, damping=0.4)])
def test_kernels_answer_as_the_reference_does(response):
    """Limits and ends of travel are met on the way; the kernel as plain Python gives the very same bits."""
    limited = response.replace(max_rate_deg_s=20.0, max_acceleration_deg_s2=90.0, pan_limits_deg=(-8.0, 11.0))
    held = np.random.default_rng(5).normal(0.0, 0.3, (4000, 2)).cumsum(axis=0) * 0.01
    axes = ((0.01, 0.2), (-0.02, 0.0))
    made = advance(limited, 1e-3, axes, held)
    np.testing.assert_allclose(made, reference.advance(limited, 1e-3, axes, held), rtol=1e-11, atol=1e-14)
    assert made != axes


def test_kernels_give_the_bits_of_plain_python():
    held = np.random.default_rng(6).normal(0.0, 0.1, 3000).cumsum() * 0.01
    limits, travel, axis = (20 * DEG, 90 * DEG * 1e-3), (-8 * DEG, 11 * DEG), (0.01, 0.2)
    for kernel, law in (
        (advance_first_order, (0.05, math.exp(-1e-3 / 0.05))),
        (advance_second_order, second_order_transition(2 * math.pi * 3.0, 0.4, 1e-3)),
    ):
        python = kernel.function(1e-3, law, limits, travel, axis, held.tolist())
        assert kernel(1e-3, law, limits, travel, axis, packed(held)) == python


def hastening(t, x, u):
    """Return a drive whose pan speeds up as 6 t² + 2 u, whose tilt does as its own further state, which grows as 3 t²."""
    return np.array([x[2], x[3], 6.0 * t * t + 2.0 * u[0], x[4], 3.0 * t * t])


def test_a_users_drive_is_a_function_of_time_integrated_by_runge_and_kuttas_fourth_order():
    """Where the slope is of time alone it is Simpson's rule, exact for cubics: rates from 0.7 s on to rounding."""
    drive = StateSpaceDrive(dynamics=hastening, further_state=(0.25,))
    begin, n, dt = 0.7, 150, 2e-3
    held = np.tile([0.3, 9.0], (n, 1))
    (pan, pan_rate), (tilt, tilt_rate) = (0.1, -0.2), (0.4, 0.05)
    made = drive.advance(begin, dt, ((pan, pan_rate), (tilt, tilt_rate)), (0.25,), held)
    ((pan_end, pan_rate_end), (tilt_end, tilt_rate_end)), (own,) = made
    t, since = begin + n * dt, n * dt
    assert pan_rate_end == pytest.approx(pan_rate + 2.0 * (t**3 - begin**3) + 0.6 * since, abs=1e-13)
    assert own == pytest.approx(0.25 + t**3 - begin**3, abs=1e-13)
    angle = pan + (pan_rate - 2.0 * begin**3) * since + 0.5 * (t**4 - begin**4) + 0.3 * since**2
    assert pan_end == pytest.approx(angle, abs=1e-12)
    rate = tilt_rate + (0.25 - begin**3) * since + 0.25 * (t**4 - begin**4)
    assert tilt_rate_end == pytest.approx(rate, abs=1e-12)
    whole = 0.5 * (0.25 - begin**3) * since**2 + 0.05 * (t**5 - begin**5) - 0.25 * begin**4 * since
    assert tilt_end == pytest.approx(tilt + tilt_rate * since + whole, abs=1e-12)
