"""The names under which `gymnasium.make` and `gymnasium.make_vec` find the environments."""

from __future__ import annotations

import importlib
from functools import partial
from typing import TYPE_CHECKING, Any

import gymnasium

if TYPE_CHECKING:
    from rso_lidar.loop.environments.vector_environment import LidarVectorEnvironment

ENVIRONMENTS = {
    "rso_lidar/PointAndTrack-v0": "rso_lidar.loop.environments.point_and_track:PointAndTrack",
    "rso_lidar/Approach-v0": "rso_lidar.loop.environments.approach:Approach",
}


def register_environments() -> None:
    """Register the environments that Gymnasium does not know yet."""
    for name, entry_point in ENVIRONMENTS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                name, entry_point=entry_point, vector_entry_point=partial(_make_vector, entry_point=entry_point)
            )


def _make_vector(num_envs: int = 1, *, entry_point: str, **settings: Any) -> LidarVectorEnvironment:
    """Make environments that share one process.

    Parameters
    ----------
    entry_point : of one environment, ``module:class``
    settings : arguments of `LidarVectorEnvironment`
    """
    from rso_lidar.loop.environments.vector_environment import LidarVectorEnvironment

    module, name = entry_point.split(":")
    return LidarVectorEnvironment(getattr(importlib.import_module(module), name), num_envs, **settings)
