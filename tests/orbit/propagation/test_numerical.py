"""Integrated motion: two bodies, conserved quantities, thrust, impact, and equal bits."""

import datetime
import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.orbit import (
    Burn,
    Drag,
    Ephemeris,
    Epochs,
    Forces,
    Impulse,
    IntegratedOrbit,
    Kepler,
    Numerical,
    RadiationPressure,
    State,
    Tle,
    integrate_orbit,
    propagate_two_body,
    rotate_to_inertial,
)
from rso_lidar.orbit.sky.precession import pole_direction

GM = units.EARTH_GM_M3_S2
START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
R, V = np.array([4.2e6, -3.1e6, 4.4e6]), np.array([3.6e3, 6.5e3, 1.2e3])
STATE = State(epoch_utc=START, position_m=tuple(R), velocity_m_s=tuple(V))
POINT = Forces(zonal_degree=0)


@pytest.mark.parametrize("e", [0.0, 0.1, 0.7])
def test_a_point_mass_is_two_body_motion(e):
    orbit = Kepler(
        epoch_utc=START,
        semi_major_axis_km=7000 / (1 - e),
        eccentricity=e,
        inclination_deg=51.6,
        raan_deg=20.0,
        argument_of_perigee_deg=30.0,
        mean_anomaly_deg=40.0,
    )
    epochs = Epochs(START, np.linspace(-20_000.0, 40_000.0, 61))
    got, right = Numerical(initial=orbit, forces=POINT).states(epochs), orbit.states(epochs)
    # 1e-13 of a radius a step, some hundreds of steps, growing along the track
    assert np.linalg.norm(got.position_m - right.position_m, axis=1).max() < 1e-3
    assert np.linalg.norm(got.velocity_m_s - right.velocity_m_s, axis=1).max() < 1e-6


def test_an_instant_has_the_same_bits_in_any_company():
    forces = Forces(zonal_degree=4, sun=True, radiation_pressure=RadiationPressure(area_m2=4.0, mass_kg=100.0))
    burn = Burn(from_s=100.0, duration_s=50.0, acceleration_m_s2=(0.0, 0.01, 0.0))
    many = IntegratedOrbit(tuple(R), tuple(V), START, forces, (burn,))(np.linspace(0.0, 12_000.0, 97))
    alone = IntegratedOrbit(tuple(R), tuple(V), START, forces, (burn,))
    for k in (96, 3, 50):
        np.testing.assert_array_equal(alone(np.linspace(0.0, 12_000.0, 97)[k : k + 1])[0], many[k])
    assert integrate_orbit(R, V, START, forces) is integrate_orbit(R, V, START, forces)


def test_energy_and_momentum_about_the_pole_are_kept_by_zonals():
    from rso_lidar.orbit.propagation.forces import _ZONALS

    rows = integrate_orbit(R, V, START, Forces(zonal_degree=6))(np.linspace(0.0, 86_400.0, 201))
    pole = pole_direction(Epochs(START, np.linspace(0.0, 86_400.0, 201)))
    radius = np.linalg.norm(rows[:, :3], axis=1)
    s = (rows[:, :3] * pole).sum(axis=1) / radius
    potential = -GM / radius
    for n, j in enumerate(_ZONALS, start=2):
        p = np.polynomial.legendre.legval(s, [0.0] * n + [1.0])
        potential = potential + GM / radius * j * (units.EARTH_ZONAL_RADIUS_M / radius) ** n * p
    energy = 0.5 * (rows[:, 3:] ** 2).sum(axis=1) + potential
    momentum = (np.cross(rows[:, :3], rows[:, 3:]) * pole).sum(axis=1)
    # the pole itself moves by 0.06 arcsecond, 3e-7 rad, a day: J2 times that, and for momentum its sine of inclination
    assert np.ptp(energy) / abs(energy[0]) < 1e-9
    assert np.ptp(momentum) / abs(momentum[0]) < 1e-6
    assert (
        np.ptp(np.linalg.norm(np.cross(rows[:, :3], rows[:, 3:]), axis=1)) / abs(momentum[0]) > 1e-5
    )  # not so the whole of it


