"""Figures without noise: those of the studies that they come from."""

import math
from types import SimpleNamespace

import pytest

import rso_lidar as rl
from rso_lidar.study import Requirement
from rso_lidar.study.verification.figures import ComputedFigures


@pytest.fixture(scope="module")
def scenario():
    from tests.conftest import BENCH

    return rl.Scenario.loads(BENCH + '\n[lidar.detector]\ntype = "empirical"\n')


def compute(scenario, **fields):
    return ComputedFigures(scenario, 0).compute(Requirement(id="A", text="t", **fields))


def test_of_several_curves_the_worst_counts(scenario):
    target = scenario.target[0]
    two = scenario.replace(target=(target.replace(model="cubesat_3u", material=None),))
    curves = rl.budget(two, range_m=[400, 500, 600]).curves
    assert len(curves) == 2
    photons = sorted(float(curve.photons[1]) for curve in curves)
    ask = {"quantity": "budget.photons", "range_m": 500.0}
    assert compute(two, at_least=1.0, **ask) == pytest.approx(photons[0])
    assert compute(two, at_most=1.0, **ask) == pytest.approx(photons[1])
    assert compute(two, at_least=1.0, material="0.3", **ask) == pytest.approx(
        float(rl.budget(two, range_m=[400, 500, 600], materials=[0.3]).curves[0].photons[1])
    )


def test_a_range_that_no_one_has_is_0(scenario):
    dim = scenario.replace(lidar=scenario.lidar.replace(laser=scenario.lidar.laser.replace(energy_mj=1e-9)))
    assert compute(dim, quantity="budget.max_range_m", probability=0.9, at_least=100.0) == 0.0
    bright = compute(scenario, quantity="budget.max_range_m", probability=0.9, at_least=100.0)
    assert bright == pytest.approx(rl.budget(scenario, probability=0.9).curves[0].max_range_m)


def test_statistics_of_the_timeline_are_over_its_rows(scenario):
    table = rl.study.timeline(scenario).table
    for statistic, value in (("least", table["range_m"].min()), ("mean", table["range_m"].mean())):
        assert compute(scenario, quantity="timeline.range_m", statistic=statistic, at_least=1.0) == pytest.approx(value)


def test_the_range_at_which_a_body_is_found_is_that_of_the_study(scenario, monkeypatch):
    asked = []

    def find_range(*given, **more):
        asked.append((given[1], more["probability"], more["finding"]))
        return SimpleNamespace(max_range_m=812.0, worst_range_m=math.nan)

    monkeypatch.setattr("rso_lidar.study.verification.figures.find_range", find_range)
    figures = ComputedFigures(scenario, 0)
    for name, value in (("finding.max_range_m", 812.0), ("finding.worst_range_m", 0.0)):
        one = Requirement(id="A", text="t", quantity=name, probability=0.9, at_least=1.0)
        assert figures.compute(one) == value
    assert asked == [("plate", 0.9, scenario.finding)]  # once for both
