"""Proximity operations and Lambert's problem against closed forms, printed examples and other solvers."""

import datetime
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rso_lidar import rpo, units
from rso_lidar.orbit import Epochs, Kepler, State, solve_lambert, solve_lambert_all
from rso_lidar.rpo import clohessy_wiltshire, rtn_axes

GM = units.EARTH_GM_M3_S2
START = datetime.datetime(2026, 5, 1, tzinfo=datetime.UTC)
RADIUS = 6_778_137.0
N = math.sqrt(GM / RADIUS**3)
REVOLUTION = math.tau / N
CHIEF = {"relative_to": "station"}
FEHSE = "Fehse, Automated Rendezvous and Docking of Spacecraft, ch. 3"
# what is compared is one closed form with another: some thousand roundings
ROUNDING = 1e-12


def station(eccentricity=0.0, anomaly_deg=0.0):
    return Kepler(
        epoch_utc=START,
        semi_major_axis_km=RADIUS / 1e3,
        eccentricity=eccentricity,
        inclination_deg=51.6,
        raan_deg=40.0,
        argument_of_perigee_deg=15.0,
        true_anomaly_deg=anomaly_deg,
    )


def two_bodies(position_m, velocity_m_s, duration_s, dense=None):
    """Integrate a state in inertial axes by DOP853, on its own; the state at the end, or at the times of `dense`."""

    def slope(_, state):
        return np.concatenate([state[3:], -GM * state[:3] / np.linalg.norm(state[:3]) ** 3])

    start = np.concatenate([position_m, velocity_m_s])
    flown = solve_ivp(slope, (0.0, duration_s), start, "DOP853", t_eval=dense, rtol=1e-13, atol=1e-6)
    return flown.y.T if dense is not None else flown.y[:, -1]


def inertial(chief, position_m, velocity_m_s):
    """Return a state relative to the chief at its epoch, in inertial axes."""
    state = chief.at_epoch()
    axes, omega = rtn_axes(state.position_m, state.velocity_m_s)
    turn = axes.as_matrix()
    return (
        state.position_m + turn @ position_m,
        state.velocity_m_s + turn @ (velocity_m_s + np.cross(omega, position_m)),
    )


# ------------------------------------------------------------------------------------------------------- closed forms


@pytest.mark.parametrize(
    ("case", "plan", "expected"),
    [
        (
            "V-bar hop of 480 m by radial boosts, half a revolution: sum of the two, n dy / 2",
            lambda: rpo.VBarApproach(**CHIEF, from_m=-500.0, to_m=-20.0, hops=1).make_plan(N).delta_v_m_s,
            N * 480.0 / 2.0,
        ),
        (
            "V-bar hop of 480 m by tangential boosts, one revolution: sum of the two, n dy / (3 pi)",
            lambda: (
                rpo.Hop(**CHIEF, from_m=(0.0, -500.0, 0.0), to_m=(0.0, -20.0, 0.0), duration_s=REVOLUTION)
                .make_plan(N)
                .delta_v_m_s
            ),
            N * 480.0 / (3.0 * math.pi),
        ),
        (
            "V-bar straight line over 480 m: continuous thrust, 2 n dy",
            lambda: (
                rpo.VBarApproach(**CHIEF, from_m=-500.0, to_m=-20.0, speed_m_s=0.1).make_plan(N).continuous_delta_v_m_s
            ),
            2.0 * N * 480.0,
        ),
        (
            "Held 100 m above for one revolution: 3 n^2 x T",
            lambda: rpo.StationKeeping(**CHIEF, position_m=(100.0, 0.0, 0.0)).make_plan(N).delta_v_m_s,
            3.0 * N * 100.0 * math.tau,
        ),
        (
            "Held 100 m across for one revolution: n^2 z T",
            lambda: rpo.StationKeeping(**CHIEF, position_m=(0.0, 0.0, 100.0)).make_plan(N).delta_v_m_s,
            N * 100.0 * math.tau,
        ),
        (
            "Hohmann transfer from 500 m below to the V-bar: sum of the two boosts, n dx / 2",
            lambda: (
                rpo.Rendezvous(
                    **CHIEF,
                    position_m=(-500.0, -2000.0, 0.0),
                    velocity_m_s=(0.0, 1.5 * N * 500.0, 0.0),
                    to_m=(0.0, -2000.0 + 0.75 * math.pi * 500.0, 0.0),
                    duration_s=0.5 * REVOLUTION,
                )
                .make_plan(N)
                .delta_v_m_s
            ),
            N * 500.0 / 2.0,
        ),
    ],
)
def test_cost(validation, case, plan, expected):
    validation(case=case, source=FEHSE, expected=expected, got=plan(), tolerance=1e-9 * expected, unit="m/s")