def test_impulse_is_two_conics():
    times = np.array([500.0, 999.999999, 1000.0, 3000.0])
    impulse = Impulse(at_s=1000.0, delta_v_m_s=(1.0, 20.0, -3.0), axes="vnc")
    got = Numerical(initial=STATE, forces=POINT, maneuvers=(impulse,)).states(Epochs(START, times))
    r, v = (column[0] for column in propagate_two_body(R, V, np.array([1000.0])))
    v = v + rotate_to_inertial((1.0, 20.0, -3.0), "vnc", r.tolist(), v.tolist())
    after = propagate_two_body(r, v, times[2:] - 1000.0)
    before = propagate_two_body(R, V, times[:2])
    np.testing.assert_allclose(got.position_m, np.concatenate([before[0], after[0]]), rtol=0, atol=1e-5)
    np.testing.assert_allclose(got.velocity_m_s, np.concatenate([before[1], after[1]]), rtol=0, atol=1e-8)


def test_burn_far_from_anything_is_tsiolkovsky():
    # 5e9 m out the Earth pulls 1.6e-5 m/s2; taken out by flying the same without thrust
    far, slow = np.array([5e9, 0.0, 0.0]), np.array([0.0, 100.0, 0.0])
    burn = Burn(from_s=300.0, duration_s=700.0, thrust_n=(0.0, 30.0, 40.0), mass_kg=200.0, isp_s=220.0, axes="inertial")
    at = np.array([200.0, 1000.0, 5000.0])
    change = integrate_orbit(far, slow, START, POINT, (burn,))(at) - integrate_orbit(far, slow, START, POINT)(at)
    # before the burn the two have other steps, each good to 1e-13 of 5e9 m and to 1e-9 m/s
    np.testing.assert_allclose(change[0, :3], 0.0, rtol=0, atol=10 * 5e-4)
    np.testing.assert_allclose(change[0, 3:], 0.0, rtol=0, atol=10 * 1e-9)
    for row in change[1:]:
        np.testing.assert_allclose(
            row[3:], np.array([0.0, 0.6, 0.8]) * burn.size_m_s, rtol=0, atol=1e-6 * burn.size_m_s
        )
    # way flown while burning: g0 isp (t + (t - m0 / q) ln(m0 / (m0 - q t)))
    c, q = 9.80665 * 220.0, 50.0 / (9.80665 * 220.0)
    way = c * (700.0 + (700.0 - 200.0 / q) * math.log(200.0 / (200.0 - q * 700.0)))
    assert np.linalg.norm(change[1, :3]) == pytest.approx(way, rel=1e-6)


def test_short_burn_is_nearly_an_impulse():
    burn = Burn(from_s=999.5, duration_s=1.0, acceleration_m_s2=(0.0, 2.0, 0.0))
    impulse = Impulse(at_s=1000.0, delta_v_m_s=(0.0, 2.0, 0.0))
    at = np.array([4000.0])
    a, b = (integrate_orbit(R, V, START, Forces(), (m,))(at)[0] for m in (burn, impulse))
    assert 0.0 < np.linalg.norm((a - b)[:3]) < 1e-2  # a dv (n dt)^2 / 24 in velocity, times the run
    assert Numerical(initial=STATE, maneuvers=(burn, impulse)).delta_v_m_s == pytest.approx(4.0)


def test_a_burn_from_the_start_and_one_after_the_other():
    one = (Burn(from_s=0.0, duration_s=200.0, acceleration_m_s2=(0.0, 0.02, 0.01)),)
    two = tuple(Burn(from_s=t, duration_s=100.0, acceleration_m_s2=(0.0, 0.02, 0.01)) for t in (0.0, 100.0))
    at = np.array([50.0, 150.0, 3000.0])
    a, b = (integrate_orbit(R, V, START, POINT, m)(at) for m in (one, two))
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-5)


