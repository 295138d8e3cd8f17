"""Plans: legs join, impulses and thrust add up, and the least distances are least."""

import math

import numpy as np
import pytest

from rso_lidar.rpo import Plan, PlannedImpulse, clohessy_wiltshire
from rso_lidar.rpo.plans.minimum_distance import find_closest_approach
from rso_lidar.rpo.plans.plan import make_coast, make_line
from rso_lidar.rpo.plans.two_impulse import solve_departure_m_s

N = 1.1e-3
REVOLUTION = math.tau / N


def hop(start=(0.0, -1000.0, 0.0), end=(0.0, -200.0, 0.0), duration_s=1800.0):
    start, end = np.array(start), np.array(end)
    departure = solve_departure_m_s(start, end, duration_s, N)
    leg = make_coast(0.0, start, departure, N)
    arrival = leg.path(np.array([duration_s]))[1][0]
    impulses = (PlannedImpulse(0.0, departure), PlannedImpulse(duration_s, -arrival))
    return Plan("hop", N, duration_s, (leg, make_line(duration_s, end)), impulses)


def test_legs_join_and_impulses_are_the_jumps():
    plan = hop()
    position, velocity = plan.relative(np.array([-0.0, 1800.0 - 1e-6, 1800.0, 4000.0]))
    np.testing.assert_allclose(position[1], position[2], atol=1e-5)
    np.testing.assert_allclose(velocity[2] - velocity[1], plan.impulses[1].delta_v_m_s, atol=1e-8)
    np.testing.assert_array_equal(position[3], [0.0, -200.0, 0.0])
    assert plan.impulsive_delta_v_m_s == pytest.approx(sum(impulse.size_m_s for impulse in plan.impulses))


def test_an_instant_has_the_same_bits_alone():
    plan = hop(start=(300.0, -1000.0, 50.0))
    times = np.linspace(0.0, 3000.0, 257)
    position, velocity = plan.relative(times)
    for k in (0, 3, 100, 153, 154, 256):
        alone = plan.relative(times[k : k + 1])
        np.testing.assert_array_equal(alone[0][0], position[k])
        np.testing.assert_array_equal(alone[1][0], velocity[k])


def test_control_is_what_an_integrator_needs_to_stay_on_the_line():
    from scipy.integrate import solve_ivp

    start, speed = np.array([80.0, -300.0, 40.0]), np.array([-0.05, 0.2, -0.03])
    plan = Plan("line", N, 900.0, (make_line(0.0, start, speed),))

    def slope(time_s, state):
        (x, _, z), (u, v, w) = state[:3], state[3:]
        pull = np.array([3 * N * N * x + 2 * N * v, -2 * N * u, -N * N * z])
        return np.concatenate([[u, v, w], pull + plan.control_m_s2(np.array([time_s]))[0]])

    end = solve_ivp(slope, (0.0, 900.0), [*start, *speed], rtol=1e-11, atol=1e-9).y[:, -1]
    np.testing.assert_allclose(end[:3], start + 900.0 * speed, rtol=0, atol=1e-5)
    np.testing.assert_allclose(end[3:], speed, rtol=0, atol=1e-8)


def test_thrust_adds_up():
    held = Plan("hold", N, 500.0, (make_line(0.0, np.array([10.0, 5.0, -20.0])),))
    # 3 n^2 |x| radially and n^2 |z| across, steadily
    expected = 500.0 * N * N * math.hypot(30.0, 20.0)
    assert held.continuous_delta_v_m_s == pytest.approx(expected, rel=1e-13)
    assert held.delta_v_m_s == held.continuous_delta_v_m_s
    assert held.thrust == ((0.0, 500.0, held.continuous_delta_v_m_s),)
    assert hop().continuous_delta_v_m_s == 0.0


def test_nearest_is_the_least_of_a_fine_scan():
    plan = hop(start=(150.0, -400.0, 30.0), end=(-100.0, 300.0, 0.0), duration_s=2500.0)
    position, _ = plan.relative(np.linspace(0.0, 2500.0, 250_001))
    distance = np.linalg.norm(position, axis=1)
    nearest_m, at_s = plan.nearest()
    assert nearest_m <= distance.min()
    # the scan's own step of 10 ms at below 2 m/s
    assert nearest_m == pytest.approx(distance.min(), abs=1e-4)
    assert at_s == pytest.approx(0.01 * np.argmin(distance), abs=0.02)


