"""Functional Mock-up Units (FMI 2 and 3): their description, units and steps, in a process of their own."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.fmi.fmu_model import FmuModel
    from rso_lidar.fmi.run import FmuPoint, FmuRun
    from rso_lidar.fmi.unit_table import find_conversion
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "FmuModel",
    "FmuPoint",
    "FmuRun",
    "find_conversion",
]

__dir__ = limit_dir(__name__)
