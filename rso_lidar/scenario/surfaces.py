"""From a target to its surface: the model found, scaled, and given its materials."""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from rso_lidar.errors import MeshError, RsoLidarWarning
from rso_lidar.scenario.parts import Target
from rso_lidar.scene import Hinged, Material, Scatterer, Surface, articulated, build_surface, load_mesh, warn_of_size
from rso_lidar.scene.library import ModelEntry, materials, model

_MATERIAL: TypeAdapter[Scatterer] = TypeAdapter(Material)


def surfaces_of(target: Target, number: int, file: Callable[[str], Path], wavelength_m: float) -> tuple[Surface, ...]:
    """Return the surfaces of the target of that number: what stands still in its body axes, and what each hinge carries."""
    whole = replace(surface_of(target, file, wavelength_m), target=number)
    hinged = [Hinged(target.joint_axes(joint), joint.parts, joint.position_m) for joint in target.joints]
    return articulated(whole, hinged)


def surface_of(target: Target, file: Callable[[str], Path], wavelength_m: float) -> Surface:
    """Return the surface of a target as light of `wavelength_m` sees it; `file` finds a mesh that the scenario names."""
    entry: ModelEntry | None = None
    own: Mapping[str, Scatterer] = {}
    center_of_mass_m = target.center_of_mass_m
    if target.is_path:
        path = file(target.model)
        if center_of_mass_m is None:
            warnings.warn(
                f"target {target.name}: the centre of mass of {path.name} is assumed at its origin; "
                "give center_of_mass_m in mesh coordinates",
                RsoLidarWarning,
                stacklevel=2,
            )
    else:
        entry = model(target.model)
        path = entry.path
        if target.material is None:
            own = {part: material_named(name, wavelength_m) for part, name in entry.parts.items()}
    mesh = load_mesh(path)
    scale = target.scale or (target.size_m / float(mesh.size_m.max()) if target.size_m else 1.0)
    if center_of_mass_m is None and entry is not None:
        x, y, z = entry.center_of_mass_m
        center_of_mass_m = (scale * x, scale * y, scale * z)
    surface = build_surface(
        target.name,
        mesh,
        scale=scale,
        mesh_axes=target.mesh_axes,
        center_of_mass_m=center_of_mass_m or (0.0, 0.0, 0.0),
        material=target.material,
        part_materials={**own, **target.part_materials},
        smooth_parts=target.smooth_parts,
        wavelength_m=wavelength_m,
    )
    warn_of_size(mesh, scale, target.name)
    return surface


def material_named(name: str, wavelength_m: float) -> Scatterer:
    """Return a material of the catalogue by name, of the two wavelengths that it knows the nearer one."""
    fields = materials().get(name)
    if fields is None:
        raise MeshError(f"models/materials.toml: no material '{name}'; add it, or name another in models/index.toml")
    if wavelength_m > _BETWEEN_M:
        fields = {**fields, **fields.get("at_1570_nm", {})}
    known = {key: value for key, value in fields.items() if key not in _REMARKS}
    try:
        return _MATERIAL.validate_python(known)
    except ValidationError as error:
        raise MeshError(f"models/materials.toml: {name}: {error.errors()[0]['msg']}; mend the entry") from None


_BETWEEN_M = 1.29e-6  # midway, in ratio, between 1064 and 1570 nm
_REMARKS = ("what", "source", "confidence", "display_rgb", "at_1570_nm")
