"""Relative motion against the outside world: integrated orbits, the linearised equations, and closed forms."""

import datetime
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rso_lidar import units
from rso_lidar.orbit import (
    Epochs,
    Forces,
    OsculatingElements,
    State,
    equator_axes,
    mean_from_osculating,
    osculating_from_mean,
    state_from_elements,
    state_from_quasi_nonsingular,
)
from rso_lidar.pose import rotate_vectors
from rso_lidar.records import BodyState
from rso_lidar.rpo import Hill, Nonlinear, RelativeElements, YamanakaAnkersen, rtn_axes
from rso_lidar.rpo.relative.relative_elements import add_relative_elements

GM = units.EARTH_GM_M3_S2
START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
PERIGEE = 7e6
STILL = (0.0, 0.0, 0.0)


def period(e):
    return math.tau * math.sqrt((PERIGEE / (1 - e)) ** 3 / GM)


def orbit(e, anomaly):
    return state_from_elements(OsculatingElements(PERIGEE / (1 - e), e, 0.9, 2.0, 4.0, anomaly))


def motion_of(r, v):
    return State(epoch_utc=START, position_m=tuple(r.tolist()), velocity_m_s=tuple(v.tolist()))


def relative(kind, rho, rate, epochs, chief, **more):
    part = kind(relative_to="chief", position_m=tuple(rho), velocity_m_s=tuple(rate), **more)
    return part.relative(epochs, motion_of(*chief))


def integrated(pull, state, times):
    """Return rows (time, n) by DOP853 at its tightest."""
    scale = np.where(np.arange(len(state)) % 6 < 3, 1e-7, 1e-10)
    return solve_ivp(pull, (0.0, times[-1]), state, "DOP853", times, rtol=3e-14, atol=scale).y.T


def two_bodies(_, x):
    return np.concatenate([x[3:], -GM * x[:3] / np.linalg.norm(x[:3]) ** 3])


def in_rtn(chief, apart):
    """Return position and velocity in the chief's turning axes of inertial differences, rows (time, 6)."""
    rotation, rate = rtn_axes(chief[:, :3], chief[:, 3:])
    position = rotation.inv().apply(apart[:, :3])
    return position, rotation.inv().apply(apart[:, 3:]) - np.cross(rate, position)


def beside(chief, rho, rate):
    """Return the inertial state of a body, and its difference from the chief's, by SciPy's rotations."""
    rotation, omega = rtn_axes(*chief)
    apart = np.concatenate([rotation.apply(rho), rotation.apply(rate + np.cross(omega, rho))])
    return np.concatenate(chief) + apart, apart


# 1 km apart: across and along, with a drift; and one behind on (nearly) the same orbit
CASES = [
    (0.0, 1.0, (300.0, -900.0, 300.0), (0.1, -0.2, 0.15)),
    (0.1, 2.0, (300.0, -900.0, 300.0), (0.1, -0.2, 0.15)),
    (0.3, -1.0, (500.0, 800.0, -300.0), (0.2, -0.6, 0.1)),
    (0.5, 3.0, (300.0, -900.0, 300.0), (0.02, -0.1, 0.05)),
    (0.7, math.pi, (0.0, -1000.0, 0.0), STILL),
    (0.7, -2.5, (300.0, -900.0, 300.0), (0.1, -0.2, 0.15)),
    (0.7, 0.0, (10.0, -30.0, 1000.0), (0.0, -0.015, 0.0)),
]


@pytest.mark.parametrize(("e", "anomaly", "rho", "rate"), CASES)
def test_yamanaka_ankersen_is_the_linearised_truth(validation, e, anomaly, rho, rate):
    """The variational equations of two-body motion, integrated beside the chief, in inertial axes."""
    chief = orbit(e, anomaly)
    times = np.linspace(0.0, 2 * period(e), 61)

    def variation(t, x):
        r, apart = x[:3], x[6:9]
        size = np.linalg.norm(r)
        pull = -GM * (apart / size**3 - 3 * r * (r @ apart) / size**5)
        return np.concatenate([two_bodies(t, x[:6]), x[9:], pull])

    rows = integrated(variation, np.concatenate([*chief, beside(chief, rho, rate)[1]]), times)
    want = in_rtn(rows[:, :6], rows[:, 6:])
    got = relative(YamanakaAnkersen, rho, rate, Epochs(START, times), chief)
    validation(
        case=f"Yamanaka-Ankersen, e = {e:g} from {math.degrees(anomaly):.0f} deg, 1 km, two orbits: greatest error",
        source="variational equations, DOP853 (the project's limit is 1 mm)",
        expected=0.0,
        got=np.linalg.norm(got[0] - want[0], axis=1).max() * 1e3,
        tolerance=1.0,
        unit="mm",
    )
    assert np.linalg.norm(got[1] - want[1], axis=1).max() < 1e-5


