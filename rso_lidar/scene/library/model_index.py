"""The catalogue of models and materials: those shipped in models/, and a user's own models."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, Strict, ValidationError, model_validator

from rso_lidar.errors import MeshError, RsoLidarError, ScenarioError, did_you_mean, has_warnings_enabled, warn
from rso_lidar.files import MOST_BYTES, read_bytes, read_text
from rso_lidar.part import MOST_TOML_BYTES, Count, NotNegative, Positive, Text, Vector, Whole, explain, parse_toml
from rso_lidar.records import OTHER, PART_CLASSES, Hinge, Keypoint, PartClass, Symmetry, Taxonomy
from rso_lidar.scene.meshes.facet_groups import group_facets
from rso_lidar.scene.meshes.mesh import Mesh, load_mesh, normalize_mesh
from rso_lidar.shipped import shipped
from rso_lidar.user_settings import get_setting

_INSTALL_AGAIN = "install the package again (in a checkout: `make models`)"
_OWN_CURE = "correct that line, or add the mesh again with `rso-lidar models add --overwrite`"
_TABLE = "material_names.toml"  # in models/, and beside the user's own index: materials by names of groups


class ModelEntry(BaseModel):
    """Entry of the index about one model.

    Attributes
    ----------
    name, file, what, source, licence, confidence
        Text; `source` and `confidence` state which figures are published and which are guesses
    axes
        Which direction of the craft each axis of the mesh is, in words
    size_m
        Extents along x, y, z [m]
    facets, size_bytes, sha256
        Of the file
    center_of_mass_m
        In mesh coordinates [m], estimated
    mass_kg
        Estimated [kg]; None where there is no estimate, as for a user's own model
    inertia_kg_m2
        Rows of the tensor about the centre of mass, in the axes of the mesh [kg m2], estimated; or None
    parts
        Name of the material by name of the part
    part_classes
        Common part class by name of the part
    taxonomy
        Class, shape, size and rotation
    hinges
        Parts that turn, and their axes, in mesh coordinates
    keypoints
        Named points, in mesh coordinates with all hinges at zero
    symmetry
        Rotations that a lidar cannot tell apart, in mesh coordinates with all hinges at zero; None where there are none
    path
        Path of the mesh file
    scale, mesh_axes, left_out
        How the file becomes the mesh that the other fields describe: metres in one unit of the file, "z_up" or "y_up".
        First and last facet (numbers in the file) of each run that does not belong to the craft
    facet_parts, facet_parts_sha256
        Name of the table beside the mesh that says which facet belongs to what part, and its hash; None where the file's own
        names count
    own
        Whether the model is from the user's own library
    """

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False, defer_build=True, frozen=True, populate_by_name=True)

    name: Text
    file: Text
    what: Text
    source: Text
    licence: Text
    confidence: Text
    axes: Text
    size_m: tuple[NotNegative, NotNegative, NotNegative]
    facets: Count
    size_bytes: Count
    sha256: Annotated[str, Strict(), Field(pattern="^[0-9a-f]{64}$")]
    center_of_mass_m: Vector
    mass_kg: Positive | None = None
    inertia_kg_m2: tuple[Vector, Vector, Vector] | None = None
    parts: dict[Text, Text]
    part_classes: dict[Text, PartClass] = {}
    taxonomy: Taxonomy
    hinges: tuple[Hinge, ...] = Field(default=(), alias="hinge")  # as the tables of the index are called
    keypoints: tuple[Keypoint, ...] = Field(default=(), alias="keypoint")
    symmetry: Symmetry | None = None
    scale: Positive = 1.0
    mesh_axes: Literal["z_up", "y_up"] = "z_up"
    left_out: tuple[tuple[Whole, Whole], ...] = ()
    facet_parts: Text | None = None
    facet_parts_sha256: Text | None = None
    path: Path
    own: bool = False

    @model_validator(mode="after")
    def _runs_in_order(self) -> Self:
        if any(not 0 <= first <= last for first, last in self.left_out):
            raise ValueError("left_out: the first facet of a run is after its last; exchange them")
        return self

    @property
    def mesh(self) -> Mesh:
        """Mesh in metres and in the model's axes, without the facets that are left out."""
        mesh = load_mesh(self.path)
        if self.own and mesh.sha256 != self.sha256:
            raise MeshError(f"{self.path}: is not the file that was added as '{self.name}'; add it again (--overwrite)")
        if self.facet_parts is not None:
            table = self.path.with_name(Path(self.facet_parts).name)
            if hash_table(table) != self.facet_parts_sha256:
                raise MeshError(
                    f"{table}: is not the table that was added with '{self.name}'; add it again (--overwrite)"
                )
            mesh = _group_once(mesh, table, self.facet_parts_sha256)
        return normalize_mesh(mesh, self.scale, self.mesh_axes, self.left_out)


