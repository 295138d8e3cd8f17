"""Holds without continuous thrust: what they cost and how far they stray."""

import math

import numpy as np
import pytest

from rso_lidar import rpo
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs
from tests.rpo.plans.test_operation import REVOLUTION, START, C, N, station


@pytest.mark.parametrize("place", [(50.0, -100.0, 0.0), (0.0, -100.0, 40.0), (-30.0, 20.0, 10.0)])
@pytest.mark.parametrize("arc_m", [0.5, 5.0])
def test_pulses_keep_the_craft_within_the_arc(place, arc_m):
    plan = rpo.PulsedStationKeeping(**C, position_m=place, arc_m=arc_m).make_plan(N)
    position, _ = plan.relative(np.linspace(0.0, plan.duration_s, 8001))
    strayed = np.linalg.norm(position - np.array(place), axis=1).max()
    arcs = len(plan.impulses) - 1
    assert strayed <= arc_m * (1.0 + 1e-6)
    assert (
        strayed >= arc_m * ((arcs - 1) / arcs) ** 2 * 0.99
    )  # one arc fewer would stray farther, by the square of time
    np.testing.assert_allclose(plan.relative(np.array([plan.duration_s + 100.0]))[0][0], place, rtol=0, atol=1e-9)


def test_short_arcs_cost_what_thrust_costs():
    """Fehse ch. 3: 3 n^2 |x| a second above or below, n^2 |z| across; longer arcs cost more or less by a few percent."""
    for place, rate in (((50.0, 0.0, 0.0), 3.0 * N * N * 50.0), ((0.0, 0.0, 40.0), N * N * 40.0)):
        plan = rpo.PulsedStationKeeping(**C, position_m=place, arc_m=0.01).make_plan(N)
        assert plan.delta_v_m_s == pytest.approx(rate * REVOLUTION, rel=2e-3)


def test_an_arc_strays_by_an_eighth_of_the_pull_times_time_squared():
    plan = rpo.PulsedStationKeeping(**C, position_m=(50.0, 0.0, 0.0), arc_m=0.1).make_plan(N)
    each_s = plan.impulses[1].time_s
    assert 3.0 * N * N * 50.0 * each_s**2 / 8.0 == pytest.approx(0.1, rel=0.02)


def test_on_the_v_bar_no_pulse_is_needed():
    plan = rpo.PulsedStationKeeping(**C, position_m=(0.0, -100.0, 0.0), arc_m=0.1).make_plan(N)
    assert plan.delta_v_m_s == pytest.approx(0.0, abs=1e-9)


def test_too_many_arcs_are_refused():
    part = rpo.PulsedStationKeeping(**C, position_m=(5000.0, 0.0, 0.0), arc_m=1e-4)
    with pytest.raises(ScenarioError, match=r"^arc_m: .* a plan has at most 1000; give a larger arc_m"):
        part.plan(START, station())


def test_a_perch_stays_and_two_bodies_agree():
    """The orbit bends off the V-bar by y^2 / 2 r, 0.7 mm at 100 m; at rest it drifts 12 pi of that in a revolution."""
    plan = rpo.Perch(**C, along_track_m=-100.0).plan(START, station())
    np.testing.assert_array_equal(plan.relative(np.array([0.0, 9999.0]))[0], [[0.0, -100.0, 0.0]] * 2)
    assert plan.delta_v_m_s == 0.0
    assert plan.passive_safety_m() == pytest.approx(100.0)
    at = Epochs(START, np.array([REVOLUTION]))
    free = rpo.Nonlinear(**C, position_m=(0.0, -100.0, 0.0), velocity_m_s=(0.0, 0.0, 0.0)).relative(at, station())[0][0]
    assert math.dist(free, (0.0, -100.0, 0.0)) == pytest.approx(12.0 * math.pi * 100.0**2 / (2.0 * 6.878e6), rel=0.01)


def test_waypoints_may_end_in_flight():
    fields = {"positions_m": ((0.0, -500.0, 0.0), (50.0, -200.0, 10.0), (0.0, -50.0, 0.0)), "speed_m_s": 0.3}
    held, flown = (rpo.Waypoints(**C, **fields, end_at_rest=rest).make_plan(N) for rest in (True, False))
    assert flown.delta_v_m_s == pytest.approx(held.delta_v_m_s - held.impulses[-1].size_m_s, rel=1e-12)
    times = np.array([held.duration_s - 1e-9, held.duration_s + 60.0])
    np.testing.assert_allclose(flown.relative(times)[0][0], (0.0, -50.0, 0.0), rtol=0, atol=1e-6)
    velocity = flown.relative(times)[1]
    np.testing.assert_allclose(velocity[0], -held.impulses[-1].delta_v_m_s, rtol=0, atol=1e-9)
    assert np.linalg.norm(flown.relative(times)[0][1] - (0.0, -50.0, 0.0)) > 10.0