@pytest.mark.parametrize(("e", "anomaly", "rho", "rate"), CASES)
def test_the_nonlinear_difference_is_an_integrators(validation, e, anomaly, rho, rate):
    chief = orbit(e, anomaly)
    times = np.linspace(0.0, 2 * period(e), 61)
    rows = [integrated(two_bodies, state, times) for state in (np.concatenate(chief), beside(chief, rho, rate)[0])]
    want = in_rtn(rows[0], rows[1] - rows[0])
    got = relative(Nonlinear, rho, rate, Epochs(START, times), chief)
    validation(
        case=f"nonlinear difference, e = {e:g} from {math.degrees(anomaly):.0f} deg, 1 km, two orbits: greatest error",
        source="two orbits by DOP853 (the project's limit is 1 mm)",
        expected=0.0,
        got=np.linalg.norm(got[0] - want[0], axis=1).max() * 1e3,
        tolerance=1.0,
        unit="mm",
    )
    assert np.linalg.norm(got[1] - want[1], axis=1).max() < 1e-5


def test_hold_on_the_v_bar_drifts_by_its_second_order(validation):
    """At rest rho behind, energy is higher by n^2 rho^2, so a by 2 rho^2 / a: 6 pi rho^2 / a behind after a revolution."""
    chief, rho = orbit(0.0, 0.0), 1000.0
    once = Epochs(START, np.array([period(0.0)]))
    truth = relative(Nonlinear, (0.0, -rho, 0.0), STILL, once, chief)[0]
    linear = relative(Hill, (0.0, -rho, 0.0), STILL, once, chief)[0]
    validation(
        case="at rest 1 km behind in low orbit: what Clohessy-Wiltshire is off by after a revolution",
        source="6 pi rho^2 / a, from the energy",
        expected=6 * math.pi * rho**2 / PERIGEE,
        got=linear[0, 1] - truth[0, 1],
        tolerance=6 * math.pi * rho**2 / PERIGEE * 3 * rho / PERIGEE,  # the third order
        unit="m",
    )


@pytest.mark.parametrize(("km", "height_km"), [(1, 0), (100, 0), (2000, 0), (2000, 5)])
def test_arcs_hold_far_along_the_track(validation, km, height_km):
    """A body on a circle of its own, `height_km` lower: it stays there, at Kepler's rate."""
    chief, a = orbit(0.0, 0.0), PERIGEE
    radius, angle = a - height_km * 1e3, -km * 1e3 / a
    n, own = (math.sqrt(GM / r**3) for r in (a, radius))
    rho = (radius * math.cos(angle) - a, radius * math.sin(angle), 0.0)
    slip = (own - n) * radius
    rate = (-slip * math.sin(angle), slip * math.cos(angle), 0.0)
    time_s = period(0.0)
    end = angle + (own - n) * time_s
    want = np.array([radius * math.cos(end) - a, radius * math.sin(end), 0.0])
    got = relative(Hill, rho, rate, Epochs(START, np.array([time_s])), chief, curvilinear=True)[0]
    second_order = 15 * math.pi * (height_km * 1e3) ** 2 / a
    validation(
        case=f"curvilinear Clohessy-Wiltshire, {km} km behind and {height_km} km below: error after a revolution",
        source="two circles by Kepler's third law; the neglected second order is 15 pi h^2 / r",
        expected=second_order,
        got=np.linalg.norm(got[0] - want),
        tolerance=second_order * 3 * height_km * 1e3 / a + 1e-5,  # the third order
        unit="m",
    )


