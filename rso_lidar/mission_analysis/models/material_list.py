"""The list of shipped materials, with their reflectance at the lasers' wavelengths."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rso_lidar.scene import load_materials


@dataclass(frozen=True)
class MaterialLine:
    """A material: kind of BRDF, total reflectance by the wavelength of a laser [nm], and confidence in the numbers."""

    name: str
    kind: str
    what: str
    reflectance: dict[float, float]
    confidence: str


def list_materials() -> list[MaterialLine]:
    """List the shipped materials in the order of their catalogue.

    Returns
    -------
    list of MaterialLine
        Each with reflectances at 1064 and 1570 nm.

    >>> [line.reflectance for line in list_materials() if line.name == "mli_gold"]
    [{1064.0: 0.8, 1570.0: 0.87}]
    """
    return [
        MaterialLine(
            name,
            table["type"],
            table["what"],
            {1064.0: _total_reflectance(table), 1570.0: _total_reflectance({**table, **table["at_1570_nm"]})},
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
