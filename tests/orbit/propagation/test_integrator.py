import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.errors import PropagationError
from rso_lidar.orbit import OdeSolution, propagate_two_body

GM = units.EARTH_GM_M3_S2


def two_body(_t, x):
    return np.concatenate([x[3:], -GM * x[:3] / (x[:3] @ x[:3]) ** 1.5])


@pytest.mark.parametrize("eccentricity", [0.0, 0.7])
def test_two_bodies_forward_and_back(eccentricity):
    """The closed form (Battin), over two revolutions each way: a millimetre is the figure that users are promised."""
    perigee = 7e6
    speed = np.sqrt(GM * (1.0 + eccentricity) / perigee)
    period = 2 * np.pi * np.sqrt((perigee / (1.0 - eccentricity)) ** 3 / GM)
    start = np.array([perigee, 0.0, 0.0, 0.0, speed, 0.0])
    times = np.linspace(-2 * period, 2 * period, 501)
    flown = OdeSolution(two_body, start, panel_s=600.0)(times)
    expected, _ = propagate_two_body(start[:3], start[3:], times)
    np.testing.assert_allclose(flown[:, :3], expected, rtol=0, atol=1e-3)


def test_an_instant_has_the_same_bits_whatever_else_is_asked():
    start = np.array([7e6, 0.0, 0.0, 0.0, 7600.0, 100.0])
    times = np.linspace(-4000.0, 5000.0, 37)
    many = OdeSolution(two_body, start, panel_s=600.0)(times)
    for order in (range(len(times)), reversed(range(len(times)))):
        alone = OdeSolution(two_body, start, panel_s=600.0)
        for k in order:
            assert np.array_equal(alone(times[k : k + 1])[0], many[k])


def test_jumps_and_breaks():
    """A cart pushed at 3 s, whose thruster burns from 10 s to 12.5 s: by hand."""

    def cart(t, x):
        return np.array([x[1], 2.0 if 10.0 <= t < 12.5 else 0.0])

    cart_rolls = OdeSolution(
        cart,
        np.zeros(2),
        panel_s=7.0,
        jumps=[(3.0, lambda x: x + np.array([0.0, 1.0]))],
        breaks=[10.0, 12.5],
    )
    flown = cart_rolls(np.array([2.999, 3.0, 4.0, 10.0, 12.5, 20.0]))
    np.testing.assert_allclose(flown[:, 1], [0.0, 1.0, 1.0, 1.0, 6.0, 6.0], atol=1e-9)
    np.testing.assert_allclose(flown[:, 0], [0.0, 0.0, 1.0, 7.0, 7.0 + 2.5 + 6.25, 15.75 + 45.0], atol=1e-8)


def test_a_jump_is_seen_at_its_own_instant_and_not_a_moment_before():
    jumping = OdeSolution(
        lambda _t, _x: np.zeros(1),
        np.zeros(1),
        panel_s=10.0,
        jumps=[(10.0, lambda x: x + 1.0), (25.0, lambda x: x * 5.0)],
    )
    assert jumping(np.array([9.999999, 10.0, 24.9, 25.0, 99.0]))[:, 0].tolist() == [0.0, 1.0, 1.0, 5.0, 5.0]


def test_what_breaks_down_says_where():
    blow_up = OdeSolution(lambda _t, x: x * x, np.ones(1), panel_s=0.6, name="blow_up")  # x = 1 / (1 - t)
    np.testing.assert_allclose(blow_up(np.array([0.5])), [[2.0]], rtol=1e-10)
    with pytest.raises(PropagationError, match=r"blow_up: the integration breaks down 1 s from its start") as caught:
        blow_up(np.array([0.5, 1.5]))
    assert caught.value.bad.tolist() == [False, True]


def test_two_jumps_at_one_instant_act_in_the_order_given():
    rolling = OdeSolution(
        lambda _t, _x: np.zeros(1),
        np.ones(1),
        panel_s=10.0,
        jumps=[(4.0, lambda x: x + 1.0), (4.0, lambda x: x * 10.0)],
    )
    assert rolling(np.array([3.9, 4.0]))[:, 0].tolist() == [1.0, 20.0]


def test_what_f_does_not_know_is_not_asked_of_it_unless_it_must():
    """A table that ends at 12 s can be flown to 12 s, although steps and panels would reach beyond."""

    def table(t, x):
        if t > 12.0:
            raise ValueError("the table ends at 12 s")
        return np.array([x[1], np.cos(t)])

    rolling = OdeSolution(table, np.zeros(2), panel_s=60.0)
    np.testing.assert_allclose(rolling(np.array([3.0, 11.0, 12.0]))[:, 0], 1.0 - np.cos([3.0, 11.0, 12.0]), atol=1e-9)
    with pytest.raises(ValueError, match="the table ends"):
        rolling(np.array([3.0, 12.5]))
    np.testing.assert_allclose(rolling(np.array([10.0]))[:, 0], 1.0 - np.cos(10.0), atol=1e-9)