def hash_table(table: Path) -> str:
    """Return the SHA-256 of a table of facets, or raise `MeshError`."""
    return hashlib.sha256(read_bytes(table, MOST_BYTES, MeshError, "table (.csv)")).hexdigest()


@functools.lru_cache(maxsize=16)
def _group_once(mesh: Mesh, table: Path, _sha256: str | None) -> Mesh:
    return group_facets(mesh, table)


def models() -> dict[str, ModelEntry]:
    """Return every model of the catalogue by name.

    >>> [name for name in models() if name.startswith("cubesat")]
    ['cubesat_1u', 'cubesat_3u', 'cubesat_6u', 'cubesat_12u']
    """
    return dict(_shipped_models())


def model(name: str) -> ModelEntry:
    """Find a model by name, among the shipped ones and those of the user's library.

    Parameters
    ----------
    name : name of the model

    Returns
    -------
    entry of the index.

    Raises
    ------
    MeshError
        If no model has this name, or its entry is invalid.

    Examples
    --------
    >>> model("plate").size_m
    (0.002, 4.0, 4.0)
    """
    known = _shipped_models()
    if name in known:
        _tell_of_shadow(name)
        return known[name]
    own, broken = _own()
    if name in broken:
        raise MeshError(broken[name])
    if name not in own:
        both = [*known, *own]
        raise ScenarioError(
            f"unknown model '{name}'{did_you_mean(name, both)} (known: {', '.join(both)}); "
            "add your own mesh with `rso-lidar models add`"
        )
    return own[name]


def is_mesh_path(name: str) -> bool:
    """Return whether the name of a shape is the path of a file, and no model of the catalogue.

    Parameters
    ----------
    name : as a target gives it; a path has a slash or a suffix
    """
    return any(sign in name for sign in "/\\.")


def _tell_of_shadow(name: str) -> None:
    """Warn, once a process, that a shipped model hides one of the user's own of the same name."""
    if not has_warnings_enabled():
        return
    try:
        hidden = name in _own()[0]
    except RsoLidarError:
        return
    if hidden:
        shadow = f"model '{name}': is shipped, and also in your library; the shipped one is used: rename yours"
        warn(shadow, about=(own_folder(), name))


def own_folder() -> Path:
    """Return the folder of the user's own library: the one that the user sets, else the platform's for user data."""
    folder: Path | None = get_setting("models_folder")
    if folder:
        return folder
    from platformdirs import user_data_path

    return user_data_path("rso_lidar", appauthor=False) / "models"


def own_models() -> dict[str, ModelEntry]:
    """Return the models of the user's own library by name, none where there is no library.

    An entry that cannot be read is left out, with one warning. `model` raises the reason for it.
    """
    good, broken = _own()
    for reason in broken.values():
        warn(reason, about=reason)
    return dict(good)


def _own() -> tuple[Mapping[str, ModelEntry], Mapping[str, str]]:
    """Return the user's own models by name, and by name why others cannot be read."""
    path = own_folder() / "index.toml"
    try:
        status = path.stat()
    except OSError:
        return {}, {}
    return _own_models(path, (status.st_mtime_ns, status.st_size, status.st_ino))


@functools.lru_cache(maxsize=4)
def _own_models(path: Path, _stamp: tuple[int, int, int]) -> tuple[Mapping[str, ModelEntry], Mapping[str, str]]:
    good: dict[str, ModelEntry] = {}
    broken: dict[str, str] = {}
    for table in read_own_index(path):
        try:
            entry = own_entry(path, table)
            good[entry.name] = entry
        except MeshError as error:
            broken[str(table.get("name", "?"))] = str(error)
    return MappingProxyType(good), MappingProxyType(broken)


def own_entry(path: Path, table: dict[str, Any]) -> ModelEntry:
    """Return the entry of one table of the user's index at `path`, or raise `MeshError` with the cure."""
    return _entry(path, table, _OWN_CURE, own=True)


