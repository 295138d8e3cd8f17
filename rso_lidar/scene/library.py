"""The catalogue of models and materials that travel with the package: models/index.toml and models/materials.toml."""

from __future__ import annotations

import functools
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any

from rso_lidar.craft import Hinge, Taxonomy
from rso_lidar.errors import MeshError, ScenarioError, did_you_mean, placed
from rso_lidar.shipped import shipped


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
        Estimated [kg].
    inertia_kg_m2
        Rows of the tensor about the centre of mass, in the axes of the mesh [kg m2], estimated.
    parts
        Name of the material by name of the part.
    taxonomy
        Class, shape, size and how it turns.
    hinges
        What turns about what, in mesh coordinates.
    path
        Where the mesh file lies.
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
    mass_kg: float
    inertia_kg_m2: tuple[tuple[float, ...], ...]
    parts: Mapping[str, str]
    taxonomy: Taxonomy
    hinges: tuple[Hinge, ...]
    path: Path


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
    if name not in known:
        raise ScenarioError(f"unknown model '{name}'{did_you_mean(name, known)} (known: {', '.join(known)})")
    return known[name]


def materials() -> dict[str, dict[str, Any]]:
    """Return every material of the catalogue by name: the fields of its BRDF, where they come from, how it looks."""
    return {name: dict(table) for name, table in _shipped_materials().items()}


def read_models(folder: Path) -> dict[str, ModelEntry]:
    """Return the models that the index in `folder` lists, by name."""
    path = folder / "index.toml"
    entries = _read(path).get("model", [])
    if not isinstance(entries, list) or not entries:
        raise MeshError(f"{path}: lists no [[model]]: write it again with `python -m rso_lidar.shapes.write`")
    return {entry.name: entry for entry in (_entry(path, table) for table in entries)}


def read_materials(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the materials that `folder` lists, by name."""
    path = folder / "materials.toml"
    tables = _read(path)
    for name, table in tables.items():
        if not isinstance(table, dict) or "type" not in table:
            raise MeshError(f"{path}: {name}: has no 'type': write it again with `python -m rso_lidar.shapes.write`")
    return tables


@functools.cache
def _shipped_models() -> Mapping[str, ModelEntry]:
    return MappingProxyType(read_models(shipped("models")))


@functools.cache
def _shipped_materials() -> Mapping[str, dict[str, Any]]:
    return MappingProxyType(read_materials(shipped("models")))


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        reason = error.strerror or type(error).__name__
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        reason = str(error)
    raise MeshError(
        f"{path}: cannot be read ({reason}): install the package again or run `python -m rso_lidar.shapes.write`"
    )


def _entry(path: Path, table: Any) -> ModelEntry:
    name = table.get("name", "?") if isinstance(table, dict) else "?"
    wanted = [field.name for field in fields(ModelEntry) if field.name not in ("hinges", "path")]
    missing = [key for key in wanted if not isinstance(table, dict) or key not in table]
    if missing:
        cure = "write it again with `python -m rso_lidar.shapes.write`"
        raise MeshError(f"{path}: model '{name}': lacks {', '.join(missing)}: {cure}")
    values = {key: table[key] for key in wanted}
    for key in ("size_m", "center_of_mass_m"):
        values[key] = tuple(values[key])
    values["inertia_kg_m2"] = tuple(tuple(row) for row in values["inertia_kg_m2"])
    values["parts"] = MappingProxyType(dict(values["parts"]))
    with placed(f"{path}: model '{name}'"):
        values["taxonomy"] = Taxonomy(**values["taxonomy"])
        values["hinges"] = tuple(Hinge(**hinge) for hinge in table.get("hinge", ()))
    return ModelEntry(**values, path=path.parent / table["file"])
