"""What a dataset is made from beside its specification and scenario: models of classes, and files named anywhere."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from rso_lidar.dataset.specification.spec import DatasetSpec
from rso_lidar.dataset.specification.tables import ClassOfTargets, DrawnFragments
from rso_lidar.errors import DatasetError, MeshError, SettingError
from rso_lidar.files import MOST_BYTES, check_regular, read_bytes
from rso_lidar.part import parse_toml
from rso_lidar.scenario import (
    Fragment,
    Scenario,
    Target,
    build_fragment,
    build_whole_surface,
    iterate_texts,
    name_fragments,
)
from rso_lidar.scene import Mesh, is_mesh_path, load_mesh, model, models, own_models
from rso_lidar.shipped import find

_SAMPLE_LENGTH_M = 1.0  # of the fragment that stands for its kind in the hash of a dataset
_MOST_BYTES = 2 * MOST_BYTES  # meshes are the largest


def name_model(target: Target) -> str:
    """Return the name by which labels call a target's model: without the random seed of a fragment or of terrain."""
    if target.fragment is not None:
        return name_fragments(target.fragment.kind)
    return target.shape if target.terrain is None else target.terrain.type


def list_models(spec: DatasetSpec, target_class: ClassOfTargets, base: Scenario) -> tuple[str, ...]:
    """Return the names of the models of a class.

    Parameters
    ----------
    base : the scenario; its target's model is used for a class without models

    Raises
    ------
    DatasetError
        If no shipped model has the taxonomy of the class.
    """
    if target_class.empty:
        return ()
    if target_class.fragments is not None:
        return name_kinds(target_class.fragments)
    if target_class.taxonomy is not None:
        wanted = target_class.taxonomy.model_dump(exclude_none=True)
        shipped = {name: entry for name, entry in models().items() if name not in own_models()}
        matches = tuple(
            name
            for name, entry in sorted(shipped.items())
            if entry.taxonomy is not None
            and all(getattr(entry.taxonomy, key) == value for key, value in wanted.items())
        )
        if not matches:
            keys = ", ".join(f"{key} = {value}" for key, value in wanted.items())
            raise DatasetError(
                f"classes: '{target_class.name}' has no shipped model with {keys}; give fewer keys, or name models"
            )
        return matches
    return target_class.models or (name_model(_find_own(spec, base)),)


def name_kinds(fragments: DrawnFragments | None) -> tuple[str, ...]:
    """Return the names of all kinds of drawn fragments; none where no fragments are drawn."""
    return () if fragments is None else tuple(name_fragments(kind) for kind in fragments.kinds)


def _find_own(spec: DatasetSpec, base: Scenario) -> Target:
    """Return the target of the scenario that classes replace."""
    names = [target.name for target in base.target]
    return base.target[names.index(spec.target) if spec.target else 0]


def find_meshes(spec: DatasetSpec, named: tuple[tuple[str, ...], ...], base: Scenario, folder: Path) -> dict[str, Mesh]:
    """Find the meshes of all models, by name. A fragment of each kind stands for all of them.

    Parameters
    ----------
    named : (class) names of models

    Raises
    ------
    MeshError
        If there is no such model or file.
    """
    meshes: dict[str, Mesh] = {}
    kinds = [*spec.clutter.fragments.kinds] if spec.clutter and spec.clutter.fragments else []
    for target_class, names in zip(spec.classes, named, strict=True):
        if target_class.fragments is not None:
            kinds += target_class.fragments.kinds
        elif target_class.replaces_target:
            meshes |= {name: find_mesh(name, folder) for name in names}
        elif not target_class.empty:
            own = _find_own(spec, base)
            meshes[names[0]] = build_whole_surface(own, base.file, base.lidar.laser.wavelength_m).mesh
    for kind in kinds:
        sample = Fragment(kind=kind, characteristic_length_m=_SAMPLE_LENGTH_M)
        meshes[name_fragments(kind)] = build_fragment(sample).mesh
    for name in spec.clutter.models if spec.clutter else ():
        meshes[name] = find_mesh(name, folder)
    return meshes


def find_mesh(name: str, folder: Path) -> Mesh:
    """Return the mesh of a model.

    Raises
    ------
    MeshError
        If there is no such model or file.
    """
    if not is_mesh_path(name):
        return model(name).mesh
    path = find(name, folder)
    if path is None:
        raise MeshError(f"no mesh '{name}' beside the scenario nor among the shipped data; check the name")
    return load_mesh(path)


def hash_named_files(spec: DatasetSpec, tables: dict[str, Any], folder: Path) -> dict[str, str]:
    """Return the SHA-256 of each file that the scenario, a setting or a variable names, by the name stated there.

    Orbits, attitudes, heights, materials, lens data and Python files of `dynamics` are such files. Every text that names a
    file counts, so that new parts need no entry here. Names of files that do not exist are left out.

    Raises
    ------
    DatasetError
        If a file cannot be read.
    """
    drawn = [[variable.law.model_dump() for variable in spec.variable], spec.view and spec.view.model_dump()]
    settings = [*spec.set]
    settings += [setting for group in (spec.classes, spec.sensor) for entry in group for setting in entry.set]
    hashes = {}
    for text in sorted(set(iterate_texts([tables, drawn, [_read_value(setting) for setting in settings]]))):
        place, colon, _ = text.rpartition(":")
        for name in (text, *([place] if colon else [])):
            path = find(name, folder) if is_mesh_path(name) else None
            if path is not None and path.is_file():
                check_regular(path, _MOST_BYTES, DatasetError)
                hashes[name] = hashlib.sha256(read_bytes(path, _MOST_BYTES, DatasetError)).hexdigest()
    return hashes


def _read_value(setting: str) -> Any:
    """Return the value of a setting of the form place=value."""
    text = setting.partition("=")[2]
    try:
        return parse_toml(f"value = {text}", "--set", SettingError)["value"]
    except SettingError:
        return text.strip()