def test_closest_finds_a_sharp_pass_between_samples():
    def path(time_s):
        position = np.stack([5.0 * (time_s - 33.3), 0.0 * time_s + 0.25, 0.0 * time_s], axis=-1)
        return position, np.zeros_like(position)

    distance, at_s = find_closest_approach(path, 100.0, 0.0, 100.0, 20.0)
    assert distance == pytest.approx(0.25, abs=1e-9)
    assert at_s == pytest.approx(133.3, abs=1e-4)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("turns", "expected_s"), [(0.0, 100.0), (2.0, 125.0)], ids=["stands still", "comes as near four times"]
)
def test_of_equal_distances_the_first_counts(turns, expected_s, seed):
    """A leader is 200 m ahead, still or swinging by 50 m with minima at 25, 75, ... s. Rounding of 1e-12 is added."""
    rng = np.random.default_rng(seed)

    def path(time_s):
        ahead = 200.0 + (turns > 0.0) * 50.0 * np.cos(2.0 * np.pi * turns * time_s / 100.0)
        position = np.stack(
            [0.0 * time_s, ahead * (1.0 + 1e-12 * rng.uniform(-1.0, 1.0, len(time_s))), 0.0 * time_s], axis=-1
        )
        return position, np.zeros_like(position)

    distance, at_s = find_closest_approach(path, 100.0, 0.0, 200.0, 1.0)
    assert distance == pytest.approx(200.0 if turns == 0.0 else 150.0, rel=1e-11)
    assert at_s == pytest.approx(expected_s, abs=1e-3)


def test_passive_safety_is_the_least_of_all_failures():
    speed = 0.3
    start = np.array([0.0, -400.0, 0.0])
    plan = Plan("line", N, 1000.0, (make_line(0.0, start, np.array([0.0, speed, 0.0])),))
    safety = plan.passive_safety()
    assert safety.horizon_s == pytest.approx(2 * REVOLUTION)
    stops = np.linspace(0.0, 1000.0, 401)
    position, velocity = plan.relative(stops)
    away = clohessy_wiltshire(position[:, None], velocity[:, None], np.linspace(0.0, safety.horizon_s, 4001), N)[0]
    scanned = np.linalg.norm(away, axis=-1)
    stop = np.unravel_index(np.argmin(scanned), scanned.shape)[0]
    assert safety.distance_m <= scanned.min() + 1e-9
    # the scan is 2.5 s by 2.9 s coarse, at 0.3 and below 1.2 m/s
    assert safety.distance_m == pytest.approx(scanned.min(), abs=2.0)
    assert safety.failure_s == pytest.approx(stops[stop], abs=10.0)
    assert plan.passive_safety_m(safety.horizon_s) == safety.distance_m


def test_an_impulse_that_does_not_come_lets_the_leg_go_on():
    # a hop of half a revolution along the V-bar returns to it each half revolution: it comes back to where it began
    plan = hop(end=(0.0, -10.0, 0.0), duration_s=0.5 * REVOLUTION)
    assert plan.passive_safety_m() == pytest.approx(10.0, abs=1e-6)
    # one of 0.3 of a revolution flies on, through y = 0 at some height
    fast = hop(end=(0.0, -10.0, 0.0), duration_s=0.3 * REVOLUTION)
    safety = fast.passive_safety()
    assert safety.distance_m < 10.0
    assert safety.failure_s == fast.duration_s
    assert safety.nearest_s > fast.duration_s


def test_the_first_impulse_may_not_come():
    # at rest 100 m below without thrust: it drifts ahead by 12 pi x a revolution, and oscillates 7 x deep
    start = np.array([-100.0, -1500.0, 0.0])
    departure = solve_departure_m_s(start, np.array([-100.0, -4000.0, 0.0]), 2000.0, N)
    plan = Plan("away", N, 2000.0, (make_coast(0.0, start, departure, N),), (PlannedImpulse(0.0, departure),))
    drift = make_coast(0.0, start, np.zeros(3), N)
    expected = find_closest_approach(drift.path, 0.0, 0.0, 2 * REVOLUTION, 5.0)
    safety = plan.passive_safety()
    assert safety.failure_s == 0.0
    assert safety.distance_m == pytest.approx(expected[0], abs=1e-6)


def test_it_says_itself():
    plan = hop()
    rows = plan.table()
    assert rows[0][0] == "time_s"
    assert [row[1] for row in rows[1:]] == ["impulse", "impulse"]
    assert all(len(row) == len(rows[0]) for row in rows)
    text = plan.describe()
    assert text.startswith("hop: 1800.0 s, 0.315 revolutions")
    assert f"delta-v {plan.delta_v_m_s:.5f} m/s" in text
    assert "nearest as planned 200.00 m, at 1800.0 s" in text
    assert "passive safety" in text
    drift = Plan("drift", N, 100.0, (make_coast(0.0, np.array([0.0, 50.0, 0.0]), np.zeros(3), N),))
    assert "free drift after the plan" in drift.describe()
