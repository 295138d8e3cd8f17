"""Targeting against closed forms: Clohessy and Wiltshire, Hohmann, Lambert, and grids of them."""

from datetime import UTC, datetime

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rso_lidar.orbit import Epochs, sun_position_m
from rso_lidar.study import solve_targeter
from tests.study.targeting.targeting_for_tests import (
    ARRIVAL,
    EARTH_GM_KM3_S2,
    HOLD,
    IMPULSES,
    RADIUS_KM,
    RATE_RAD_S,
    circle,
    clohessy_wiltshire,
    rendezvous,
    scenario,
    state,
    two_impulses_m_s,
    variable,
    write,
)

LEAST = 'minimize = "delta_v_m_s"'
TIME = variable("1.at_s", 1000, 5000)
# The linear closed form leaves out terms of rho / r = 1.5e-5 of the path's 100 m, some mm over an orbit, or 1e-5 m/s.
LINEAR_M_S = 2e-5


def test_the_corrector_reaches_a_hold_with_the_impulses_of_clohessy_and_wiltshire(tmp_path):
    plan = solve_targeter(write(tmp_path, rendezvous(), IMPULSES + HOLD))
    assert np.allclose(np.reshape(plan.values, (2, 3)), two_impulses_m_s(3600.0), rtol=0.0, atol=LINEAR_M_S)
    assert np.abs(plan.flown[:3] - (0.0, -30.0, 0.0)).max() < 0.001 and np.abs(plan.flown[3:]).max() < 1e-5


def test_the_least_delta_v_over_the_time_of_flight_is_that_of_a_grid(tmp_path):
    plan = solve_targeter(write(tmp_path, rendezvous(), IMPULSES + TIME + HOLD, LEAST))
    times_s = np.arange(1000.0, 5000.0, 1.0)
    grid = [np.linalg.norm(two_impulses_m_s(time_s), axis=1).sum() for time_s in times_s]
    assert plan.flown[-1] == pytest.approx(min(grid), abs=LINEAR_M_S)
    # The cost is flat at its least: within 1e-5 m/s over 20 s.
    assert plan.values[-1] == pytest.approx(times_s[np.argmin(grid)], abs=20.0)


@pytest.mark.slow
def test_least_delta_v_between_circles_is_that_of_hohmann(tmp_path):
    high_km = 7578.137
    motion = f'type = "numerical"\ninitial = {circle(anomaly_deg=0)}\nforces = {{ zonal_degree = 0 }}'
    pushes = [(0.0, (50.0, 150.0, 0.0), "rtn"), (2600.0, (-40.0, 150.0, 0.0), "rtn")]
    variables = "".join(variable(f"{k}.delta_v_m_s.{axis}", -400, 400) for k in (0, 1) for axis in (0, 1))
    goals = "".join(
        f'[[goal]]\nquantity = "{name}"\nequals = {value}\n{ARRIVAL}'
        for name, value in (("radius_km", high_km), ("semi_major_axis_km", high_km), ("flight_path_angle_deg", 0.0))
    )
    file = write(
        tmp_path,
        scenario(circle(high_km), motion, pushes, 4000),
        variables + variable("1.at_s", 2000, 3500) + goals,
        LEAST,
    )
    plan = solve_targeter(file)
    middle_km = (RADIUS_KM + high_km) / 2.0
    low_m_s, high_m_s = (1e3 * np.sqrt(EARTH_GM_KM3_S2 / r_km) for r_km in (RADIUS_KM, high_km))
    first = low_m_s * (np.sqrt(high_km / middle_km) - 1.0)
    second = high_m_s * (1.0 - np.sqrt(RADIUS_KM / middle_km))
    # A meter of radius, the tolerance of the goals, is worth n / 2 = 0.0006 m/s.
    assert plan.flown[-1] == pytest.approx(first + second, abs=6e-4)
    assert np.allclose(plan.values[:4], (0.0, first, 0.0, second), rtol=0.0, atol=0.02)
    assert plan.values[4] == pytest.approx(np.pi * np.sqrt(middle_km**3 / EARTH_GM_KM3_S2), abs=1.0)


