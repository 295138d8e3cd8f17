"""The catalogue of models and materials: those that travel with the package, in models/, and a user's own models."""

from __future__ import annotations

import functools
import math
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from rso_lidar.craft import Hinge, Taxonomy
from rso_lidar.errors import MeshError, RsoLidarError, ScenarioError, did_you_mean, placed, told, warn
from rso_lidar.scene.mesh import Mesh, load_mesh, mended
from rso_lidar.shipped import shipped

_WRITE_AGAIN = "write it again with `python -m rso_lidar.shapes.write`"
_told_of: set[tuple[Path, str]] = (
    set()
)  # libraries, and which of their models it has been said that a shipped one hides
_OWN_CURE = "mend that line, or add the mesh again with `rso-lidar models add --overwrite`"


@dataclass(frozen=True)
class ModelEntry:
    """What the index says about one model.

    Attributes
    ----------
    name, file, what, source, licence, confidence
        Text; `source` and `confidence` say which figures are published and which are guesses.
    axes
        Which direction of the craft each axis of the mesh is, in words.
    size_m
        Extents along x, y, z [m].
    facets, size_bytes, sha256
        Of the file.
    center_of_mass_m
        In mesh coordinates [m], estimated.
    mass_kg
        Estimated [kg]; None where nobody has, as of a user's own model.
    inertia_kg_m2
        Rows of the tensor about the centre of mass, in the axes of the mesh [kg m2], estimated; or None.
    parts
        Name of the material by name of the part.
    taxonomy
        Class, shape, size and how it turns.
    hinges
        What turns about what, in mesh coordinates.
    path
        Where the mesh file lies.
    scale, mesh_axes, left_out
        What turns the file into the mesh that all of the above speaks of: metres in one unit of the file, "z_up" or
        "y_up", and the first and the last facet (numbers in the file) of each run that is no part of the craft.
    own
        Whether it is of the user's own library.
    """

    name: str
    file: str
    what: str
    source: str
    licence: str
    confidence: str
    axes: str
    size_m: tuple[float, float, float]
    facets: int
    size_bytes: int
    sha256: str
    center_of_mass_m: tuple[float, float, float]
    mass_kg: float | None
    inertia_kg_m2: tuple[tuple[float, ...], ...] | None
    parts: Mapping[str, str]
    taxonomy: Taxonomy
    hinges: tuple[Hinge, ...]
    path: Path
    scale: float = 1.0
    mesh_axes: str = "z_up"
    left_out: tuple[tuple[int, int], ...] = ()
    own: bool = False

    @property
    def mesh(self) -> Mesh:
        """Return the mesh in metres and in the model's axes, without what is left out."""
        mesh = load_mesh(self.path)
        if self.own and mesh.sha256 != self.sha256:
            raise MeshError(f"{self.path}: is not the file that was added as '{self.name}'; add it again (--overwrite)")
        return mended(mesh, self.scale, self.mesh_axes, self.left_out)


def models() -> dict[str, ModelEntry]:
    """Return every model of the catalogue by name.

    >>> [name for name in models() if name.startswith("cubesat")]
    ['cubesat_1u', 'cubesat_3u', 'cubesat_6u', 'cubesat_12u']
    """
    return dict(_shipped_models())


def model(name: str) -> ModelEntry:
    """Return the model of that name.

    >>> model("plate").size_m
    (0.002, 4.0, 4.0)
    """
    known = _shipped_models()
    if name in known:
        _tell_of_shadow(name)
        return known[name]
    own = own_models()
    if name not in own:
        both = [*known, *own]
        raise ScenarioError(
            f"unknown model '{name}'{did_you_mean(name, both)} (known: {', '.join(both)}); "
            "a mesh of your own comes in with `rso-lidar models add`"
        )
    return own[name]


def _tell_of_shadow(name: str) -> None:
    """Warn, once a process, that a shipped model hides one of the user's own; an index that is broken hides none."""
    place = own_folder(), name
    if place in _told_of or not told():
        return
    try:
        hidden = name in own_models()
    except RsoLidarError:
        return
    if hidden:
        _told_of.add(place)
        warn(f"model '{name}': is shipped, and in your library too; the shipped one is taken: rename yours")


def own_folder() -> Path:
    """Return the folder of the user's own library: `RSO_LIDAR_MODELS`, else where the platform keeps such data."""
    if said := os.environ.get("RSO_LIDAR_MODELS"):
        return Path(said).expanduser()
    from platformdirs import user_data_path

    return user_data_path("rso_lidar", appauthor=False) / "models"


def own_models() -> dict[str, ModelEntry]:
    """Return the models of the user's own library by name, none where there is no library."""
    path = own_folder() / "index.toml"
    try:
        status = path.stat()
    except OSError:
        return {}
    return dict(_own_models(path, (status.st_mtime_ns, status.st_size, status.st_ino)))


