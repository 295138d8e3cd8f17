"""The difference of two orbits: rtn axes there and back, two bodies, and forces."""

import datetime
import math

import numpy as np

from rso_lidar import units
from rso_lidar.orbit import (
    Burn,
    Epochs,
    Forces,
    Impulse,
    OsculatingElements,
    State,
    propagate_two_body,
    state_from_elements,
)
from rso_lidar.records import BodyState
from rso_lidar.rpo import Nonlinear, rtn_axes
from rso_lidar.rpo.relative.reference_orbit import add_relative_state, find_relative_state

GM = units.EARTH_GM_M3_S2
START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
RHO, RATE = (300.0, -900.0, 300.0), (0.1, -0.2, 0.15)


def orbit(e, anomaly, perigee=7e6):
    return state_from_elements(OsculatingElements(perigee / (1 - e), e, 0.9, 2.0, 4.0, anomaly))


def chief(e, anomaly, perigee=7e6):
    r, v = orbit(e, anomaly, perigee)
    return State(epoch_utc=START, position_m=tuple(r.tolist()), velocity_m_s=tuple(v.tolist()))


def part(rho=RHO, rate=RATE, **more):
    return Nonlinear(relative_to="chief", position_m=rho, velocity_m_s=rate, **more)


def test_beside_and_back():
    rng = np.random.default_rng(5)
    times = rng.uniform(0.0, 1e5, 300)
    here = BodyState(*propagate_two_body(*orbit(0.6, 1.0), times))
    position, velocity = rng.uniform(-1e5, 1e5, (300, 3)), rng.uniform(-100.0, 100.0, (300, 3))
    back = find_relative_state(here, add_relative_state(here, position, velocity))
    np.testing.assert_allclose(back[0], position, rtol=0, atol=2e-8)  # some roundings of 3e7 m
    np.testing.assert_allclose(back[1], velocity, rtol=0, atol=1e-11)


def test_axes_and_transport_are_those_of_the_house():
    r, v = orbit(0.3, 2.0)
    rotation, rate = rtn_axes(r, v)
    rho, rho_rate = np.array([2e3, -5e3, 1e3]), np.array([3.0, -1.0, 2.0])
    body = add_relative_state(BodyState(r, v), rho, rho_rate)
    np.testing.assert_allclose(body.position_m, r + rotation.apply(rho), rtol=1e-15)
    np.testing.assert_allclose(body.velocity_m_s, v + rotation.apply(rho_rate + np.cross(rate, rho)), rtol=1e-14)


def test_it_begins_where_it_is_told_to():
    position, velocity = part().relative(Epochs(START, np.zeros(1)), chief(0.5, 2.0))
    np.testing.assert_allclose(position[0], RHO, rtol=0, atol=1e-8)
    np.testing.assert_allclose(velocity[0], RATE, rtol=0, atol=1e-11)


def test_a_body_of_the_same_orbit_a_minute_behind():
    """It passes where the chief was, at the chief's speed: known without any equation of relative motion."""
    delay, (r, v) = 60.0, orbit(0.4, 1.0)
    behind = BodyState(*(a[0] for a in propagate_two_body(r, v, np.array([-delay]))))
    rho, rate = (tuple(a.tolist()) for a in find_relative_state(BodyState(r, v), behind))
    times = np.linspace(0.0, 40000.0, 51)
    position, velocity = part(rho, rate).relative(Epochs(START, times), chief(0.4, 1.0))
    there = BodyState(*propagate_two_body(r, v, times)), BodyState(*propagate_two_body(r, v, times - delay))
    want = find_relative_state(*there)
    # 1e-8 m of the starting difference turns into along-track drift over the revolutions
    np.testing.assert_allclose(position, want[0], rtol=0, atol=1e-5)
    np.testing.assert_allclose(velocity, want[1], rtol=0, atol=1e-8)


def test_an_open_chief():
    r, v = np.array([7e6, 0.0, 0.0]), np.array([0.0, 0.6, 0.8]) * math.sqrt(2.5 * GM / 7e6)
    fast = State(epoch_utc=START, position_m=tuple(r), velocity_m_s=tuple(v))
    epochs = Epochs(START, np.array([-5e4, 0.0, 5e4]))
    position, _ = part().relative(epochs, fast)
    np.testing.assert_allclose(position[1], RHO, rtol=0, atol=1e-8)
    assert np.isfinite(position).all()
    assert part().validity(epochs, fast) == []


def test_an_epoch_has_the_same_bits_alone():
    times = np.linspace(-3e4, 3e4, 2001)
    together = part().relative(Epochs(START, times), chief(0.6, 1.0))
    for k in (0, 1, 1000, 2000):
        for got, want in zip(part().relative(Epochs(START, times[k : k + 1]), chief(0.6, 1.0)), together, strict=True):
            np.testing.assert_array_equal(got[0], want[k])


