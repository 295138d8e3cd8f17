"""Targets and where rays meet them: meshes, materials, surfaces, casting and labels."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.scene.bounces.bounce import bounce
    from rso_lidar.scene.bounces.earthshine import add_earthshine
    from rso_lidar.scene.casting.cast import cast
    from rso_lidar.scene.casting.contours import contours
    from rso_lidar.scene.casting.extent import extent
    from rso_lidar.scene.casting.sky import find_hidden
    from rso_lidar.scene.labels import label
    from rso_lidar.scene.materials.choice import AnyMaterial, ByWavelength, Named, find_material
    from rso_lidar.scene.materials.crinkle import Crinkled
    from rso_lidar.scene.materials.lobe import Lobe
    from rso_lidar.scene.materials.measured_brdf import TableBrdf
    from rso_lidar.scene.materials.microfacet import Ggx, OrenNayar
    from rso_lidar.scene.materials.phong import Lambertian, Phong
    from rso_lidar.scene.materials.retro import RetroReflector
    from rso_lidar.scene.materials.scatterer import Material, Scatterer, complete
    from rso_lidar.scene.meshes.mesh import Mesh, load_mesh, warn_of_repairs, warn_of_size
    from rso_lidar.scene.meshes.symmetry_check import SymmetryDeviation, measure_symmetry
    from rso_lidar.scene.surfaces.articulation import Hinged, split_at_hinges
    from rso_lidar.scene.surfaces.surface import Surface, build_surface

__all__ = [
    "AnyMaterial",
    "ByWavelength",
    "Crinkled",
    "Ggx",
    "Hinged",
    "Lambertian",
    "Lobe",
    "Material",
    "Mesh",
    "Named",
    "OrenNayar",
    "Phong",
    "RetroReflector",
    "Scatterer",
    "Surface",
    "SymmetryDeviation",
    "TableBrdf",
    "add_earthshine",
    "bounce",
    "build_surface",
    "cast",
    "complete",
    "contours",
    "extent",
    "find_hidden",
    "find_material",
    "label",
    "load_mesh",
    "measure_symmetry",
    "split_at_hinges",
    "warn_of_repairs",
    "warn_of_size",
]

__getattr__ = export_lazily(__name__)
__dir__ = limit_dir(__name__)