def test_forced_v_bar_acceleration(validation):
    plan = rpo.VBarApproach(**CHIEF, from_m=-500.0, to_m=-20.0, speed_m_s=0.1).make_plan(N)
    control = plan.control_m_s2(np.array([0.0, 2000.0]))
    np.testing.assert_allclose(control[:, 1:], 0.0, atol=1e-18)
    validation(
        case="V-bar straight line at 0.1 m/s: radial acceleration, -2 n v",
        source=FEHSE,
        expected=-2.0 * N * 0.1,
        got=control[1, 0],
        tolerance=ROUNDING * N,
        unit="m/s^2",
    )


def test_co_elliptic_drift(validation):
    plan = rpo.CoElliptic(**CHIEF, radial_m=-1000.0, from_m=-10_000.0, duration_s=REVOLUTION).make_plan(N)
    (begin, end), _ = plan.relative(np.array([0.0, REVOLUTION]))
    assert end[0] == pytest.approx(-1000.0, abs=1e-9)
    validation(
        case="Co-elliptic 1 km below: drift in one revolution, 3 pi x",
        source=FEHSE,
        expected=3.0 * math.pi * 1000.0,
        got=end[1] - begin[1],
        tolerance=1e-8,
        unit="m",
    )


def test_two_by_one_ellipse(validation):
    part = rpo.Circumnavigation(**CHIEF, radial_m=100.0, cross_track_m=60.0, phase_deg=30.0, phase_difference_deg=20.0)
    position, _ = part.make_plan(N).relative(np.linspace(0.0, REVOLUTION, 100_001))
    for axis, (name, expected) in enumerate([("radial", 100.0), ("along-track", 200.0), ("across", 60.0)]):
        validation(
            case=f"Natural circumnavigation of 100 m: half its size, {name}",
            source="Clohessy & Wiltshire 1960: the 2:1 ellipse",
            expected=expected,
            got=0.5 * np.ptp(position[:, axis]),
            tolerance=1e-6,  # samples beside the crest: size times (pi / 1e5)^2 / 2
            unit="m",
        )


@pytest.mark.parametrize("difference_deg", [0.0, 30.0, 75.0, 180.0])
def test_separation_of_a_safety_ellipse(validation, difference_deg):
    part = rpo.SafetyEllipse(
        **CHIEF, radial_m=120.0, cross_track_m=80.0, phase_difference_deg=difference_deg, center_along_track_m=-900.0
    )
    # a delta-e = 120 m, a delta-i = 80 m, the angle between the two vectors
    e = 120.0 * np.array([1.0, 0.0])
    i = 80.0 * np.array([math.cos(math.radians(difference_deg)), math.sin(math.radians(difference_deg))])
    size = e @ e + i @ i + np.linalg.norm(e + i) * np.linalg.norm(e - i)
    expected = math.sqrt(2.0) * abs(e @ i) / math.sqrt(size)
    position, _ = part.make_plan(N).relative(np.linspace(0.0, REVOLUTION, 20_001))
    assert np.hypot(position[:, 0], position[:, 2]).min() == pytest.approx(expected, abs=1e-3)
    validation(
        case=f"e/i separation, 120 m by 80 m, vectors {difference_deg:g} deg apart: least distance from the track",
        source="D'Amico & Montenbruck, J. Guid. Control Dyn. 29 (2006) 554: minimum separation",
        expected=expected,
        got=part.separation_m,
        tolerance=1e-6,
        unit="m",
    )


def test_walking_keeps_clear_of_the_track():
    part = rpo.SafetyEllipse(**CHIEF, radial_m=120.0, cross_track_m=80.0, drift_m=300.0, center_along_track_m=-1500.0)
    plan = part.make_plan(N)
    position, _ = plan.relative(np.linspace(0.0, 12.0 * REVOLUTION, 50_001))
    assert np.linalg.norm(position, axis=1).min() >= part.separation_m
    centre = position[::5000, 1] - position[0, 1]
    assert centre[-1] == pytest.approx(12.0 * 300.0, rel=1e-9)


# ---------------------------------------------------------------------------------------------------- passive safety