@functools.lru_cache(maxsize=4)
def _own_models(path: Path, _stamp: tuple[int, int, int]) -> Mapping[str, ModelEntry]:
    tables = read_own_index(path)
    return MappingProxyType({entry.name: entry for entry in (_own_entry(path, table) for table in tables)})


def read_own_index(path: Path) -> list[dict[str, Any]]:
    """Return the tables of a user's index, none where there is none yet."""
    if not path.exists():
        return []
    tables = read_table(path, "mend it").get("model", [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise MeshError(f"{path}: 'model' is no list of [[model]]: mend it")
    return tables


def _own_entry(path: Path, table: dict[str, Any]) -> ModelEntry:
    """Return the entry of a user's own model; one who edits an index by hand is told where it went wrong."""
    entry = _entry(path, {"mass_kg": None, "inertia_kg_m2": None, **table}, _OWN_CURE)
    try:
        scale = float(table.get("scale", 1.0))
        left_out = tuple((int(first), int(last)) for first, last in table.get("left_out", ()))
    except (TypeError, ValueError) as error:
        raise MeshError(f"{path}: model '{entry.name}': scale or left_out: {error}: {_OWN_CURE}") from None
    mesh_axes = table.get("mesh_axes", "z_up")
    if not 0.0 < scale < math.inf or mesh_axes not in ("z_up", "y_up"):
        raise MeshError(f"{path}: model '{entry.name}': scale or mesh_axes is none: {_OWN_CURE}")
    return replace(entry, scale=scale, mesh_axes=mesh_axes, left_out=left_out, own=True)


def materials() -> dict[str, dict[str, Any]]:
    """Return every material of the catalogue by name: the fields of its BRDF, where they come from, how it looks."""
    return {name: dict(table) for name, table in _shipped_materials().items()}


def read_models(folder: Path) -> dict[str, ModelEntry]:
    """Return the models that the index in `folder` lists, by name."""
    path = folder / "index.toml"
    entries = read_table(path).get("model", [])
    if not isinstance(entries, list) or not entries:
        raise MeshError(f"{path}: lists no [[model]]: {_WRITE_AGAIN}")
    return {entry.name: entry for entry in (_entry(path, table) for table in entries)}


def read_materials(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the materials that `folder` lists, by name."""
    path = folder / "materials.toml"
    tables = read_table(path)
    for name, table in tables.items():
        if not isinstance(table, dict) or "type" not in table:
            raise MeshError(f"{path}: {name}: has no 'type': {_WRITE_AGAIN}")
    return tables


@functools.cache
def _shipped_models() -> Mapping[str, ModelEntry]:
    return MappingProxyType(read_models(shipped("models")))


@functools.cache
def _shipped_materials() -> Mapping[str, dict[str, Any]]:
    return MappingProxyType(read_materials(shipped("models")))


def read_table(
    path: Path, cure: str = "install the package again or run `python -m rso_lidar.shapes.write`"
) -> dict[str, Any]:
    """Return what a TOML file of a catalogue holds, or raise `MeshError` with the cure."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        reason = error.strerror or type(error).__name__
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        reason = str(error)
    raise MeshError(f"{path}: cannot be read ({reason}): {cure}")


def _entry(path: Path, table: Any, cure: str = _WRITE_AGAIN) -> ModelEntry:
    name = table.get("name", "?") if isinstance(table, dict) else "?"
    elsewhere = ("hinges", "path", "scale", "mesh_axes", "left_out", "own")
    wanted = [field.name for field in fields(ModelEntry) if field.name not in elsewhere]
    missing = [key for key in wanted if not isinstance(table, dict) or key not in table]
    if missing:
        raise MeshError(f"{path}: model '{name}': lacks {', '.join(missing)}: {cure}")
    values = {key: table[key] for key in wanted}
    try:
        for key in ("size_m", "center_of_mass_m"):
            x, y, z = (float(value) for value in values[key])
            values[key] = (x, y, z)
        if values["inertia_kg_m2"] is not None:
            values["inertia_kg_m2"] = tuple(tuple(row) for row in values["inertia_kg_m2"])
        values["parts"] = MappingProxyType(dict(values["parts"]))
        file = path.parent / str(table["file"])
        with placed(f"{path}: model '{name}'"):
            values["taxonomy"] = Taxonomy(**values["taxonomy"])
            values["hinges"] = tuple(Hinge(**hinge) for hinge in table.get("hinge", ()))
    except (TypeError, AttributeError) as error:
        raise MeshError(f"{path}: model '{name}': {error}: {cure}") from None
    return ModelEntry(**values, path=file)
