"""What a user describes, joined: Time, World, Target, Follower, Lidar, Scenario."""

from rso_lidar.scenario.constraints import Constraints, Corridor
from rso_lidar.scenario.finishes import FacetMaterials
from rso_lidar.scenario.hinges import Joint
from rso_lidar.scenario.lidar import Lidar, Schedule
from rso_lidar.scenario.parts import Follower, Target, Time, World
from rso_lidar.scenario.scenario import Scenario

__all__ = [
    "Constraints",
    "Corridor",
    "FacetMaterials",
    "Follower",
    "Joint",
    "Lidar",
    "Scenario",
    "Schedule",
    "Target",
    "Time",
    "World",
]