def test_forces_of_a_point_mass_are_two_bodies():
    epochs = Epochs(START, np.linspace(0.0, 12000.0, 13))
    two = part().relative(epochs, chief(0.1, 1.0))
    forced = part(forces=Forces(zonal_degree=0)).relative(epochs, chief(0.1, 1.0))
    # the integrator's 1e-13 of 7e6 m a step, growing along the track over two revolutions
    np.testing.assert_allclose(forced[0], two[0], rtol=0, atol=1e-4)
    np.testing.assert_allclose(forced[1], two[1], rtol=0, atol=1e-7)


def test_flattening_acts_on_the_difference():
    """Over 12 hours in low orbit J2 moves a body 1 km away by a few per cent, and a part with forces does not warn of it."""
    ring = (200.0, -1000.0, 300.0), (0.0, -400.0 * math.sqrt(GM / 7e6**3), 0.0)  # an ellipse that does not drift
    epochs = Epochs(START, np.linspace(0.0, 43200.0, 25))
    forced, two = part(*ring, forces=Forces(zonal_degree=2)), part(*ring)
    moved = forced.relative(epochs, chief(0.0, 1.0))[0] - two.relative(epochs, chief(0.0, 1.0))[0]
    assert 10.0 < np.abs(moved).max() < 150.0
    assert forced.validity(epochs, chief(0.0, 1.0)) == []


def test_validity_names_forces():
    assert part().validity(Epochs(START, np.array([0.0, 3600.0])), chief(0.0, 0.0)) == []
    (only,) = part().validity(Epochs(START, np.array([0.0, 86400.0])), chief(0.0, 0.0))
    assert "forces" in only


def test_an_impulse_in_the_chiefs_axes_is_two_conics():
    """The velocity jumps by the impulse in the chief's axes, and a new two-body arc begins there."""
    kick, at_s = (0.3, -0.2, 0.1), 1500.0
    around, times = chief(0.1, 1.0), np.array([0.0, 1499.0, 1500.0, 4000.0])
    impulse = Impulse(at_s=at_s, delta_v_m_s=kick, axes="chief_rtn")
    got = part(maneuvers=(impulse,)).relative(Epochs(START, times), around)
    free = part().relative(Epochs(START, times), around)
    np.testing.assert_allclose(got[0][:3], free[0][:3], rtol=0, atol=1e-5)
    np.testing.assert_allclose(got[1][2] - free[1][2], kick, rtol=0, atol=1e-8)
    there = BodyState(*(rows[0] for rows in propagate_two_body(*orbit(0.1, 1.0), np.array([at_s]))))
    start = add_relative_state(there, free[0][2], free[1][2] + kick)
    after = BodyState(*propagate_two_body(start.position_m, start.velocity_m_s, np.array([2500.0])))
    then = BodyState(*propagate_two_body(*orbit(0.1, 1.0), times[3:]))
    np.testing.assert_allclose(got[0][3:], find_relative_state(then, after)[0], rtol=0, atol=1e-4)
    assert part(maneuvers=(impulse,)).impulses_s == (at_s,)


def test_axes_of_an_impulse_differ_by_the_separation():
    """Ten kilometres behind, the body's own rtn axes are turned by rho / r: an impulse outward leans by that along-track."""
    behind, kick = (0.0, -10_000.0, 0.0), (1.0, 0.0, 0.0)
    around, radius = chief(0.0, 1.0), 7e6
    ends = [
        part(behind, (0.0, 0.0, 0.0), maneuvers=(Impulse(at_s=10.0, delta_v_m_s=kick, axes=axes),)).relative(
            Epochs(START, np.array([10.0])), around
        )[1][0]
        for axes in ("rtn", "chief_rtn")
    ]
    np.testing.assert_allclose(ends[0] - ends[1], [0.0, -10_000.0 / radius, 0.0], rtol=0, atol=2e-6)  # second order


def test_a_burn_with_ramps_gives_what_its_impulse_gives():
    """Its total is acceleration times duration less half the ramps; symmetric about the impulse's instant."""
    burn = Burn(
        from_s=995.0, duration_s=10.0, acceleration_m_s2=(0.0, 0.1, 0.0), rise_s=4.0, fall_s=4.0, axes="chief_rtn"
    )
    impulse = Impulse(at_s=1000.0, delta_v_m_s=(0.0, 0.6, 0.0), axes="chief_rtn")
    assert abs(burn.size_m_s - 0.6) < 1e-15
    epochs = Epochs(START, np.array([2000.0]))
    one, other = (part(maneuvers=(push,)).relative(epochs, chief(0.0, 1.0)) for push in (burn, impulse))
    # dv T^2 n^2 / 24 of Coriolis and gravity gradient, over the 1000 s after
    np.testing.assert_allclose(one[0], other[0], rtol=0, atol=1e-2)
    np.testing.assert_allclose(one[1], other[1], rtol=0, atol=1e-5)


def test_advice_on_late_maneuvers():
    late = part(maneuvers=(Impulse(at_s=1000.0, delta_v_m_s=(0.0, 1.0, 0.0)),))
    assert late.advise(2000.0) == []
    (line,) = late.advise(500.0)
    assert "after the last frame at 500 s" in line
