"""Parametric builders of the shipped models; `python -m rso_lidar.shapes.write` writes models/."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir
from rso_lidar.shapes.build import build, builders
from rso_lidar.shapes.cubesat import cubesat
from rso_lidar.shapes.fragment import fragment

if TYPE_CHECKING:
    from rso_lidar.shapes.breakup import breakup_fragment
    from rso_lidar.shapes.materials import MATERIALS
    from rso_lidar.shapes.model import CraftModel, CraftPart
    from rso_lidar.shapes.solids import Solid

__all__ = [
    "MATERIALS",
    "CraftModel",
    "CraftPart",
    "Solid",
    "breakup_fragment",
    "build",
    "builders",
    "cubesat",
    "fragment",
]

__getattr__ = export_lazily(__name__)
__dir__ = limit_dir(__name__)
