"""Insertion onto ellipses: the cheapest phase and duration, against bounds of theory and against other choices."""

import math

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.rpo import clohessy_wiltshire
from rso_lidar.rpo.plans.two_impulse import solve_departure_m_s
from tests.rpo.sequences.test_sequence import REVOLUTION, N, plan

PERCH = {"type": "perch", "along_track_m": -200.0, "duration_s": 600.0}
ROUND = {"type": "circumnavigation", "radial_m": 100.0, "duration_s": 600.0}
SAFE = {
    "type": "safety_ellipse", "radial_m": 80.0, "cross_track_m": 60.0, "drift_m": 40.0, "center_along_track_m": -400.0,
    "duration_s": 600.0,
}  # fmt: skip


def test_insertion_costs_no_more_than_one_radial_impulse_and_no_less_than_theory():
    """From rest 2 b behind the centre a radial impulse n b is enough (Fehse ch. 3); n b / 2 is the least (D'Amico 2010)."""
    cost = plan(PERCH, ROUND).delta_v_m_s
    assert 0.5 * N * 100.0 <= cost * (1.0 + 1e-9)
    assert cost <= N * 100.0


def test_insertion_onto_a_safety_ellipse_is_cheaper_than_other_choices():
    best = plan(PERCH, SAFE)
    cost = best.parts[1].delta_v_m_s
    # D'Amico 2010, sec. 2.2: along the track n a de / 2, across it n a di
    assert cost >= math.hypot(0.5 * N * 80.0, N * 60.0) * (1.0 - 1e-9)
    rng = np.random.default_rng(4)
    choices = [(rng.uniform(0.0, 360.0), rng.uniform(0.05, 0.95) * REVOLUTION) for _ in range(300)]
    others = [
        plan(PERCH, SAFE | {"phase_deg": phase, "transfer_s": took_s}).parts[1].delta_v_m_s for phase, took_s in choices
    ]
    assert cost <= min(others)


def test_after_insertion_the_ellipse_is_flown():
    best = plan(PERCH, SAFE | {"duration_s": 3.0 * REVOLUTION})
    times = np.linspace(best.parts[1].arrival_s, best.duration_s, 2000)
    position, _ = best.relative(times)
    height = -40.0 / (3.0 * math.pi)
    assert position[:, 0].max() == pytest.approx(height + 80.0, abs=1e-3)
    assert position[:, 0].min() == pytest.approx(height - 80.0, abs=1e-3)
    assert np.abs(position[:, 2]).max() == pytest.approx(60.0, abs=1e-3)
    assert best.passive_safety_m() == pytest.approx(best.passive_safety_m(4.0 * REVOLUTION), rel=0.5)


def test_insertion_keeps_out_of_the_sphere():
    free = plan(PERCH | {"along_track_m": -300.0}, ROUND)
    nearest = free.nearest_m
    kept = plan(PERCH | {"along_track_m": -300.0}, ROUND, keep_out_m=min(99.0, nearest + 20.0))
    assert kept.delta_v_m_s >= free.delta_v_m_s * (1.0 - 1e-9)
    with pytest.raises(ScenarioError, match=r"legs\[1\]: keep_out_m"):
        plan(PERCH | {"along_track_m": -300.0}, ROUND, keep_out_m=150.0)


def test_the_stated_duration_of_a_transfer_is_kept():
    part = plan(PERCH, SAFE | {"transfer_s": 1234.5}).parts[1]
    assert part.arrival_s - part.begin_s == pytest.approx(1234.5)


def test_many_transfers_at_once_are_those_of_one_at_a_time():
    from rso_lidar.rpo.sequences.leg_transfer import solve_departures_m_s

    rng = np.random.default_rng(2)
    starts, aims = rng.normal(scale=300.0, size=(2, 20, 3))
    durations_s = rng.uniform(0.05, 0.45, 20) * REVOLUTION
    departure, arrival = solve_departures_m_s(starts, aims, durations_s, N)
    for k in range(20):
        np.testing.assert_allclose(departure[k], solve_departure_m_s(starts[k], aims[k], durations_s[k], N), rtol=1e-9)
        there, speed = clohessy_wiltshire(starts[k], departure[k], durations_s[k], N)
        np.testing.assert_allclose(there, aims[k], rtol=0, atol=1e-8)
        np.testing.assert_allclose(speed, arrival[k], rtol=1e-12)
