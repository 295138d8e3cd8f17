"""Functional Mock-up Units (FMI 2 and 3): their description, units and steps, in a process of their own."""

from rso_lidar.fmi.fmu_model import FmuModel
from rso_lidar.fmi.run import FmuPoint, FmuRun
from rso_lidar.public_names import limit_dir

__all__ = ["FmuModel", "FmuPoint", "FmuRun"]

__dir__ = limit_dir(__name__)
