"""The record of where frames come from, from which a recording can be flown again."""

from __future__ import annotations

import datetime
import hashlib
import importlib.metadata
import platform
from functools import cache
from pathlib import Path
from typing import Any

from rso_lidar.errors import ScenarioError, add_place, warn
from rso_lidar.files import MOST_BYTES, read_bytes
from rso_lidar.kernels import compiler_version
from rso_lidar.motion import name_function
from rso_lidar.orbit import format_utc
from rso_lidar.part import Part, dump_part
from rso_lidar.records import Keypoint, Source, TargetEntry
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.mission.named_files import list_named_files
from rso_lidar.scenario.mission.target_keypoints import find_keypoints
from rso_lidar.scenario.mission.target_surfaces import find_part_classes, find_taxonomy, place_mesh
from rso_lidar.scenario.tables.library_model import describe_library_model
from rso_lidar.scenario.tables.target import Target
from rso_lidar.scene import Lambertian, Material, Named, Surface, engine, model

_LIBRARIES = ("numpy", "scipy", "skyfield", "sgp4", "trimesh", "embreex", "h5py")


def build_source(mission: Mission) -> Source:
    """Build the Source record of a mission."""
    return Source(
        scenario=resolve_toml(mission),
        title=mission.name,
        start_utc=format_utc(mission.time.start_utc, 0.0),
        seed=mission.seed,
        versions=_list_versions() | {"arithmetic": describe_arithmetic()},
        targets=tuple(
            TargetEntry(
                name=target.name,
                model=target.shape,
                mesh_sha256=surface.mesh.sha256,
                parts=surface.mesh.part_names,
                materials=tuple(material.summarize() for material in surface.materials[: len(surface.mesh.part_names)]),
                facets=surface.mesh.source_facets,
                taxonomy=find_taxonomy(target),
                part_classes=find_part_classes(target, surface.mesh),
                keypoints=_find_keypoints(mission, target, surface),
            )
            for target, surface in _pair_meshes(mission)
        ),
    )


@cache
def _list_versions() -> dict[str, str]:
    """Return the versions of this package, of Python and of the libraries by name."""
    own = {"rso_lidar": importlib.metadata.version("rso-lidar"), "python": platform.python_version()}
    return own | {name: importlib.metadata.version(name) for name in _LIBRARIES}


def describe_arithmetic() -> str:
    """Describe how the busiest stages are computed, such as "numba 0.68.1 with packets of 16 rays"."""
    return f"{compiler_version()} with {engine().summary}"


def resolve_toml(mission: Mission) -> str:
    """Write a mission as TOML, with every default written out and element sets inline."""
    import tomli_w

    _warn_of_unnamed_dynamics(mission)
    meshes = _pair_meshes(mission)
    tree: dict[str, Any] = mission.model_dump(exclude_none=True)
    for table, (target, surface) in zip(tree["target"], meshes, strict=True):
        if target.joint:
            table["joint"] = [joint.model_dump(exclude_none=True) for joint in target.joints]
        if table.pop("keypoint_file", None) is not None or _is_of_library(target):
            points = _find_keypoints(mission, target, surface)
            table["keypoint"] = [point.model_dump(exclude_none=True) for point in points]
        table |= _resolve_library_model(target)
        table |= {key: table.pop(key) for key in type(target).model_fields if key in table}  # in order again
    tables = [*tree["target"], tree["follower"]]
    for table, body in zip(tables, mission.bodies, strict=True):
        written = _inline_element_sets(body.motion, mission.time.start_utc)
        if written is not body.motion:
            table["motion"] = written.model_dump(exclude_none=True)
    sums = [f"# mesh of {target.name}: SHA-256 {surface.mesh.sha256}" for target, surface in meshes]
    parts: list[tuple[str, Any]] = [
        (body.name, part) for body in mission.bodies for part in (body.motion, body.attitude) if part is not None
    ]
    parts += [("the ptu", mission.pan_tilt)] if mission.pan_tilt else []
    listed = [(name, file) for name, part in parts if not hasattr(part, "inline") for file in list_named_files(part)]
    sums += [f"# file {Path(file).name} of {name}: SHA-256 {_hash_file(file)}" for name, file in listed]
    sums += [
        f"# file {Path(labels.file).name} of {target.name}: SHA-256 {_hash_file(str(mission.file(labels.file)))}"
        for target in mission.target
        for labels in (target.facet_materials, target.facet_parts)
        if labels is not None and labels.file is not None
    ]
    sums += [
        f"# file {Path(file).name} of the lidar: SHA-256 {_hash_file(file)}"
        for file in list_named_files(mission.instrument)
    ]
    sums += [
        f"# file {Path(file).name} of camera {camera.name}: SHA-256 {_hash_file(file)}"
        for camera in mission.cameras
        for file in list_named_files(camera)
    ]
    return "\n".join([*sums, "", tomli_w.dumps(tree)])


