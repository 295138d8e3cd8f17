"""What is out there, and where rays meet it."""

from rso_lidar.scene.brdf import Lambertian, Material, Phong
from rso_lidar.scene.cast import cast
from rso_lidar.scene.extent import extent
from rso_lidar.scene.label import label
from rso_lidar.scene.mesh import Mesh, load_mesh, warn_of_size
from rso_lidar.scene.surface import Surface, build_surface

__all__ = [
    "Lambertian",
    "Material",
    "Mesh",
    "Phong",
    "Surface",
    "build_surface",
    "cast",
    "extent",
    "label",
    "load_mesh",
    "warn_of_size",
]
