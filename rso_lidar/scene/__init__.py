"""Targets and where rays meet them: meshes, materials, surfaces, casting and labels."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.scene import library
    from rso_lidar.scene.bounces.bounce import bounce
    from rso_lidar.scene.bounces.earthshine import add_earthshine
    from rso_lidar.scene.bounces.penumbra import recolor_sunlight, soften_shadows
    from rso_lidar.scene.casting.cast import cast
    from rso_lidar.scene.casting.contours import contours, find_textures
    from rso_lidar.scene.casting.extent import extent
    from rso_lidar.scene.casting.fronts import find_fronts
    from rso_lidar.scene.casting.shadows import find_hidden
    from rso_lidar.scene.embree.engine import engine
    from rso_lidar.scene.labels import label
    from rso_lidar.scene.library.adding import MeshOptions, add_model, remove_model
    from rso_lidar.scene.library.mesh_units import list_units
    from rso_lidar.scene.library.model_index import (
        ModelEntry,
        guess_part_classes,
        is_mesh_path,
        load_materials,
        model,
        models,
        own_folder,
        own_models,
    )
    from rso_lidar.scene.materials.choice import AnyMaterial, ByWavelength, Named, find_material, total_reflectance
    from rso_lidar.scene.materials.crinkle import Crinkled
    from rso_lidar.scene.materials.lobe import Lobe
    from rso_lidar.scene.materials.measured_brdf import TableBrdf
    from rso_lidar.scene.materials.microfacet import Ggx, OrenNayar
    from rso_lidar.scene.materials.phong import Lambertian, Phong
    from rso_lidar.scene.materials.retro import RetroReflector
    from rso_lidar.scene.materials.scatterer import Material, Scatterer, complete
    from rso_lidar.scene.meshes.facet_groups import format_span, group_facets, read_facet_words
    from rso_lidar.scene.meshes.height_field import MOST_HEIGHT_CELLS, build_height_field, load_height_field
    from rso_lidar.scene.meshes.mesh import (
        Mesh,
        body_from_mesh,
        load_mesh,
        read_facet_colours,
        warn_of_repairs,
        warn_of_size,
    )
    from rso_lidar.scene.meshes.symmetry_check import SymmetryDeviation, measure_symmetry
    from rso_lidar.scene.surface_forces.facet_laws import GasLaw
    from rso_lidar.scene.surface_forces.solar_finishes import ASSUMED_FINISH, SOLAR_FINISHES
    from rso_lidar.scene.surface_forces.tabulation import FacetLoads, measure_error, tabulate_loads
    from rso_lidar.scene.surfaces.articulation import Hinged, split_at_hinges
    from rso_lidar.scene.surfaces.examination import examine_file, examine_mesh
    from rso_lidar.scene.surfaces.portrait import find_top_heights, render_portrait, viewer_axes
    from rso_lidar.scene.surfaces.surface import Surface, build_surface
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "ASSUMED_FINISH",
    "MOST_HEIGHT_CELLS",
    "SOLAR_FINISHES",
    "AnyMaterial",
    "ByWavelength",
    "Crinkled",
    "FacetLoads",
    "GasLaw",
    "Ggx",
    "Hinged",
    "Lambertian",
    "Lobe",
    "Material",
    "Mesh",
    "MeshOptions",
    "ModelEntry",
    "Named",
    "OrenNayar",
    "Phong",
    "RetroReflector",
    "Scatterer",
    "Surface",
    "SymmetryDeviation",
    "TableBrdf",
    "add_earthshine",
    "add_model",
    "body_from_mesh",
    "bounce",
    "build_height_field",
    "build_surface",
    "cast",
    "complete",
    "contours",
    "engine",
    "examine_file",
    "examine_mesh",
    "extent",
    "find_fronts",
    "find_hidden",
    "find_material",
    "find_textures",
    "find_top_heights",
    "format_span",
    "group_facets",
    "guess_part_classes",
    "is_mesh_path",
    "label",
    "library",
    "list_units",
    "load_height_field",
    "load_materials",
    "load_mesh",
    "measure_error",
    "measure_symmetry",
    "model",
    "models",
    "own_folder",
    "own_models",
    "read_facet_colours",
    "read_facet_words",
    "recolor_sunlight",
    "remove_model",
    "render_portrait",
    "soften_shadows",
    "split_at_hinges",
    "tabulate_loads",
    "total_reflectance",
    "viewer_axes",
    "warn_of_repairs",
    "warn_of_size",
]

__dir__ = limit_dir(__name__)
