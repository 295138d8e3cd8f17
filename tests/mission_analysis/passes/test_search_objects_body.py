"""Bodies of scenarios as trajectories: plans and sequences against the scenario's truth, and in a search."""

import datetime

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import motion
from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.mission_analysis.passes.search_objects import BodyTrajectory
from rso_lidar.orbit import Epochs, screen
from rso_lidar.shipped import shipped


@pytest.fixture(
    scope="module", params=[pytest.param("geo_servicer", marks=pytest.mark.slow), "safety_ellipse", "tdrs_approach"]
)
def scenario(request):
    return rl.Scenario.load(shipped(f"examples/{request.param}.toml"))


def test_states_are_those_of_the_truth_at_any_start(scenario):
    start = scenario.time.start_utc
    time_s = np.linspace(0.0, 0.9 * scenario.time.duration_s, 7)
    truth = motion.truth(scenario.bodies, Epochs(start, time_s)).states
    later = start + datetime.timedelta(seconds=60)
    for body in scenario.bodies:
        found = BodyTrajectory(scenario, body.name).states(Epochs(later, time_s - 60.0))
        assert found.position_m == pytest.approx(truth[body.name].position_m, abs=1e-3)


def test_a_search_finds_what_a_fine_grid_of_the_truth_does(scenario):
    start, span_s = scenario.time.start_utc, min(scenario.time.duration_s, 20_000.0)
    target = scenario.target[0].name
    one, other = (BodyTrajectory(scenario, name) for name in ("follower", target))
    time_s = np.arange(0.5, span_s - 0.5, max(span_s / 4000.0, 1.0))
    truth = motion.truth(scenario.bodies, Epochs(start, time_s)).states
    range_m = np.linalg.norm(truth[target].position_m - truth["follower"].position_m, axis=1)
    within_m = float(np.quantile(range_m, 0.4))  # inside and outside in turn
    found = screen(one, [other], start, span_s, within_m)
    inside = np.zeros(len(time_s), dtype=bool)
    for stay in found.approaches:
        inside |= (time_s >= stay.enter_s) & (time_s <= stay.leave_s)
    clear = np.abs(range_m - within_m) > 0.5
    assert np.array_equal(inside[clear], (range_m <= within_m)[clear])
    assert min(stay.range_m for stay in found.approaches) <= range_m.min() + 1e-3


def test_it_begins_with_the_scenario(scenario):
    body = BodyTrajectory(scenario, "follower")
    with pytest.raises(PropagationError, match="begin the search then") as told:
        body.states(Epochs(scenario.time.start_utc, np.array([-10.0, 0.0])))
    assert told.value.bad.tolist() == [True, False]
    shifted = Epochs(scenario.time.start_utc - datetime.timedelta(seconds=100), np.array([0.0, 1000.0]))
    assert 100.0 in body.breaks_s(shifted)


def test_bodies_that_are_not_there_or_not_in_orbit():
    bench = rl.Scenario.load(shipped("examples/bench_plate.toml"))
    with pytest.raises(ScenarioError, match="is not in orbit about the Earth; take a scenario"):
        BodyTrajectory(bench, "follower")
    with pytest.raises(ScenarioError, match=r"no body named 'moon' \(known: "):
        BodyTrajectory(bench, "moon")
