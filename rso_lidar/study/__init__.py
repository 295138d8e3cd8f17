"""Questions asked of scenarios and recordings: how far, when, which is best, how well tracked, what it looks like."""

from rso_lidar.study.budgets.range_budget import Budget, Curve, budget
from rso_lidar.study.passes.pass_geometry import Encounter, reach_m
from rso_lidar.study.passes.scenario_text import scenario_text
from rso_lidar.study.passes.search import Encounters, encounters

__all__ = ["Budget", "Curve", "Encounter", "Encounters", "budget", "encounters", "reach_m", "scenario_text"]
