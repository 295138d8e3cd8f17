"""Parametric builders of the shipped models; `python -m rso_lidar.shapes.write` writes models/."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.shapes.breakup import breakup_fragment, hash_solid
    from rso_lidar.shapes.build import build, builders
    from rso_lidar.shapes.cubesat import cubesat
    from rso_lidar.shapes.fragment import fragment
    from rso_lidar.shapes.materials import MATERIALS
    from rso_lidar.shapes.model import CraftModel, CraftPart
    from rso_lidar.shapes.solids import Solid
    from rso_lidar.shapes.terrain import Abundance, build_ground
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "MATERIALS",
    "Abundance",
    "CraftModel",
    "CraftPart",
    "Solid",
    "breakup_fragment",
    "build",
    "build_ground",
    "builders",
    "cubesat",
    "fragment",
    "hash_solid",
]

__dir__ = limit_dir(__name__)