def test_r_bar_turns_before_the_bodys_height(validation):
    # released at x0 with v toward the body: x = 4 x0 - 3 x0 cos nt + v / n sin nt, nearest 4 |x0| - sqrt(9 x0^2 + v^2 / n^2)
    for speed in (0.5, 2.0):
        v = speed * N * 100.0
        leg = rpo.RBarApproach(**CHIEF, from_m=-400.0, to_m=-100.0, speed_m_s=v).make_plan(N)
        (place,), (velocity,) = leg.relative(np.array([leg.duration_s - 1e-9]))
        drifted, _ = clohessy_wiltshire(place, velocity, np.linspace(0.0, REVOLUTION, 200_001), N)
        validation(
            case=f"R-bar approach at {speed:g} n x that stops 100 m below: how near the body's height it comes",
            source="Hill's equations, released at rest along-track: 4 x - sqrt(9 x^2 + (v/n)^2)",
            expected=400.0 - math.sqrt(9e4 + (v / N) ** 2),
            got=-drifted[:, 0].max(),
            tolerance=1e-5,
            unit="m",
        )


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("V-bar", rpo.VBarApproach(**CHIEF, from_m=-300.0, to_m=-30.0, speed_m_s=0.1)),
        ("R-bar", rpo.RBarApproach(**CHIEF, from_m=-300.0, to_m=-30.0, speed_m_s=0.1)),
        ("R-bar, slow,", rpo.RBarApproach(**CHIEF, from_m=-300.0, to_m=-30.0, speed_m_s=0.03)),
    ],
)
def test_passive_safety_against_two_bodies(validation, name, part):
    chief = station()
    safety = part.plan(START, chief).passive_safety()
    position, velocity = part.plan(START, chief).relative(np.array([safety.failure_s - 1e-9]))
    times = np.linspace(0.0, safety.horizon_s, 20_001)
    state = chief.at_epoch()
    ours = two_bodies(*inertial(chief, position[0], velocity[0]), safety.horizon_s, times)
    theirs = two_bodies(state.position_m, state.velocity_m_s, safety.horizon_s, times)
    away = np.linalg.norm(ours[:, :3] - theirs[:, :3], axis=1)
    before = away[times <= safety.nearest_s - safety.failure_s + 60.0]
    # the circular chief looks the same wherever it is on its orbit; second order over r within 300 m: 0.2 m
    validation(
        case=f"{name} approach from 300 m to 30 m, thrust stops at the worst instant: least distance",
        source="two bodies, integrated (DOP853)",
        expected=before.min(),
        got=safety.distance_m,
        tolerance=0.25,
        unit="m",
    )


# ------------------------------------------------------------------------------------------------------------ Lambert


def test_vallados_example(validation):
    # Vallado, Fundamentals of Astrodynamics and Applications, 4th ed., example 7-5, printed to 1e-6 km/s
    orbit = solve_lambert(np.array([15945.34e3, 0.0, 0.0]), np.array([12214.83899e3, 10249.46731e3, 0.0]), 76.0 * 60.0)
    printed = [(2058.913, 2915.965, 0.0), (-3451.565, 910.315, 0.0)]
    for name, got, expected in zip(
        ("departure", "arrival"), (orbit.departure_m_s, orbit.arrival_m_s), printed, strict=True
    ):
        off = got - np.array(expected)
        k = int(np.argmax(np.abs(off)))
        validation(
            case=f"Lambert, Vallado's example: {name}, worst coordinate",
            source="Vallado, 4th ed., example 7-5 (printed to 1 mm/s)",
            expected=expected[k],
            got=got[k],
            tolerance=1e-3,  # one of the last digit printed; his positions are rounded too
            unit="m/s",
        )


def test_curtis_example(validation):
    # Curtis, Orbital Mechanics for Engineering Students, example 5.2, GM = 398600 km^3/s^2, printed to 5 digits
    start, end = np.array([5000e3, 10000e3, 2100e3]), np.array([-14600e3, 2500e3, 7000e3])
    orbit = solve_lambert(start, end, 3600.0, gm_m3_s2=3.986e14)
    for name, got, expected in [
        ("departure", orbit.departure_m_s, (-5992.5, 1925.4, 3245.6)),
        ("arrival", orbit.arrival_m_s, (-3312.5, -4196.6, -385.29)),
    ]:
        k = int(np.argmax(np.abs(got - np.array(expected))))
        validation(
            case=f"Lambert, Curtis' example: {name}, worst coordinate",
            source="Curtis, example 5.2 (printed to 0.1 m/s)",
            expected=expected[k],
            got=got[k],
            tolerance=0.1,
            unit="m/s",
        )


