"""Surfaces of targets: the model, scaled and with materials."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rso_lidar.errors import warn_of_input
from rso_lidar.part import Part, Vector
from rso_lidar.records import OTHER, PartClass, Symmetry, Taxonomy
from rso_lidar.scenario.tables.facet_materials import apply_color_materials, apply_facet_materials
from rso_lidar.scenario.tables.facet_parts import apply_facet_parts
from rso_lidar.scenario.tables.fragment import PART, build_fragment
from rso_lidar.scenario.tables.target import Target
from rso_lidar.scenario.tables.terrain import build_terrain_mesh, classify_terrain
from rso_lidar.scene import (
    Hinged,
    Lambertian,
    Material,
    Mesh,
    ModelEntry,
    Named,
    Surface,
    body_from_mesh,
    build_surface,
    guess_part_classes,
    load_mesh,
    model,
    split_at_hinges,
    warn_of_repairs,
    warn_of_size,
)


def build_surfaces(
    target: Target, number: int, file: Callable[[str], Path], wavelength_m: float
) -> tuple[Surface, ...]:
    """Build the surfaces of a target: the parts that are fixed in body axes, and those that each hinge carries."""
    whole = build_whole_surface(target, file, wavelength_m, number)
    hinged = [Hinged(target.joint_axes(joint), joint.parts, joint.position_m) for joint in target.joints]
    return split_at_hinges(whole, hinged)


def build_whole_surface(
    target: Target, file: Callable[[str], Path], wavelength_m: float, number: int | None = None
) -> Surface:
    """Build the surface of a target with all hinges at zero.

    Surfaces of shipped and of user's models are kept: what is derived from one, such as its planes, is computed once for all
    scenarios of a process that contain it.

    Parameters
    ----------
    target : the target
    file : finds a mesh that the scenario names
    wavelength_m : of the laser, for the materials [m]
    number : index of the target in the scenario, None for a surface without one

    Returns
    -------
    Surface
        In the body axes of the target, from its centre of mass [m].

    Raises
    ------
    MeshError
        For a model or mesh that cannot be read, and materials of parts that it does not have.
    """
    entry: ModelEntry | None = None
    own: Mapping[str, Material] = {}
    if target.terrain is not None:
        mesh = build_terrain_mesh(target.terrain, file)
    elif target.fragment is not None:
        built = build_fragment(target.fragment)
        mesh = built.mesh
        if target.material is None:
            own = {part: Named(name=name) for part, name in built.materials.items()}
    elif target.is_path:
        path = file(target.shape)
        if target.center_of_mass_m is None:
            warn_of_input(
                f"target {target.name}: the centre of mass of {path.name} is assumed at its origin; "
                "give center_of_mass_m in mesh coordinates"
            )
        mesh = load_mesh(path)
        warn_of_repairs(mesh, target.name)
        if target.facet_parts is not None:
            mesh = apply_facet_parts(mesh, target.facet_parts, file)
    else:
        entry = model(target.shape)
        if target.library is not None:
            target.library.check(entry)
        mesh = entry.mesh
        if target.material is None and target.library is None:  # otherwise the target lists its materials
            own = {part: Named(name=name) for part, name in entry.parts.items()}
    mesh.check_parts("part_classes", target.part_classes)
    scale, center_of_mass_m = place_mesh(target, mesh, entry)
    materials = {**own, **target.part_materials}
    form = _SurfaceForm(
        target.name, mesh, scale, target.mesh_axes, center_of_mass_m, target.smooth_parts, wavelength_m, number
    )
    build: Callable[..., Surface] = _build
    if _is_lasting((target.material or Lambertian(), *materials.values())):
        build = _build_once
        if target.terrain is not None:
            build = _build_ground_once
        elif target.fragment is not None:
            build = _build_fragment_once
    surface = build(form, target.material, tuple(materials.items()))
    if target.model is not None:
        warn_of_size(mesh, scale, target.name)
    if target.color_materials:
        surface = apply_color_materials(surface, target.color_materials, wavelength_m)
    if target.facet_materials is not None:
        return apply_facet_materials(surface, target.facet_materials, file, wavelength_m)
    return surface


def name_part_materials(target: Target, mesh: Mesh) -> dict[str, str]:
    """Return the catalogue's material of each part that has one; materials of single facets do not count.

    Parameters
    ----------
    target : with its materials
    mesh : of the target

    Returns
    -------
    dict of str
        Names of materials by the names of parts. Parts whose material has no name are left out.
    """
    own: dict[str, Material | str] = {}
    if target.fragment is not None and target.material is None:
        own = dict(build_fragment(target.fragment).materials)
    elif not target.is_path and target.material is None and target.library is None:
        own = dict(model(target.shape).parts)
    named = {}
    for part in mesh.part_names:
        material = target.part_materials.get(part, own.get(part, target.material))
        name = getattr(material, "name", material)
        if isinstance(name, str):
            named[part] = name
    return named


def _is_lasting(materials: tuple[Material, ...]) -> bool:
    """Return whether materials are parts, which do not change, and can be compared quickly."""
    try:
        hash(materials)
    except TypeError:
        return False
    return all(isinstance(material, Part) for material in materials)


class _SurfaceForm(NamedTuple):
    """What decides a surface beside its materials; see `scene.build_surface`."""

    name: str
    mesh: Mesh
    scale: float
    mesh_axes: str
    center_of_mass_m: tuple[float, float, float]
    smooth_parts: tuple[str, ...]
    wavelength_m: float
    number: int | None


def _build(form: _SurfaceForm, material: Material | None, part_materials: tuple[tuple[str, Material], ...]) -> Surface:
    """Build a surface."""
    surface = build_surface(
        form.name,
        form.mesh,
        scale=form.scale,
        mesh_axes=form.mesh_axes,
        center_of_mass_m=form.center_of_mass_m,
        material=material,
        part_materials=dict(part_materials),
        smooth_parts=form.smooth_parts,
        wavelength_m=form.wavelength_m,
    )
    return replace(surface, target=form.number)


_build_once = lru_cache(maxsize=32)(_build)
_build_ground_once = lru_cache(maxsize=2)(_build)  # ground has up to millions of facets, and its seed may be drawn
_build_fragment_once = lru_cache(maxsize=16)(_build)  # apart, so that drawn fragments do not displace models


def place_mesh(target: Target, mesh: Mesh, entry: ModelEntry | None) -> tuple[float, tuple[float, float, float]]:
    """Return the scale of a target's mesh, and its centre of mass [m] in the mesh's axes after scaling."""
    scale = target.scale or (target.size_m / float(mesh.size_m.max()) if target.size_m else 1.0)
    if target.center_of_mass_m is not None:
        return scale, target.center_of_mass_m
    x, y, z = entry.center_of_mass_m if entry is not None else (0.0, 0.0, 0.0)
    return scale, (scale * x, scale * y, scale * z)


def find_taxonomy(target: Target) -> Taxonomy | None:
    """Return the taxonomy of a target from the scenario, or from the catalogue; None where neither gives it.

    Parameters
    ----------
    target : of a scenario; terrain and fragments have one of their own
    """
    if target.taxonomy is None and target.terrain is not None:
        return classify_terrain(target.terrain)
    if target.taxonomy is None and target.fragment is not None:
        return build_fragment(target.fragment).taxonomy
    return target.taxonomy or (None if target.is_path else model(target.shape).taxonomy)


def find_part_classes(target: Target, mesh: Mesh) -> tuple[PartClass, ...]:
    """Return the common class of each part of a target's mesh: from the scenario, the catalogue or its name; else `other`.

    Names count for parts that the scenario itself makes of facets.

    Parameters
    ----------
    target : of a scenario
    mesh : of the target
    """
    known: Mapping[str, PartClass] = {} if target.is_path else model(target.shape).part_classes
    if target.fragment is not None:
        known = {PART: "fragment"}
    elif target.facet_parts is not None:
        known = guess_part_classes(mesh.part_names)
    return tuple(target.part_classes.get(part, known.get(part, OTHER)) for part in mesh.part_names)


def find_symmetry(target: Target) -> Symmetry | None:
    """Return the symmetry of a target in its body axes, from the scenario or the catalogue; None where there is none.

    The catalogue's holds for hinges at zero. It does not count where the target has joints.

    Parameters
    ----------
    target : of a scenario
    """
    entry = None if target.is_path else model(target.shape)
    symmetry, center_of_mass_m = target.symmetry, target.center_of_mass_m or (0.0, 0.0, 0.0)
    if entry is not None:
        scale, center_of_mass_m = place_mesh(target, entry.mesh, entry)
        if symmetry is None and entry.symmetry is not None and not target.joint:
            x, y, z = entry.symmetry.position_m
            symmetry = entry.symmetry.replace(position_m=(scale * x, scale * y, scale * z))
    if symmetry is None:
        return None

    def turn(vector: Vector) -> tuple[float, ...]:
        return tuple(body_from_mesh(np.array(vector), target.mesh_axes).tolist())

    from_origin_m = np.array(symmetry.position_m) - np.array(center_of_mass_m)
    half_turn = None if symmetry.half_turn is None else turn(symmetry.half_turn)
    return symmetry.replace(
        axis=turn(symmetry.axis), half_turn=half_turn, position_m=turn(tuple(from_origin_m.tolist()))
    )