@pytest.mark.parametrize(
    ("e", "inclination_deg", "share"), [(0.0, 97.8, 1e-5), (0.001, 51.6, 1e-5), (0.1, 28.5, 1e-5), (0.7, 63.4, 2e-5)]
)
def test_relative_elements_with_j2(validation, e, inclination_deg, share):
    """One day of both orbits integrated with J2 alone, in axes of the equator, from the same osculating states."""
    r, v = state_from_elements(OsculatingElements(PERIGEE / (1 - e), e, inclination_deg * units.DEG, 1.0, 0.7, 0.5))
    times = np.linspace(0.0, 86400.0, 201)
    turn = equator_axes(Epochs(START, np.zeros(1)))[0].T
    deltas = {"delta_a_m": 5.0, "delta_lambda_m": -1000.0, "delta_ex_m": 200.0, "delta_ey_m": 100.0}
    deltas |= {"delta_ix_m": 150.0, "delta_iy_m": -200.0}
    part = RelativeElements(relative_to="chief", **deltas)
    got, _ = part.relative(Epochs(START, times), motion_of(rotate_vectors(turn, r), rotate_vectors(turn, v)))
    mean = mean_from_osculating(r, v)

    def flattened(_, x):
        r2 = x[:3] @ x[:3]
        push = 1.5 * units.EARTH_J2 * units.EARTH_ZONAL_RADIUS_M**2 / r2
        pull = 1 + push * (np.array([1.0, 1.0, 3.0]) - 5 * x[2] ** 2 / r2)
        return np.concatenate([x[3:], -GM / r2**1.5 * x[:3] * pull])

    body = osculating_from_mean(add_relative_elements(mean, part.elements_m))
    rows = [integrated(flattened, np.concatenate(state), times) for state in ((r, v), body)]
    want, _ = in_rtn(rows[0], rows[1] - rows[0])
    validation(
        case=f"relative elements with J2, 1 km, e = {e:g}, i = {inclination_deg:g} deg, one day: greatest error",
        source="two orbits with J2 by DOP853; tolerance: the stated share of the separation",
        expected=0.0,
        got=np.linalg.norm(got - want, axis=1).max(),
        tolerance=share * np.linalg.norm(want, axis=1).max(),
        unit="m",
    )
    # and J2 is what makes the difference: the same start flown as two bodies ends elsewhere
    start = in_rtn(rows[0][:1], (rows[1] - rows[0])[:1])
    plain = relative(Nonlinear, start[0][0].tolist(), start[1][0].tolist(), Epochs(START, times), (r, v))[0]
    assert np.linalg.norm(plain - want, axis=1).max() > 30.0


def test_relative_elements_and_forces_agree(validation):
    """The nonlinear difference with J2 about the pole of date, against mean elements in axes of that pole."""
    turn = equator_axes(Epochs(START, np.zeros(1)))[0].T
    at = state_from_elements(OsculatingElements(PERIGEE, 0.001, 1.7, 1.0, 0.7, 0.5))
    chief = rotate_vectors(turn, at[0]), rotate_vectors(turn, at[1])
    part = RelativeElements(relative_to="chief", delta_lambda_m=-1000.0, delta_ex_m=200.0, delta_iy_m=300.0)
    epochs = Epochs(START, np.linspace(0.0, 20000.0, 41))
    elements, rates = part.relative(epochs, motion_of(*chief))
    forced = relative(Nonlinear, elements[0], rates[0], epochs, chief, forces=Forces(zonal_degree=2))[0]
    validation(
        case="relative elements and the nonlinear difference with J2, 1 km, 20,000 s: greatest disagreement",
        source="each other; tolerance: 1e-5 of the separation",
        expected=0.0,
        got=np.linalg.norm(elements - forced, axis=1).max(),
        tolerance=1e-5 * np.linalg.norm(forced, axis=1).max(),
        unit="m",
    )


def test_inclinations_are_from_the_equator_of_date(validation):
    """Not from that of GCRS, 0.14 deg away in 2024: the node of an orbit inclined by 2.9 deg would be 2.7 deg off."""
    state = BodyState(*state_from_quasi_nonsingular(np.array([PERIGEE, 0.4, 0.0, 0.0, 0.05, 0.2])))
    turn = equator_axes(Epochs(START, np.zeros(1)))[0].T
    chief = rotate_vectors(turn, state.position_m), rotate_vectors(turn, state.velocity_m_s)
    part = RelativeElements(relative_to="chief", delta_ix_m=1000.0, j2=False)
    position, _ = part.relative(Epochs(START, np.linspace(0.0, period(0.0), 7201)), motion_of(*chief))
    latitude = 0.4 + math.tau * np.argmax(position[:, 2]) / 7200
    validation(
        case="delta_ix alone: argument of latitude of the greatest distance across",
        source="D'Amico (2010), eq. 2.17: at 90 deg",
        expected=90.0,
        got=latitude / units.DEG,
        tolerance=0.05,  # the step
        unit="deg",
    )
