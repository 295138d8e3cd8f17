"""Many scenarios asked one question."""

from rso_lidar.study.encounter_scenario import scenario_text
from rso_lidar.study.encounters import Encounters, encounters
from rso_lidar.study.sighting import Encounter, reach_m

__all__ = ["Encounter", "Encounters", "encounters", "reach_m", "scenario_text"]