@pytest.mark.slow
def test_three_impulses_over_a_far_apogee_cost_what_the_bielliptic_transfer_says_and_less_than_hohmann(tmp_path):
    """From 6,978 km to 16 times that: above a ratio of 15.58 any apogee beyond the goal costs less than Hohmann."""
    high_km, far_km = 16.0 * RADIUS_KM, 32.0 * RADIUS_KM
    up_km, down_km = (RADIUS_KM + far_km) / 2.0, (high_km + far_km) / 2.0

    def speed_m_s(radius_km, semi_major_axis_km):
        return 1e3 * np.sqrt(EARTH_GM_KM3_S2 * (2.0 / radius_km - 1.0 / semi_major_axis_km))

    pushes_m_s = (
        speed_m_s(RADIUS_KM, up_km) - speed_m_s(RADIUS_KM, RADIUS_KM),
        speed_m_s(far_km, down_km) - speed_m_s(far_km, up_km),
        speed_m_s(high_km, high_km) - speed_m_s(high_km, down_km),
    )
    half_turns_s = np.pi * np.sqrt(np.array([up_km, down_km]) ** 3 / EARTH_GM_KM3_S2)
    apogee_s, end_s = np.cumsum(half_turns_s)
    motion = f'type = "numerical"\ninitial = {circle(anomaly_deg=0)}\nforces = {{ zonal_degree = 0 }}'
    pushes = [
        (at_s, (0.0, round(float(push)), 0.0), "rtn")
        for at_s, push in zip((0.0, round(apogee_s) + 60.0, round(end_s) - 60.0), pushes_m_s, strict=True)
    ]
    variables = "".join(variable(f"{k}.delta_v_m_s.1", -4000, 4000) for k in range(3))
    variables += variable("1.at_s", 0.9 * apogee_s, 1.1 * apogee_s) + variable("2.at_s", 0.9 * end_s, 1.05 * end_s)
    goals = "".join(
        f'[[goal]]\nquantity = "{name}"\nequals = {value}\nat_s = "follower.motion.maneuvers.{k}.at_s"\n'
        for k, name, value in (
            (1, "radius_km", far_km),
            (1, "flight_path_angle_deg", 0.0),
            (2, "radius_km", high_km),
            (2, "flight_path_angle_deg", 0.0),
            (2, "semi_major_axis_km", high_km),
        )
    )
    plan = solve_targeter(write(tmp_path, scenario(circle(high_km), motion, pushes, 1.1 * end_s), variables + goals))
    # The tolerances of the goals, 1 m and 0.01 deg, are worth 0.0002 m/s or less.
    assert np.allclose(plan.values[:3], pushes_m_s, rtol=0.0, atol=1e-3)
    hohmann_km = (RADIUS_KM + high_km) / 2.0
    hohmann_m_s = speed_m_s(RADIUS_KM, hohmann_km) - speed_m_s(RADIUS_KM, RADIUS_KM)
    hohmann_m_s += speed_m_s(high_km, high_km) - speed_m_s(high_km, hohmann_km)
    assert np.sum(np.abs(plan.values[:3])) < hohmann_m_s - 1.0


def test_an_arc_of_given_time_is_that_of_lambert(tmp_path):
    # Vallado, Fundamentals of Astrodynamics and Applications, example 7-5: 76 minutes between two places.
    first_km, second_km, time_s = (15945.34, 0.0, 0.0), (12214.83899, 10249.46731, 0.0), 4560.0
    away_km_s, arrival_km_s = (2.058913, 2.915965, 0.0), (-3.451565, 0.910315, 0.0)
    motion = f'type = "numerical"\ninitial = {state(first_km, (1.5, 3.5, 0.2))}\nforces = {{ zonal_degree = 0 }}'
    # The target passes the second place at the end: it flies back from there, by symmetry in time.
    back = _fly_back(second_km, (-4.0, 2.0, 1.0), time_s)
    text = scenario(state(*back), motion, [(0.0, (0.0, 0.0, 0.0), "inertial")], time_s)
    variables = "".join(variable(f"0.delta_v_m_s.{axis}", -2000, 2000) for axis in range(3))
    goal = '[[goal]]\nquantity = "position_m"\nequals = [0, 0, 0]\n'
    plan = solve_targeter(write(tmp_path, text, variables + goal))
    departure_km_s = np.add((1.5, 3.5, 0.2), np.divide(plan.values, 1000.0))
    assert np.allclose(departure_km_s, away_km_s, rtol=0.0, atol=2e-6)  # its last printed digit, and that of the places
    assert np.linalg.norm(arrival_km_s) == pytest.approx(
        np.sqrt(
            np.dot(departure_km_s, departure_km_s)
            + 2 * EARTH_GM_KM3_S2 * (1 / np.linalg.norm(second_km) - 1 / np.linalg.norm(first_km))
        ),
        abs=2e-6,
    )


def _fly_back(position_km, velocity_km_s, time_s):
    """Return the state a time before, by scipy's integrator."""

    def pull(_, y):
        return [*y[3:], *(-EARTH_GM_KM3_S2 * y[:3] / np.linalg.norm(y[:3]) ** 3)]

    flown = solve_ivp(pull, (0.0, -time_s), [*position_km, *velocity_km_s], method="DOP853", rtol=1e-12, atol=1e-12)
    return flown.y[:3, -1].tolist(), flown.y[3:, -1].tolist()


