"""Solids and the craft made of them: fragments of a break-up, ground with craters and boulders, and models as files."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.shapes.breakup import breakup_fragment, hash_solid
    from rso_lidar.shapes.gltf import glb
    from rso_lidar.shapes.model import CraftModel, CraftPart
    from rso_lidar.shapes.parametric_fragment import fragment
    from rso_lidar.shapes.solids import Point, Solid, join, pipe, skin
    from rso_lidar.shapes.terrain import Abundance, build_ground
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "Abundance",
    "CraftModel",
    "CraftPart",
    "Point",
    "Solid",
    "breakup_fragment",
    "build_ground",
    "fragment",
    "glb",
    "hash_solid",
    "join",
    "pipe",
    "skin",
]

__dir__ = limit_dir(__name__)