def read_own_index(path: Path) -> list[dict[str, Any]]:
    """Read the tables of a user's index; none where there is no index."""
    if not path.exists():
        return []
    tables = read_table(path, "correct it").get("model", [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise MeshError(f"{path}: 'model' is not a list of [[model]]; correct it")
    return tables


def load_materials() -> dict[str, dict[str, Any]]:
    """Return every material of the catalogue by name: the fields of its BRDF, their source, and a display colour."""
    return {name: dict(table) for name, table in _shipped_materials().items()}


def read_models(folder: Path) -> dict[str, ModelEntry]:
    """Read the models that the index in `folder` lists, by name."""
    path = folder / "index.toml"
    entries = read_table(path).get("model", [])
    if not isinstance(entries, list) or not entries:
        raise MeshError(f"{path}: lists no [[model]]; {_INSTALL_AGAIN}")
    return {entry.name: entry for entry in (_entry(path, table) for table in entries)}


def read_materials(folder: Path) -> dict[str, dict[str, Any]]:
    """Read the materials that `folder` lists, by name."""
    path = folder / "materials.toml"
    tables = read_table(path)
    for name, table in tables.items():
        if not isinstance(table, dict) or "type" not in table:
            raise MeshError(f"{path}: {name}: has no 'type'; {_INSTALL_AGAIN}")
    return tables


@functools.cache
def _shipped_models() -> Mapping[str, ModelEntry]:
    return MappingProxyType(read_models(shipped("models")))


@functools.cache
def _shipped_materials() -> Mapping[str, dict[str, Any]]:
    return MappingProxyType(read_materials(shipped("models")))


def read_table(path: Path, cure: str = _INSTALL_AGAIN) -> dict[str, Any]:
    """Read a TOML file of a catalogue, or raise `MeshError` with the cure."""
    try:
        return parse_toml(read_text(path, MOST_TOML_BYTES, MeshError, "index (.toml)"), f"{path}", MeshError)
    except MeshError as error:
        reason = str(error).removeprefix(f"{path}: ").partition(";")[0]
        raise MeshError(f"{path}: cannot be read ({reason}); {cure}") from None


def guess_part_classes(parts: Iterable[str]) -> dict[str, PartClass]:
    """Return the common class of each part by its name, if a class or a part of a shipped model has it; else `other`.

    Parameters
    ----------
    parts : names of parts

    Examples
    --------
    >>> guess_part_classes(["antenna", "solar_array_left", "Object.003"])
    {'antenna': 'antenna', 'solar_array_left': 'solar_array', 'Object.003': 'other'}
    """
    known = {part: kind for entry in _shipped_models().values() for part, kind in entry.part_classes.items()}
    known |= {kind: kind for kind in PART_CLASSES}
    return {part: known.get(part, OTHER) for part in parts}


def _entry(path: Path, table: Any, cure: str = _INSTALL_AGAIN, *, own: bool = False) -> ModelEntry:
    """Check a table of the index and convert it to an entry.

    Parameters
    ----------
    path : path of the index, for messages

    Raises
    ------
    MeshError
        If the table lacks a key or has an invalid one.
    """
    name = str(table.get("name", "?"))[:60] if isinstance(table, dict) else "?"
    required = [key for key, field in ModelEntry.model_fields.items() if field.is_required() and key != "path"]
    missing = [key for key in required if not isinstance(table, dict) or key not in table]
    if missing:
        raise MeshError(f"{path}: model '{name}': lacks {', '.join(missing)}; {cure}")
    try:
        entry = ModelEntry(**{**table, "path": path.parent / str(table["file"]), "own": own})
    except ValidationError as error:
        raise MeshError(f"{path}: model '{name}': {explain(error, ModelEntry, table)}; {cure}") from None
    except ScenarioError as error:
        raise MeshError(f"{path}: model '{name}': {error}; {cure}") from None
    classes = (guess_part_classes(entry.parts) if own else dict.fromkeys(entry.parts, OTHER)) | entry.part_classes
    fixed = {"parts": MappingProxyType(entry.parts), "part_classes": MappingProxyType(classes)}
    return entry.model_copy(update=fixed)


def materials_of(groups: Iterable[str]) -> dict[str, str]:
    """Match groups to materials by name, first in the user's table; return the material of each group that matches.

    >>> materials_of(["foil_gold.001", "tex_01", "osr"])
    {'foil_gold.001': 'mli_gold', 'osr': 'osr'}
    """
    known = {name: name for name in load_materials()}
    lines = [*_read(own_folder() / _TABLE).items(), *known.items(), *_read(shipped("models") / _TABLE).items()]
    materials = {}
    for group in groups:
        fits = (material for pattern, material in lines if fnmatchcase(group.lower(), pattern.lower()))
        if (material := next(fits, None)) is not None:
            materials[group] = material
    return materials


def _read(path: Path) -> dict[str, str]:
    if not path.exists():
        return {}
    table = read_table(path, "correct it")
    known = load_materials()
    for pattern, material in table.items():
        if not isinstance(material, str) or material not in known:
            guess = did_you_mean(str(material), known)
            raise MeshError(f"{path}: '{pattern}': unknown material '{material}'{guess} (known: {', '.join(known)})")
    return table