def _inline_element_sets(part: Any, start_utc: datetime.datetime) -> Any:
    """Return a motion with all element sets that it or a part in it names written out."""
    if not isinstance(part, Part):
        return part
    if (inline := getattr(part, "inline", None)) is not None:
        return inline(start_utc)
    changes = {}
    for name in type(part).model_fields:
        value = getattr(part, name)
        if isinstance(value, Part) and (written := _inline_element_sets(value, start_utc)) is not value:
            changes[name] = written
    return part.replace(**changes) if changes else part


def _warn_of_unnamed_dynamics(mission: Mission) -> None:
    """Warn of dynamics without a name by which a recording could find them again."""
    parts = [
        (f"{body.name}.{place}", getattr(body, place)) for body in mission.bodies for place in ("motion", "attitude")
    ]
    parts += [("ptu.response", mission.ptu.response)] if mission.ptu else []
    for place, part in parts:
        dynamics = getattr(part, "dynamics", None)
        if dynamics is not None and "<" in name_function(dynamics):
            warn(
                f"{place}.dynamics: {name_function(dynamics)} has no name by which a recording could find it again; "
                "define it in a module or file, and name it there"
            )


def _hash_file(file: str) -> str:
    return hashlib.sha256(read_bytes(Path(file), 2 * MOST_BYTES, ScenarioError)).hexdigest()  # meshes are the largest


def _find_keypoints(mission: Mission, target: Target, surface: Surface) -> tuple[Keypoint, ...]:
    with add_place(f"target {target.name}"):
        return find_keypoints(target, surface.mesh, mission.file)


def _pair_meshes(mission: Mission) -> list[tuple[Target, Surface]]:
    return [(target, mission.surfaces_of(number)[0]) for number, target in enumerate(mission.target)]


def _is_of_library(target: Target) -> bool:
    """Return whether a target takes what it does not state itself from the user's own library."""
    return not target.is_path and target.library is None and model(target.shape).own


def _resolve_library_model(target: Target) -> dict[str, Any]:
    """Return what a target takes from the user's own library, by key; nothing for a shipped model or a path.

    A target of a recording states this already and takes nothing.
    """
    if not _is_of_library(target):
        return {}
    entry = model(target.shape)
    mesh, kind = entry.mesh, target.taxonomy or entry.taxonomy
    fields = {
        "library": describe_library_model(entry).model_dump(exclude_none=True),
        "center_of_mass_m": place_mesh(target, mesh, entry)[1],
        "taxonomy": kind.model_dump(),
        "part_classes": dict(zip(mesh.part_names, find_part_classes(target, mesh), strict=True)),
    }
    if (symmetry := target.symmetry or entry.symmetry) is not None:
        fields["symmetry"] = symmetry.model_dump(exclude_none=True)
    if target.material is None:
        of_part: dict[str, Material] = {name: Named(name=material) for name, material in entry.parts.items()}
        of_part |= target.part_materials
        default = Lambertian()
        fields["part_materials"] = {name: dump_part(of_part.get(name, default)) for name in mesh.part_names}
    return fields
