"""The whole walk: one flash, a scenario flown step by step, and a run of all its flashes."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.simulation.laser_flash import flash, read_images
    from rso_lidar.simulation.normals import find_normals
    from rso_lidar.simulation.run import simulate
    from rso_lidar.simulation.state import SimulationState
    from rso_lidar.simulation.stepping import DETECTION, POINTING, Moment, Simulation
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "DETECTION",
    "POINTING",
    "Moment",
    "Simulation",
    "SimulationState",
    "find_normals",
    "flash",
    "read_images",
    "simulate",
]

__dir__ = limit_dir(__name__)
