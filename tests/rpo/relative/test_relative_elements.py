"""Relative orbital elements: there and back, what each of them looks like in rtn axes, J2's drifts, and validity."""

import datetime
import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs, OsculatingElements, State, equator_axes, propagate_j2_secular, state_from_elements
from rso_lidar.pose import rotate_vectors
from rso_lidar.records import BodyState
from rso_lidar.rpo import Nonlinear, RelativeElements, relative_elements_from_states, state_from_relative_elements
from rso_lidar.rpo.relative.reference_orbit import find_relative_state
from rso_lidar.rpo.relative.relative_elements import add_relative_elements, difference_elements

GM = units.EARTH_GM_M3_S2
START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
RADIUS = 7e6
TO_GCRS = equator_axes(Epochs(START, np.zeros(1)))[0].T
SET = {
    "delta_a_m": 5.0,
    "delta_lambda_m": -1000.0,
    "delta_ex_m": 200.0,
    "delta_ey_m": 100.0,
    "delta_ix_m": 150.0,
    "delta_iy_m": -200.0,
}


def state(e=0.001, inclination=1.7, latitude=0.8, perigee=RADIUS):
    """Return a state in axes of the equator of date."""
    return BodyState(
        *state_from_elements(OsculatingElements(perigee / (1 - e), e, inclination, 1.0, 0.3, latitude - 0.3))
    )


def in_rtn(of, elements_m):
    return find_relative_state(of, state_from_relative_elements(of, elements_m))


def chief(of):
    r, v = rotate_vectors(TO_GCRS, of.position_m), rotate_vectors(TO_GCRS, of.velocity_m_s)
    return State(epoch_utc=START, position_m=tuple(r.tolist()), velocity_m_s=tuple(v.tolist()))


def part(**keys):
    return RelativeElements(relative_to="chief", **keys)


@pytest.mark.parametrize("e", [0.0, 0.001, 0.3, 0.8])
@pytest.mark.parametrize("inclination", [0.01, 0.9, 1.7, 3.1])
def test_there_and_back(e, inclination):
    of, wanted = state(e, inclination), np.array(list(SET.values()))
    got = relative_elements_from_states(of, state_from_relative_elements(of, wanted))
    # some roundings of a, more by what turns a state of that eccentricity into elements, and of a dRAAN sin i
    np.testing.assert_allclose(got, wanted, rtol=0, atol=5e-8 / (1 - e) ** 2 / math.sin(inclination))


def test_definition_by_hand():
    c = np.array([7e6, 0.5, 0.01, 0.02, 1.0, 6.2])
    d = np.array([7e6 + 70, 0.5 + 1e-4, 0.0101, 0.0199, 1.00002, 6.2003 - math.tau])
    # D'Amico (2010) eq. 2.2 times a
    wanted = [70.0, 7e6 * (1e-4 + 3e-4 * math.cos(1.0)), 700.0, -700.0, 140.0, 7e6 * 3e-4 * math.sin(1.0)]
    np.testing.assert_allclose(difference_elements(c, d), wanted, rtol=0, atol=1e-7)
    back = add_relative_elements(c, np.array(wanted))
    np.testing.assert_allclose(back[:5], d[:5], rtol=1e-14)
    assert math.remainder(back[5] - d[5], math.tau) == pytest.approx(0.0, abs=1e-13)


@pytest.mark.parametrize("latitude", [0.0, 0.9, 2.5, 4.0])
def test_in_rtn_axes_about_a_circle(latitude):
    """D'Amico (2010) eq. 2.17, radial, along and across at the argument of latitude u."""
    da, dl, dex, dey, dix, diy = SET.values()
    position, velocity = in_rtn(state(0.0, 1.1, latitude), np.array(list(SET.values())))
    c, s, n = math.cos(latitude), math.sin(latitude), math.sqrt(GM / RADIUS**3)
    wanted = [da - dex * c - dey * s, dl + 2 * dex * s - 2 * dey * c, dix * s - diy * c]
    slopes = [n * (dex * s - dey * c), n * (-1.5 * da + 2 * dex * c + 2 * dey * s), n * (dix * c + diy * s)]
    # the second order, rho^2 / a with a few terms of it
    np.testing.assert_allclose(position, wanted, rtol=0, atol=5 * 1e6 / RADIUS)
    np.testing.assert_allclose(velocity, slopes, rtol=0, atol=5 * 1e6 / RADIUS * n)


def test_eccentricity_and_inclination_apart_keep_clear():
    """With their vectors parallel the body is never nearer to the track than the lesser of them (D'Amico 2010, 2.3)."""
    of, epochs = state(0.0), Epochs(START, np.linspace(0.0, 6000.0, 201))
    safe = part(delta_ex_m=200.0, delta_ix_m=300.0, j2=False)
    position, _ = safe.relative(epochs, chief(of))
    clear = np.hypot(position[:, 0], position[:, 2]).min()
    assert clear == pytest.approx(200.0, abs=0.1)  # second order, 600^2 / 7e6 = 0.05 m
    crossed = part(delta_ex_m=200.0, delta_iy_m=300.0, j2=False).relative(epochs, chief(of))[0]
    assert np.hypot(crossed[:, 0], crossed[:, 2]).min() < 10.0


