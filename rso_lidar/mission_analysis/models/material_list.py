"""The list of shipped materials, with their reflectance at the wavelengths of cameras and lasers."""

from __future__ import annotations

from dataclasses import dataclass

from rso_lidar import units
from rso_lidar.scene import load_materials, total_reflectance

_WAVELENGTHS_NM = (460.0, 535.0, 625.0, 850.0, 1064.0, 1570.0)


@dataclass(frozen=True)
class MaterialLine:
    """A material: kind of BRDF, total reflectance by wavelength [nm], and confidence in the numbers."""

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
        Each with reflectances at 1064 and 1570 nm, and in the middle of blue, green, red and near infrared bands.

    >>> [line.reflectance for line in list_materials() if line.name == "mli_silver"]
    [{460.0: 0.8725, 535.0: 0.8678, 625.0: 0.8612, 850.0: 0.8242, 1064.0: 0.9, 1570.0: 0.96}]
    """
    return [
        MaterialLine(
            name,
            entry["type"],
            entry["what"],
            {nm: round(total_reflectance(entry, nm * units.NM), 4) for nm in _WAVELENGTHS_NM},
            entry["confidence"],
        )
        for name, entry in load_materials().items()
    ]
