"""What a user describes, joined: Time, World, Target, Follower, Lidar, Scenario."""

from rso_lidar.scenario.parts import Follower, Lidar, Target, Time, World
from rso_lidar.scenario.scenario import Scenario

__all__ = ["Follower", "Lidar", "Scenario", "Target", "Time", "World"]
