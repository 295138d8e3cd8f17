"""Environments of Gymnasium (extra ``gym``): a lidar that has to point at a stage, and one that has to approach it.

Importing this sub-room registers them, which ``gymnasium.make("rso_lidar.loop.environments:rso_lidar/PointAndTrack-v0")``
does by itself.
"""

from rso_lidar.loop.environments.approach import Approach
from rso_lidar.loop.environments.episodes import draw_approach, draw_pass
from rso_lidar.loop.environments.lidar_environment import LidarEnvironment
from rso_lidar.loop.environments.point_and_track import PointAndTrack
from rso_lidar.loop.environments.registration import register_environments
from rso_lidar.loop.environments.vector_environment import LidarVectorEnvironment
from rso_lidar.public_names import limit_dir

__all__ = [
    "Approach",
    "LidarEnvironment",
    "LidarVectorEnvironment",
    "PointAndTrack",
    "draw_approach",
    "draw_pass",
    "register_environments",
]

__dir__ = limit_dir(__name__)

register_environments()
