"""What a user describes, joined: Time, World, Target, Follower, Lidar, Scenario."""

from rso_lidar.scenario.constraints import Constraints, Corridor
from rso_lidar.scenario.finishes import FacetMaterials
from rso_lidar.scenario.hinges import Joint
from rso_lidar.scenario.lidar import Lidar, Schedule
from rso_lidar.scenario.parts import Follower, Target, Time, World
from rso_lidar.scenario.scenario import Scenario, need_scenario
from rso_lidar.scenario.terrain import CratersAndBoulders, HeightField

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
