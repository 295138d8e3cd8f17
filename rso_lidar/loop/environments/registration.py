"""The names under which `gymnasium.make` finds the environments."""

import gymnasium

ENVIRONMENTS = {
    "rso_lidar/PointAndTrack-v0": "rso_lidar.loop.environments.point_and_track:PointAndTrack",
    "rso_lidar/Approach-v0": "rso_lidar.loop.environments.approach:Approach",
}


def register_environments() -> None:
    """Register the environments that Gymnasium does not know yet."""
    for name, entry_point in ENVIRONMENTS.items():
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point=entry_point)
