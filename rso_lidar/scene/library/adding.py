"""Adding meshes to the user's own library, and removing them. Guesses about an unknown file are reported."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import shorten
from typing import Any, Literal

import numpy as np

from rso_lidar.errors import MeshError, ScenarioError, did_you_mean
from rso_lidar.files import hold_lock, write_atomically
from rso_lidar.records import OTHER, PART_CLASSES, Taxonomy, classify_size
from rso_lidar.scene.library.mesh_units import guess_scale, known_meshes
from rso_lidar.scene.library.model_index import (
    ModelEntry,
    guess_part_classes,
    hash_table,
    load_materials,
    materials_of,
    model,
    models,
    own_entry,
    own_folder,
    own_models,
    read_own_index,
)
from rso_lidar.scene.meshes.accessors import GltfFile
from rso_lidar.scene.meshes.cad import CHORD_MM, is_cad, tessellate
from rso_lidar.scene.meshes.facet_groups import format_facet_words, group_facets
from rso_lidar.scene.meshes.mesh import (
    FARTHEST_M,
    Mesh,
    load_mesh,
    normalize_mesh,
    parse_mesh,
)
from rso_lidar.units import format_count

# Of `rso-lidar models`, which takes a model's name in their place.
COMMANDS = ("list", "show", "materials", "add", "check", "remove")
_LEAST_M = 1e-4  # the index holds sizes to a tenth of a millimetre
_WAIT_S = 60.0  # for another process that adds a model: the largest meshes take some ten seconds
_LONGEST_LIST = 1000  # characters of the names of parts in a message
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,62}")
_DEFAULT = "lambertian_30"
_PARTS = ".parts.csv"  # ends the name of the table of facets beside a mesh
_HEAD = (
    "# Your own models, kept by `rso-lidar models add` and `remove`. Correct what you know better: centre of mass, parts,\n"
    "# taxonomy; mass_kg, inertia_kg_m2 and hinges may be added, in the form of the shipped models/index.toml.\n\n"
)


@dataclass(frozen=True)
class MeshOptions:
    """Properties of a mesh as the user gives them. What is None or empty is known for the file, guessed, or a default.

    Parameters
    ----------
    name : in scenarios (None: the name of the file)
    scale : metres in one unit of the file
    size_m : longest side [m], instead of `scale`
    mesh_axes : ``"z_up"``, or ``"y_up"`` to turn the file's y to z
    material : of the catalogue, for all parts
    part_materials, part_classes : material, and common part class, by name of the part
    facet_parts : table of the parts of facets, .csv (facet, part) or .npy (None: parts as the file names them)
    by_material : whether each material of the file is a part
    center_of_mass_m : (xyz) in the axes of the mesh [m] (None: the origin of the file)
    what : a line for lists of models
    taxonomy : fields of `Taxonomy` that are known, such as ``object_class``
    """

    name: str | None = None
    scale: float | None = None
    size_m: float | None = None
    mesh_axes: Literal["z_up", "y_up"] = "z_up"
    material: str | None = None
    part_materials: Mapping[str, str] = field(default_factory=dict)
    part_classes: Mapping[str, str] = field(default_factory=dict)
    facet_parts: Path | None = None
    by_material: bool = False
    center_of_mass_m: tuple[float, float, float] | None = None
    what: str | None = None
    taxonomy: Mapping[str, Any] = field(default_factory=dict)


def add_model(
    path: Path, given: MeshOptions = MeshOptions(), *, overwrite: bool = False
) -> tuple[ModelEntry, list[str]]:
    """Add a mesh to the user's library.

    The file is copied unchanged. Of STEP and IGES the triangles are kept, as GLB.

    Parameters
    ----------
    path : the mesh file
    given : properties that the user gives
    overwrite : whether to replace a model of the same name

    Returns
    -------
    entry : ModelEntry
        The new entry.
    report : list of str
        What was known, guessed and assumed, a line each.

    Raises
    ------
    MeshError, ScenarioError : the file cannot be read, or a given property does not fit it.
    """
    path = Path(path)
    _check_numbers(given)
    if is_cad(path):
        if given.by_material:
            raise MeshError(f"{path.name}: CAD files name no materials; give a table of facets (--facet-parts)")
        blob, unit_m = tessellate(path)
        suffix, kind = ".glb", f"tessellate to {CHORD_MM:g} mm from {path.name}"
        source = f"{kind}, SHA-256 {hashlib.sha256(path.read_bytes()).hexdigest()}"
        mesh = parse_mesh(path, blob, suffix)
    else:
        mesh = load_mesh(path)
        blob, suffix, unit_m, source = path.read_bytes(), path.suffix.lower(), None, path.name
        if suffix == ".gltf" and GltfFile(path, blob).has_data_beside:
            raise MeshError(f"{path.name}: keeps its data in other files; export it as one .glb")
    if given.facet_parts is not None or given.by_material:
        mesh = group_facets(mesh, given.facet_parts)
    known = known_meshes().get(hashlib.sha256(blob).hexdigest(), {})
    name = given.name or known.get("name") or re.sub(r"[^a-z0-9_-]+", "_", path.stem.lower()).strip("_-")
    folder = own_folder()
    _check_name(name)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        where = "let RSO_LIDAR_MODELS, or `rso-lidar config set models_folder`, name a folder that can be"
        raise MeshError(f"{folder}: cannot be made ({error.strerror or error}); {where}") from None
    place = folder / f"{name}{suffix}"
    with _lock_library(folder):
        before = own_models().get(name)
        if before is not None and not overwrite:
            raise MeshError(
                f"name '{name}': is in your library already ({folder}); give --overwrite, or another --name"
            )
        with write_atomically(place) as draft:
            draft.write_bytes(blob)
            table, report = _table(mesh, known, given, unit_m)
            table = {"name": name, "file": place.name, "source": source, "size_bytes": len(blob), **table}
            if not _LEAST_M < (largest_m := max(table["size_m"])) < FARTHEST_M:
                raise MeshError(f"{path.name}: is {largest_m:.4g} m across; give --scale or --size-m")
            if given.facet_parts is not None or given.by_material:
                table |= _write_parts(folder, name, mesh)
            own_entry(folder / "index.toml", table)
        entries = [entry for entry in read_own_index(folder / "index.toml") if entry.get("name") != name]
        _write_index(folder, [*entries, table])
        if before is not None and before.path != place:
            _unlink(before.path, folder)
        if "facet_parts" not in table:
            _unlink(folder / f"{name}{_PARTS}", folder)
        return model(name), report


def remove_model(name: str) -> Path:
    """Remove a model from the user's library, with its entry.

    Parameters
    ----------
    name : of a model that `add_model` added

    Returns
    -------
    Path
        Of the mesh file that was removed.

    Raises
    ------
    ScenarioError
        If the library has no such model.
    """
    folder = own_folder()
    with _lock_library(folder) if folder.is_dir() else nullcontext():
        own, tables = own_models(), read_own_index(folder / "index.toml")
        if name not in own and name not in [table.get("name") for table in tables]:
            where = (
                "is shipped with the package, and cannot be removed" if name in models() else "is not in your library"
            )
            raise ScenarioError(f"model '{name}': {where}{did_you_mean(name, own)} (yours: {', '.join(own) or 'none'})")
        _write_index(folder, [table for table in tables if table.get("name") != name])
        files = [str(table.get("file", "")) for table in tables if table.get("name") == name]
        place = folder / Path(files[0] or name).name
        _unlink(place, folder)
        _unlink(folder / f"{Path(name).name}{_PARTS}", folder)
    return place


def _write_parts(folder: Path, name: str, mesh: Mesh) -> dict[str, str]:
    """Write which facet belongs to what part beside a mesh, and return the keys of the index that name the table."""
    place = folder / f"{name}{_PARTS}"
    with write_atomically(place) as draft:
        draft.write_text(format_facet_words(mesh), encoding="utf-8", newline="\n")
    return {"facet_parts": place.name, "facet_parts_sha256": hash_table(place)}


def _lock_library(folder: Path) -> AbstractContextManager[None]:
    """Return a context that locks a library, so that changes of its index by several processes are all kept."""
    busy = f"{folder}: another process is changing this library; try again when it is done"
    return hold_lock(folder / ".index.lock", wait_s=_WAIT_S, busy=busy)


def _unlink(place: Path, folder: Path) -> None:
    """Delete a mesh file if it is inside the library; an index edited by hand may name another."""
    if place.resolve().parent == folder.resolve():
        place.unlink(missing_ok=True)


def _check_numbers(given: MeshOptions) -> None:
    if given.facet_parts is not None and given.by_material:
        raise MeshError("--facet-parts and --by-material: both make the parts; give one")
    if given.scale is not None and given.size_m is not None:
        raise MeshError("--scale and --size-m: both set the size; give one")
    for option, value in (("--scale", given.scale), ("--size-m", given.size_m)):
        if value is not None and not 0.0 < value < math.inf:
            raise MeshError(f"{option} {value:g}: is not a size; give a number above 0")
    if given.center_of_mass_m is not None and not np.isfinite(given.center_of_mass_m).all():
        raise MeshError("--center-of-mass: has a number that is not finite; give three, in metres")


def _check_name(name: str) -> None:
    if not _NAME.fullmatch(name):
        raise MeshError(f"name '{name}': letters, digits, _ and - only, 63 at most; give another with --name")
    if name in models():
        raise MeshError(f"name '{name}': is a shipped model's; give another with --name")
    if name in COMMANDS:
        raise MeshError(f"name '{name}': is a command of `rso-lidar models`; give another with --name")


def _table(
    mesh: Mesh, known: Mapping[str, Any], given: MeshOptions, unit_m: float | None
) -> tuple[dict[str, Any], list[str]]:
    """Return the index table of a mesh, and a report of the decisions.

    Parameters
    ----------
    unit_m : metres in the unit that the file states, None where it states none
    """
    report: list[str] = []
    left_out = tuple((first, last) for first, last in known.get("left_out", ()))
    if known:
        report.append(f"known      {known['file']} of NASA's printable models, by its SHA-256")
    if left_out:
        count = sum(last - first + 1 for first, last in left_out)
        report.append(f"repaired   {count} facets left out: the helper cube about the origin, not a part of the craft")
    if mesh.degenerate:
        report.append(f"repaired   {format_count(mesh.degenerate, 'facet')} without area dropped")
    scale = _scale(normalize_mesh(mesh, 1.0, left_out=left_out), known, given, unit_m, report)
    whole = normalize_mesh(mesh, scale, given.mesh_axes, left_out)
    low, high = whole.vertices[np.unique(whole.facets)].min(axis=0), whole.vertices[np.unique(whole.facets)].max(axis=0)
    center = given.center_of_mass_m or (0.0, 0.0, 0.0)
    if given.center_of_mass_m is None:
        outside = ", which is outside it" if (low > 0).any() or (high < 0).any() else ""
        report.append(
            f"assumed    centre of mass at the origin of the file{outside}: give another with --center-of-mass"
        )
    fields = {key: known[key] for key in Taxonomy.model_fields if key in known}
    fields = {
        "object_class": "payload",
        "subclass": "spacecraft",
        "shape_family": "irregular",
        "stabilisation": "three_axis",
        **fields,
        **{key: value for key, value in given.taxonomy.items() if value is not None},
        "size_class": classify_size(float(whole.size_m.max())),
    }
    _report_known(fields, known, given, report)
    table: dict[str, Any] = {
        "what": given.what or known.get("what", "a mesh of your own"),
        "licence": "NASA 3D resources: free of copyright; name NASA as the source"
        if known
        else "as stated by its source",
        "confidence": "the file's geometry is used unchanged; centre of mass and materials are assumed unless you gave them",
        "axes": "those of the file" + (", its y turned up to z" if given.mesh_axes == "y_up" else ""),
        "size_m": [round(float(side), 4) for side in whole.size_m],
        "facets": len(whole.facets),
        "sha256": mesh.sha256,
        "center_of_mass_m": list(center),
        "scale": scale,
        "mesh_axes": given.mesh_axes,
        "left_out": [list(run) for run in left_out],
        "parts": _materials(mesh.part_names, given, report),
        "part_classes": _part_classes(mesh.part_names, given, report),
        "taxonomy": Taxonomy(**fields).model_dump(mode="json"),
    }
    return table, report


def _report_known(fields: dict[str, Any], known: Mapping[str, Any], given: MeshOptions, report: list[str]) -> None:
    """Report which words of the taxonomy are missing, and how to give them."""
    options = {"object_class": "--class", "subclass": "--subclass", "shape_family": "--shape"}
    options["stabilisation"] = "--stabilisation"
    guessed = [key for key in options if given.taxonomy.get(key) is None and key not in known]
    if guessed:
        words = ", ".join(str(fields[key]).replace("_", " ") for key in guessed)
        report.append(f"assumed    {words}: correct with {', '.join(options[key] for key in guessed)}")


def _scale(mesh: Mesh, known: Mapping[str, Any], given: MeshOptions, unit_m: float | None, report: list[str]) -> float:
    """Return the metres in one unit of the file, and report where the number comes from.

    Parameters
    ----------
    unit_m : metres in the unit that the file states, None where it states none

    Raises
    ------
    MeshError
        If the unit cannot be guessed.
    """
    longest = float(mesh.size_m.max())
    if given.size_m is not None:
        return given.size_m / longest
    if given.scale is not None:
        return given.scale
    if known:
        return 1.0 / float(known["units_per_metre"])
    if unit_m is not None:
        report.append(f"unit       as the file states: {longest * unit_m:.4g} m across")
        return unit_m
    metres, lines = guess_scale(mesh)
    report += lines
    return metres


def _materials(parts: tuple[str, ...], given: MeshOptions, report: list[str]) -> dict[str, str]:
    """Return the material of every part; raise `MeshError` if a material or a part is unknown."""
    for name in (*([given.material] if given.material else []), *given.part_materials.values()):
        if name not in load_materials():
            guess = did_you_mean(name, load_materials())
            raise MeshError(f"material '{name}': is not in the catalogue{guess} (known: {', '.join(load_materials())})")
    _check_parts(given.part_materials, parts)
    by_name = {} if given.material else materials_of(parts)
    default = given.material or _DEFAULT
    chosen = {part: given.part_materials.get(part, by_name.get(part, default)) for part in parts}
    if by_name:
        named = ", ".join(f"{part} = {by_name[part]}" for part in by_name if part not in given.part_materials)
        report.append(f"guessed    materials by name: {named}")
    bare = [part for part in parts if part not in by_name and part not in given.part_materials]
    if bare and not given.material:
        report.append(f"assumed    {_DEFAULT} for {_list_parts(bare)}: correct with --material or --part-material")
    return chosen


def _check_parts(named: Iterable[str], parts: tuple[str, ...]) -> None:
    for part in named:
        if part not in parts:
            raise MeshError(f"part '{part}': is not in the mesh{did_you_mean(part, parts)} ({_list_parts(parts)})")


def _list_parts(parts: Iterable[str]) -> str:
    return shorten(", ".join(parts), _LONGEST_LIST, placeholder=" ...")


def _part_classes(parts: tuple[str, ...], given: MeshOptions, report: list[str]) -> dict[str, str]:
    """Return the common class of every part; raise `MeshError` if a class or a part is unknown."""
    _check_parts(given.part_classes, parts)
    for kind in given.part_classes.values():
        if kind not in PART_CLASSES:
            guess = did_you_mean(kind, PART_CLASSES)
            raise MeshError(f"part class '{kind}': is unknown{guess} (known: {', '.join(PART_CLASSES)})")
    guessed = guess_part_classes(part for part in parts if part not in given.part_classes)
    if named := [f"{part} = {kind}" for part, kind in guessed.items() if kind != OTHER]:
        report.append(f"guessed    part classes by name: {', '.join(named)}")
    if others := [part for part, kind in guessed.items() if kind == OTHER]:
        report.append(f"assumed    part class {OTHER} for {_list_parts(others)}: correct with --part-class")
    return {part: given.part_classes.get(part, guessed.get(part, OTHER)) for part in parts}


def _write_index(folder: Path, tables: list[dict[str, Any]]) -> None:
    import tomli_w

    with write_atomically(folder / "index.toml") as draft:
        draft.write_text(_HEAD + tomli_w.dumps({"model": tables}), encoding="utf-8")
