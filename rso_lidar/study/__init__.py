"""Questions asked of scenarios and recordings: how far, when, which is best, how well tracked, what it looks like."""

from rso_lidar.study.budget import Budget, Curve, budget
from rso_lidar.study.encounter_scenario import scenario_text
from rso_lidar.study.encounters import Encounters, encounters
from rso_lidar.study.sighting import Encounter, reach_m

__all__ = ["Budget", "Curve", "Encounter", "Encounters", "budget", "encounters", "reach_m", "scenario_text"]
