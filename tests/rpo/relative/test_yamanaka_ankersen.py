"""Yamanaka-Ankersen: at any anomaly, against Clohessy-Wiltshire on a circle and two-body orbits; and its validity."""

import datetime
import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs, OsculatingElements, State, propagate_two_body, state_from_elements
from rso_lidar.records import BodyState
from rso_lidar.rpo import YamanakaAnkersen, clohessy_wiltshire, propagate_yamanaka_ankersen
from rso_lidar.rpo.relative.reference_orbit import add_relative_state, find_relative_state

GM = units.EARTH_GM_M3_S2
START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
PERIGEE = 7e6
RHO, RATE = np.array([300.0, -900.0, 300.0]), np.array([0.1, -0.2, 0.15])


def orbit(e, anomaly):
    return state_from_elements(OsculatingElements(PERIGEE / (1 - e), e, 0.9, 2.0, 4.0, anomaly))


def period(e):
    return math.tau * math.sqrt((PERIGEE / (1 - e)) ** 3 / GM)


def chief(e, anomaly):
    r, v = orbit(e, anomaly)
    return State(epoch_utc=START, position_m=tuple(r.tolist()), velocity_m_s=tuple(v.tolist()))


def part(rho=RHO, rate=RATE):
    return YamanakaAnkersen(relative_to="chief", position_m=tuple(rho), velocity_m_s=tuple(rate))


@pytest.mark.parametrize("anomaly", [0.0, 1.0, 3.1, -2.0])
def test_on_a_circle_it_is_clohessy_wiltshire(anomaly):
    times = np.linspace(-period(0.0), 3 * period(0.0), 81)
    got = propagate_yamanaka_ankersen(RHO, RATE, times, *orbit(0.0, anomaly))
    want = clohessy_wiltshire(RHO, RATE, times, math.tau / period(0.0))
    # rounding of 18.8 rad and of the state's own eccentricity, 1e-16, in 3e4 m
    np.testing.assert_allclose(got[0], want[0], rtol=0, atol=1e-14 * 3e4)
    np.testing.assert_allclose(got[1], want[1], rtol=0, atol=1e-14 * 30.0)


@pytest.mark.parametrize("e", [0.0, 1e-12, 0.05, 0.3, 0.7, 0.95])
@pytest.mark.parametrize("anomaly", [0.0, 0.4, 2.0, math.pi, -1.3])
def test_it_begins_where_it_is_told_to(e, anomaly):
    position, velocity = propagate_yamanaka_ankersen(RHO, RATE, np.zeros(1), *orbit(e, anomaly))
    rounding = 1e-13 / (1 - e) ** 2
    np.testing.assert_allclose(position[0], RHO, rtol=0, atol=1e3 * rounding)
    np.testing.assert_allclose(velocity[0], RATE, rtol=0, atol=rounding)


@pytest.mark.parametrize(("e", "anomaly"), [(0.1, 0.0), (0.3, 2.5), (0.7, -2.0), (0.9, 3.0)])
def test_it_is_two_bodies_to_first_order(e, anomaly):
    """Half the difference of two Kepler orbits, one on either side of the chief, has no second order in it."""
    r, v = orbit(e, anomaly)
    times = np.linspace(-period(e), 2 * period(e), 61)
    here = BodyState(*propagate_two_body(r, v, times))
    small = 0.05

    def difference(scale):
        body = add_relative_state(BodyState(r, v), scale * RHO, scale * RATE)
        return find_relative_state(here, BodyState(*propagate_two_body(body.position_m, body.velocity_m_s, times)))

    linear = [0.5 * (a - b) / small for a, b in zip(difference(small), difference(-small), strict=True)]
    got = propagate_yamanaka_ankersen(RHO, RATE, times, r, v)
    # the third order, (rho / q)^2 of it, and rounding: 1e-8 m of large orbits, scaled up by twenty and by the drift
    share = 4 * (small * np.abs(got[0]).max() / PERIGEE) ** 2 + 1e-8
    np.testing.assert_allclose(got[0], linear[0], rtol=0, atol=1e-5 + share * np.abs(got[0]).max())
    np.testing.assert_allclose(got[1], linear[1], rtol=0, atol=1e-8 + share * np.abs(got[1]).max())


def test_velocity_is_the_slope_in_the_turning_axes():
    times, h = np.linspace(0.0, 2 * period(0.7), 41), 0.05
    before, at, after = (
        propagate_yamanaka_ankersen(RHO, RATE, times + shift, *orbit(0.7, 2.5)) for shift in (-h, 0.0, h)
    )
    # h^2 / 6 of the third derivative, n at perigee cubed, and rounding of 5e4 m over 2 h
    size = np.abs(at[0]).max()
    np.testing.assert_allclose(
        (after[0] - before[0]) / (2 * h), at[1], rtol=0, atol=h**2 * 0.0015**3 * size + 1e-15 * size / h
    )


def test_an_epoch_has_the_same_bits_alone():
    times = np.linspace(-3e4, 3e4, 10_001)
    together = part().relative(Epochs(START, times), chief(0.6, 1.0))
    for k in (0, 1, 4095, 4096, 10_000):
        for got, want in zip(part().relative(Epochs(START, times[k : k + 1]), chief(0.6, 1.0)), together, strict=True):
            np.testing.assert_array_equal(got[0], want[k])


@pytest.mark.parametrize("e", [1.0, 1.4])
def test_an_open_orbit_is_refused(e):
    speed = math.sqrt(GM * (1 + e) / PERIGEE) * (1 + 1e-12)
    open_ = State(epoch_utc=START, position_m=(PERIGEE, 0.0, 0.0), velocity_m_s=(0.0, speed, 0.0))
    with pytest.raises(ScenarioError, match=r"open.*'nonlinear'"):
        part().relative(Epochs(START, np.zeros(1)), open_)


def test_validity():
    hours = Epochs(START, np.linspace(0.0, 7200.0, 5))
    assert part(rate=np.zeros(3)).validity(hours, chief(0.5, math.pi)) == []
    (only,) = part(rho=np.array([0.0, -2e4, 0.0])).validity(hours, chief(0.5, math.pi))
    assert "nonlinear" in only
    assert "20." in only
    still = part(rho=np.array([0.0, -100.0, 0.0]), rate=np.zeros(3))
    (only,) = still.validity(Epochs(START, np.array([0.0, 3 * 86400.0])), chief(0.0, 0.0))
    assert "flattening" in only
    assert "relative_elements" in only
