"""What is out there, and where rays meet it."""

from rso_lidar.scene.casting.cast import cast
from rso_lidar.scene.casting.extent import extent
from rso_lidar.scene.labels import label
from rso_lidar.scene.materials.brdf import ByWavelength, Lambertian, Material, Named, Phong, material_named
from rso_lidar.scene.materials.crinkle import Crinkled
from rso_lidar.scene.materials.measured import TableBrdf
from rso_lidar.scene.materials.microfacet import Ggx, OrenNayar
from rso_lidar.scene.materials.retro import RetroReflector
from rso_lidar.scene.materials.scatterer import Scatterer
from rso_lidar.scene.meshes.mesh import Mesh, load_mesh, warn_of_repairs, warn_of_size
from rso_lidar.scene.surfaces.articulated import Hinged, articulated
from rso_lidar.scene.surfaces.surface import Surface, build_surface

__all__ = [
    "ByWavelength",
    "Crinkled",
    "Ggx",
    "Hinged",
    "Lambertian",
    "Material",
    "Mesh",
    "Named",
    "OrenNayar",
    "Phong",
    "RetroReflector",
    "Scatterer",
    "Surface",
    "TableBrdf",
    "articulated",
    "build_surface",
    "cast",
    "extent",
    "label",
    "load_mesh",
    "material_named",
    "warn_of_repairs",
    "warn_of_size",
]