def test_shadow_edges_are_not_stepped_over():
    """Steps held to 5 s see every edge; free ones must come out the same, within 1 mm: else it is 2 cm."""
    from scipy.integrate import solve_ivp

    forces = Forces(zonal_degree=0, radiation_pressure=RadiationPressure(area_m2=4.0, mass_kg=100.0))
    field = forces.field(START)

    def derivative(t, x):
        return [*x[3:], *field(t, tuple(x[:3]), tuple(x[3:]))[0]]

    held = solve_ivp(derivative, (0, 8000.0), [*R, *V], method="DOP853", rtol=1e-12, atol=1e-7, max_step=5.0).y[:3, -1]
    free = integrate_orbit(R, V, START, forces)(np.array([8000.0]))[0, :3]
    assert np.linalg.norm(free - propagate_two_body(R, V, np.array([8000.0]))[0][0]) > 0.3
    assert np.linalg.norm(free - held) < 1e-3


def test_a_fall_to_the_ground_is_told():
    low = State(epoch_utc=START, position_m=(6.6e6, 0.0, 0.0), velocity_m_s=(0.0, 7.5e3, 0.0))
    drag = Forces(drag=Drag(area_m2=1.0, mass_kg=1000.0))
    with pytest.raises(
        PropagationError, match=r"(meets the Earth|falls below 100 km) by \d+ s after the start, before 2 of 3 epochs"
    ) as caught:
        Numerical(initial=low, forces=drag).states(Epochs(START, np.array([0.0, 4000.0, 5000.0])))
    np.testing.assert_array_equal(caught.value.bad, [False, True, True])
    assert "\n" not in str(caught.value)
    Numerical(initial=low, forces=drag).states(Epochs(START, np.array([0.0, 60.0])))  # before that all is well


def test_a_tle_hands_over():
    tle = Tle(file="tle/tdrs.tle")
    epochs = Epochs(START, np.array([0.0, 3600.0]))
    got = Numerical(initial=tle, forces=Forces(zonal_degree=6, sun=True, moon=True)).states(epochs)
    right = tle.states(epochs)
    np.testing.assert_allclose(got.position_m[0], right.position_m[0], rtol=0, atol=1e-6)
    assert np.linalg.norm(got.position_m[1] - right.position_m[1]) < 2e3  # SGP4 is good to a kilometre or so


def test_unknown_maneuvers_are_refused():
    with pytest.raises(ScenarioError, match="unknown type 'burst'; did you mean 'burn'"):
        Numerical(initial=STATE, maneuvers=({"type": "burst"},))


def test_an_impulse_at_the_start_changes_the_velocity_it_starts_with():
    impulse = Impulse(at_s=0.0, delta_v_m_s=(1.0, 2.0, 3.0), axes="inertial")
    kicked = State(epoch_utc=START, position_m=tuple(R), velocity_m_s=tuple(V + np.array([1.0, 2.0, 3.0])))
    epochs = Epochs(START, np.array([0.0, 500.0]))
    got, right = Numerical(initial=STATE, maneuvers=(impulse,)).states(epochs), Numerical(initial=kicked).states(epochs)
    np.testing.assert_allclose(got.position_m, right.position_m, rtol=0, atol=1e-6)
    np.testing.assert_allclose(got.velocity_m_s, right.velocity_m_s, rtol=0, atol=1e-9)


def test_the_axes_of_a_chief_are_refused_without_one():
    kick = Impulse(at_s=1.0, delta_v_m_s=(1.0, 2.0, 3.0), axes="chief_rtn")
    with pytest.raises(ScenarioError, match="'numerical' is relative to none"):
        Numerical(initial=STATE, maneuvers=(kick,))


def test_an_ephemeris_may_give_the_initial_state(tmp_path):
    rows = STATE.states(Epochs(START, np.arange(-300.0, 301.0, 60.0)))
    table = np.column_stack([np.arange(-300.0, 301.0, 60.0), rows.position_m, rows.velocity_m_s])
    file = tmp_path / "start.csv"
    header = "time_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s"
    np.savetxt(file, table, fmt="%.9f", delimiter=",", header=header, comments="")
    epochs = Epochs(START, np.array([0.0, 3000.0]))
    got = Numerical(initial=Ephemeris(file=str(file))).states(epochs)
    np.testing.assert_allclose(got.position_m, Numerical(initial=STATE).states(epochs).position_m, rtol=0, atol=1e-4)
