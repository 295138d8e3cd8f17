"""The list of shipped materials, with their reflectance at the lasers' wavelengths."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rso_lidar.scene import load_materials

WAVELENGTHS_NM = (1064.0, 1570.0)


@dataclass(frozen=True)
class MaterialLine:
    """A material: kind of BRDF, total reflectance at each of `WAVELENGTHS_NM`, and confidence in the numbers."""

    name: str
    kind: str
    what: str
    reflectance: tuple[float, float]
    confidence: str


def list_materials() -> list[MaterialLine]:
    """List the materials of the catalogue in its order.

    >>> [line.reflectance for line in list_materials() if line.name == "mli_gold"]
    [(0.8, 0.87)]
    """
    return [
        MaterialLine(
            name,
            table["type"],
            table["what"],
            (_total_reflectance(table), _total_reflectance({**table, **table["at_1570_nm"]})),
            table["confidence"],
        )
        for name, table in load_materials().items()
    ]


def _total_reflectance(table: Mapping[str, Any]) -> float:
    """Return the total reflectance over all directions."""
    if table["type"] == "lambertian":
        total = table["reflectance"]
    elif table["type"] == "retro_reflector":
        total = table["reflectance"] * table["fill_fraction"] + table["diffuse"]
    else:
        total = table["diffuse"] + table["specular"]
    return round(float(total), 4)
