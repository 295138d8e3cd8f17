"""What is out there, and where rays meet it."""

from rso_lidar.scene.articulated import Hinged, articulated
from rso_lidar.scene.brdf import ByWavelength, Lambertian, Material, Named, Phong, material_named
from rso_lidar.scene.cast import cast
from rso_lidar.scene.crinkle import Crinkled
from rso_lidar.scene.extent import extent
from rso_lidar.scene.label import label
from rso_lidar.scene.measured import TableBrdf
from rso_lidar.scene.mesh import Mesh, load_mesh, warn_of_repairs, warn_of_size
from rso_lidar.scene.microfacet import Ggx, OrenNayar
from rso_lidar.scene.retro import RetroReflector
from rso_lidar.scene.scatter import Scatterer
from rso_lidar.scene.surface import Surface, build_surface

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