@pytest.mark.parametrize(("e", "inclination"), [(0.0, 1.7), (0.001, 0.05), (0.6, 0.9)])
def test_it_begins_at_its_elements(e, inclination):
    of = state(e, inclination)
    got = part(**SET, j2=False).relative(Epochs(START, np.zeros(1)), chief(of))
    for one, want in zip(got, in_rtn(of, np.array(list(SET.values()))), strict=True):
        np.testing.assert_allclose(one[0], want, rtol=0, atol=1e-6)


def test_without_j2_it_is_the_nonlinear_difference():
    of = state(0.4)
    rho, rate = (tuple(a.tolist()) for a in in_rtn(of, np.array(list(SET.values()))))
    epochs = Epochs(START, np.linspace(0.0, 30000.0, 31))
    got = part(**SET, j2=False).relative(epochs, chief(of))
    want = Nonlinear(relative_to="chief", position_m=rho, velocity_m_s=rate).relative(epochs, chief(of))
    np.testing.assert_allclose(got[0], want[0], rtol=0, atol=1e-4)  # 1e-8 m of the start, drifting
    np.testing.assert_allclose(got[1], want[1], rtol=0, atol=1e-7)


def test_j2_moves_the_elements_as_damico_says():
    """D'Amico (2010) eq. 2.30, with gamma = J2 / 2 (R / a)^2: what a day does to the elements."""
    a, i, day = RADIUS, 1.7, 86400.0
    c = np.array([a, 0.5, 0.0, 0.0, i, 1.0])
    start = np.array([0.0, -1000.0, 200.0, 100.0, 150.0, -200.0])
    got = difference_elements(propagate_j2_secular(c, day), propagate_j2_secular(add_relative_elements(c, start), day))
    gamma = 0.5 * units.EARTH_J2 * (units.EARTH_ZONAL_RADIUS_M / a) ** 2
    swept = math.sqrt(GM / a**3) * day
    turn = 1.5 * gamma * (5 * math.cos(i) ** 2 - 1) * swept
    ex, ey = 200 * math.cos(turn) - 100 * math.sin(turn), 200 * math.sin(turn) + 100 * math.cos(turn)
    along = -1000.0 - 10.5 * gamma * math.sin(2 * i) * 150.0 * swept
    across = -200.0 + 3 * gamma * math.sin(i) ** 2 * 150.0 * swept
    # J2 squared, and the second order in the elements: e^2 = 1e-9 and di = 2e-5 of the drifts, a few metres each
    np.testing.assert_allclose(got, [0.0, along, ex, ey, 150.0, across], rtol=0, atol=0.3)
    assert abs(across + 200.0) > 10.0
    assert abs(turn) > 0.02


def test_an_epoch_has_the_same_bits_alone():
    times = np.linspace(-1e4, 3e4, 801)
    for j2 in (True, False):
        together = part(**SET, j2=j2).relative(Epochs(START, times), chief(state()))
        for k in (0, 1, 400, 800):
            alone = part(**SET, j2=j2).relative(Epochs(START, times[k : k + 1]), chief(state()))
            for got, want in zip(alone, together, strict=True):
                np.testing.assert_array_equal(got[0], want[k])


def test_what_cannot_be_is_refused_in_words():
    now = Epochs(START, np.zeros(1))
    with pytest.raises(ScenarioError, match="perigee inside the Earth"):
        part(delta_ex_m=2e6).relative(now, chief(state()))
    with pytest.raises(ScenarioError, match="too near the equator"):
        part(delta_iy_m=1000.0).relative(now, chief(state(0.001, 1e-5)))
    with pytest.raises(ScenarioError, match="open"):
        part(delta_a_m=1000.0).relative(now, chief(BodyState(np.array([7e6, 0, 0]), np.array([0, 6e3, 11e3]))))


def test_an_equatorial_chief_may_have_a_body_that_is_tilted():
    position, _ = part(delta_ix_m=500.0).relative(Epochs(START, np.linspace(0.0, 6000.0, 101)), chief(state(0.0, 0.0)))
    assert np.abs(position[:, 2]).max() == pytest.approx(500.0, rel=1e-2)


def test_validity():
    hour, days = (Epochs(START, np.array([0.0, seconds])) for seconds in (3600.0, 2.5 * 86400.0))
    assert part(**SET).validity(days, chief(state())) == []
    (only,) = part(**SET, j2=False).validity(days, chief(state()))
    assert "j2 = true" in only
    assert part(**SET, j2=False).validity(hour, chief(state())) == []
    (only,) = part(**SET).validity(hour, chief(state(0.001, 1e-4)))
    assert "nonlinear" in only
    (only,) = part(**SET).validity(days, chief(state(perigee=6.8e6)))
    assert "drag" in only