# lamberthub 1.0.0, gooding1990 (another algorithm than ours), atol = rtol = 1e-13: revolutions, way, velocities
OTHERS = [
    (0, "short", [7236.627976547, 3826.027909905, 4520.816753768], [-1498.061100811, -7381.430869154, -3454.139110795]),
    (0, "long", [2350.659428157, -8739.769131717, -2346.564791851], [7659.065240101, -1928.566260844, 2500.12198618]),
    (1, "short", [-2257.023110807, 8682.830642434, 2364.380664555], [-7591.591493531, 1838.058639223, -2506.193093932]),
    (1, "short", [6375.134413913, 4195.651399573, 4297.959170605], [-1992.994103005, -6541.474396277, -3342.319149593]),
    (1, "long", [-7132.342442645, -3870.097754016, -4493.58187703], [1557.423904786, 7279.720777125, 3440.358585002]),
    (1, "long", [1533.918573526, -8249.102307938, -2504.247988207], [7075.404843081, -1138.834456304, 2555.246177228]),
    (3, "short", [-274.512421825, 7519.200058909, 2757.598258169], [-6197.194184848, -80.178823692, -2649.935455011]),
    (3, "short", [4451.735806032, 5068.588534278, 3818.631049582], [-3136.923385014, -4668.40202357, -3109.975290473]),
    (3, "long", [-5046.451902358, -4791.408826284, -3964.062383446], [2777.289926402, 5247.215704853, 3179.179376794]),
    (3, "long", [-323.726420653, -7183.91418393, -2882.311994273], [5789.356151124, 659.767523501, 2699.061684239]),
]


def test_all_orbits_are_anothers(validation):
    start, end = np.array([7.0e6, -1.2e6, 2.5e6]), np.array([-3.1e6, 8.4e6, 1.9e6])
    orbits = solve_lambert_all(start, end, 30_000.0)
    worst = 0.0
    for revolutions, way, departure, arrival in OTHERS:
        off = min(
            max(np.abs(orbit.departure_m_s - departure).max(), np.abs(orbit.arrival_m_s - arrival).max())
            for orbit in orbits
            if (orbit.revolutions, orbit.way) == (revolutions, way)
        )
        worst = max(worst, off)
    validation(
        case=f"Lambert, {len(OTHERS)} orbits of 0, 1 and 3 revolutions, both ways and branches: worst coordinate",
        source="lamberthub 1.0.0, Gooding's algorithm (numbers kept, to 1 nm/s)",
        expected=0.0,
        got=worst,
        tolerance=2e-9,  # his stopping, and the last digit kept
        unit="m/s",
    )


@pytest.mark.parametrize(
    ("eccentricity", "revolutions", "duration_s"), [(0.0, 0, 3300.0), (0.3, 0, 4000.0), (0.0, 1, 8000.0)]
)
def test_lambert_transfer_arrives_by_integration(validation, eccentricity, revolutions, duration_s):
    chief = State(**_high(eccentricity))
    part = rpo.Lambert(
        **CHIEF,
        from_m=(-2000.0, -30_000.0, 500.0),
        to_m=(0.0, -100.0, 0.0),
        velocity_m_s=(0.0, 3.0, 0.0),
        duration_s=duration_s,
        revolutions=revolutions,
    )
    plan = part.plan(START, chief)
    departure, velocity = part.relative(Epochs(START, np.zeros(1)), chief)
    np.testing.assert_allclose(departure[0], part.from_m, rtol=0, atol=1e-6)
    np.testing.assert_allclose(velocity[0], part.velocity_m_s + plan.impulses[0].delta_v_m_s, rtol=0, atol=1e-9)
    at = _at_start(chief)
    axes, omega = rtn_axes(*at)
    turn = axes.as_matrix()
    flown = two_bodies(
        at[0] + turn @ departure[0], at[1] + turn @ (velocity[0] + np.cross(omega, departure[0])), duration_s
    )
    body = two_bodies(*at, duration_s)
    axes, omega = rtn_axes(body[:3], body[3:])
    place = axes.as_matrix().T @ (flown[:3] - body[:3])
    speed = axes.as_matrix().T @ (flown[3:] - body[3:]) - np.cross(omega, place)
    np.testing.assert_allclose(speed, -plan.impulses[1].delta_v_m_s, rtol=0, atol=1e-6)
    validation(
        case=f"Lambert from 30 km to 100 m, e = {eccentricity:g}, {revolutions} revolutions: miss at arrival",
        source="two bodies, integrated (DOP853)",
        expected=0.0,
        got=np.linalg.norm(place - np.array(part.to_m)),
        tolerance=1e-3,  # what is left of the integrator's 1e-13 a step over some thousand
        unit="m",
    )


def _high(eccentricity):
    perigee = 7_000e3
    speed = math.sqrt(GM * (1.0 + eccentricity) / perigee)
    return {"epoch_utc": START, "position_m": (perigee, 0.0, 0.0), "velocity_m_s": (0.0, 0.6 * speed, 0.8 * speed)}


def _at_start(chief):
    return np.array(chief.position_m), np.array(chief.velocity_m_s)
