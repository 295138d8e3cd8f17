"""Materials of the groups of a mesh file, by the groups' names: models/material_names.toml, and the user's own table."""

from __future__ import annotations

from collections.abc import Iterable
from fnmatch import fnmatchcase
from pathlib import Path

from rso_lidar.errors import MeshError, did_you_mean
from rso_lidar.scene.library.model_index import load_materials, own_folder, read_table
from rso_lidar.shipped import shipped

TABLE = "material_names.toml"


def materials_of(groups: Iterable[str]) -> dict[str, str]:
    """Match groups to materials by name, first in the user's table; return the material of each group that matches.

    >>> materials_of(["foil_gold.001", "tex_01", "osr"])
    {'foil_gold.001': 'mli_gold', 'osr': 'osr'}
    """
    known = {name: name for name in load_materials()}
    lines = [*_read(own_folder() / TABLE).items(), *known.items(), *_read(shipped("models") / TABLE).items()]
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