@pytest.mark.slow
def test_an_active_bound_on_the_light_at_arrival_costs_what_a_grid_says(tmp_path):
    limit = f'[[limit]]\nquantity = "phase_angle_deg"\nat_most = 84.5\n{ARRIVAL}'
    plan = solve_targeter(write(tmp_path, rendezvous(), IMPULSES + TIME + HOLD + limit, LEAST))
    times_s = np.arange(1000.0, 5000.0, 1.0)
    grid = np.array([np.linalg.norm(two_impulses_m_s(time_s), axis=1).sum() for time_s in times_s])
    lit = _phase_deg(times_s) <= 84.5
    assert not lit[np.argmin(grid)]  # the bound changes the plan
    best = int(np.argmin(np.where(lit, grid, np.inf)))
    assert plan.flown[-1] == pytest.approx(grid[best], abs=LINEAR_M_S)
    assert plan.flown[-2] == pytest.approx(84.5, abs=0.01)
    assert plan.values[-1] == pytest.approx(times_s[best], abs=1.0)
    assert plan.active == ("limit[0] phase_angle_deg <= 84.5",)


def _phase_deg(times_s):
    """Return the angle at the target between the Sun and the hold behind it, by spherical geometry."""
    tilt, node, place = np.deg2rad(97.4), np.deg2rad(80.0), np.deg2rad(120.0) + RATE_RAD_S * times_s
    along = np.stack(
        [
            -np.cos(node) * np.sin(place) - np.sin(node) * np.cos(place) * np.cos(tilt),
            -np.sin(node) * np.sin(place) + np.cos(node) * np.cos(place) * np.cos(tilt),
            np.cos(place) * np.sin(tilt),
        ],
        axis=-1,
    )
    sun = sun_position_m(Epochs(datetime(2024, 9, 17, 12, tzinfo=UTC), times_s))
    return np.rad2deg(np.arccos(-np.sum(along * sun, axis=-1) / np.linalg.norm(sun, axis=-1)))


@pytest.mark.slow
def test_an_active_keep_out_costs_what_a_grid_says(tmp_path):
    text = rendezvous().replace("[20.0, -100.0, 10.0]", "[0.0, -100.0, 0.0]")
    hold = HOLD.replace("[0.0, -30.0, 0.0]", "[0, 100, 0]")
    limit = '[[limit]]\nquantity = "range_m"\nat_least = 48\n'
    plan = solve_targeter(write(tmp_path, text, IMPULSES + TIME + hold + limit, LEAST))
    costs, ranges_m = [], []
    times_s = np.arange(1000.0, 5000.0, 5.0)
    for time_s in times_s:
        pushes = two_impulses_m_s(time_s, (0.0, -100.0, 0.0), (0.0, 100.0, 0.0))
        costs.append(np.linalg.norm(pushes, axis=1).sum())
        ranges_m.append(_least_range_m(pushes[0], time_s))
    free, kept = np.argmin(costs), np.argmin(np.where(np.array(ranges_m) >= 48.0, costs, np.inf))
    assert ranges_m[free] < 48.0
    assert plan.flown[-1] == pytest.approx(costs[kept], rel=2e-3)


def _least_range_m(push_m_s, time_s):
    path = []
    for at_s in np.linspace(0.0, time_s, 61):
        rr, rv, _, _ = clohessy_wiltshire(at_s)
        path.append(rr @ (0.0, -100.0, 0.0) + rv @ push_m_s)
    return np.linalg.norm(path, axis=1).min()


def test_under_j2_and_drag_the_linear_plan_misses_by_metres_and_the_corrected_one_holds(tmp_path):
    low = circle().replace("eccentricity = 0.0", "eccentricity = 0.001")
    forces = "forces = { zonal_degree = 2, drag = { area_m2 = 10, mass_kg = 1000 } }"
    target = f'{{ type = "numerical", initial = {low}, {forces} }}'
    text = rendezvous(target=target).replace("[20.0, -100.0, 10.0]", "[0.0, -2000.0, 0.0]")
    linear = two_impulses_m_s(3600.0, (0.0, -2000.0, 0.0), (0.0, -30.0, 0.0)).ravel()
    variables = IMPULSES
    for value in linear:
        variables = variables.replace("high = 2\n", f"high = 2.0\ninitial = {float(value)}\n", 1)
    plan = solve_targeter(write(tmp_path, text, variables + HOLD))
    assert np.linalg.norm(plan.start_flown[:3] - (0.0, -30.0, 0.0)) > 5.0
    assert np.linalg.norm(plan.flown[:3] - (0.0, -30.0, 0.0)) < 0.01 and np.abs(plan.flown[3:]).max() < 1e-4
