"""The whole walk: one flash, a scenario flown step by step, and a run of all its flashes."""

from rso_lidar.public_names import limit_dir
from rso_lidar.simulation.flash import flash
from rso_lidar.simulation.run import simulate
from rso_lidar.simulation.state import SimulationState
from rso_lidar.simulation.stepping import Moment, Simulation

__all__ = ["Moment", "Simulation", "SimulationState", "flash", "simulate"]

__dir__ = limit_dir(__name__)
