"""What a user describes, joined: Time, World, Target, Follower, Lidar, Scenario."""

from rso_lidar.scenario.mission.mission import Scenario, need_scenario
from rso_lidar.scenario.tables.constraints import Constraints, Corridor
from rso_lidar.scenario.tables.facet_materials import FacetMaterials
from rso_lidar.scenario.tables.hinges import Joint
from rso_lidar.scenario.tables.lidar import Lidar, Schedule
from rso_lidar.scenario.tables.target import Follower, Target, Time, World
from rso_lidar.scenario.tables.terrain import CratersAndBoulders, HeightField

__all__ = [
    "Constraints",
    "Corridor",
    "CratersAndBoulders",
    "FacetMaterials",
    "Follower",
    "HeightField",
    "Joint",
    "Lidar",
    "Scenario",
    "Schedule",
    "Target",
    "Time",
    "World",
    "need_scenario",
]
