"""From a target to its surface: the model found, scaled, and given its materials."""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from rso_lidar.craft import Taxonomy
from rso_lidar.errors import RsoLidarWarning
from rso_lidar.scenario.tables.facet_materials import coloured, finished
from rso_lidar.scenario.tables.target import Target
from rso_lidar.scenario.tables.terrain import mesh_of, taxonomy_of_terrain
from rso_lidar.scene import (
    Hinged,
    Material,
    Mesh,
    Named,
    Surface,
    articulated,
    build_surface,
    load_mesh,
    warn_of_repairs,
    warn_of_size,
)
from rso_lidar.scene.library.catalogue import ModelEntry, model


def surfaces_of(target: Target, number: int, file: Callable[[str], Path], wavelength_m: float) -> tuple[Surface, ...]:
    """Return the surfaces of the target of that number: what stands still in its body axes, and what each hinge carries."""
    whole = replace(surface_of(target, file, wavelength_m), target=number)
    hinged = [Hinged(target.joint_axes(joint), joint.parts, joint.position_m) for joint in target.joints]
    return articulated(whole, hinged)


def surface_of(target: Target, file: Callable[[str], Path], wavelength_m: float) -> Surface:
    """Return the surface of a target as light of `wavelength_m` sees it; `file` finds a mesh that the scenario names."""
    entry: ModelEntry | None = None
    own: Mapping[str, Material] = {}
    if target.terrain is not None:
        mesh = mesh_of(target.terrain, file)
    elif target.is_path:
        path = file(target.shape)
        if target.center_of_mass_m is None:
            warnings.warn(
                f"target {target.name}: the centre of mass of {path.name} is assumed at its origin; "
                "give center_of_mass_m in mesh coordinates",
                RsoLidarWarning,
                stacklevel=2,
            )
        mesh = load_mesh(path)
        warn_of_repairs(mesh, target.name)
    else:
        entry = model(target.shape)
        if target.library is not None:
            target.library.check(entry)
        mesh = entry.mesh
        if target.material is None and target.library is None:  # else they stand in the target
            own = {part: Named(name=name) for part, name in entry.parts.items()}
    scale, center_of_mass_m = placed_in(target, mesh, entry)
    surface = build_surface(
        target.name,
        mesh,
        scale=scale,
        mesh_axes=target.mesh_axes,
        center_of_mass_m=center_of_mass_m,
        material=target.material,
        part_materials={**own, **target.part_materials},
        smooth_parts=target.smooth_parts,
        wavelength_m=wavelength_m,
    )
    if target.terrain is None:
        warn_of_size(mesh, scale, target.name)
    if target.color_materials:
        surface = coloured(surface, target.color_materials, wavelength_m)
    if target.facet_materials is not None:
        return finished(surface, target.facet_materials, file, wavelength_m)
    return surface


def placed_in(target: Target, mesh: Mesh, entry: ModelEntry | None) -> tuple[float, tuple[float, float, float]]:
    """Return the scale of a target's mesh, and its centre of mass [m] in the mesh's axes after scaling."""
    scale = target.scale or (target.size_m / float(mesh.size_m.max()) if target.size_m else 1.0)
    if target.center_of_mass_m is not None:
        return scale, target.center_of_mass_m
    x, y, z = entry.center_of_mass_m if entry is not None else (0.0, 0.0, 0.0)
    return scale, (scale * x, scale * y, scale * z)


def taxonomy_of(target: Target) -> Taxonomy | None:
    """Return where a target belongs: what the scenario says, else its catalogue; None where nobody has said."""
    if target.taxonomy is None and target.terrain is not None:
        return taxonomy_of_terrain(target.terrain)
    return target.taxonomy or (None if target.is_path else model(target.shape).taxonomy)
