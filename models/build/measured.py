"""Measured reflectances of space materials, and how far the presets are from them.

Each figure is a total reflectance of one flat, new sample at near-normal incidence, or a mean over the solar spectrum.
None says how the light is divided into directions: the lobes of all presets stay assumed.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any, NamedTuple

from rso_lidar import units
from rso_lidar.optics import sun_photons_per_s_m2
from rso_lidar.scene import total_reflectance

SOLAR = 0.0  # in place of a wavelength: mean over the solar spectrum, one less the solar absorptance

_REYES = "Reyes et al. 2021 (Acta Astronautica 189, 576), new samples, curves digitised in Macqadoo/lumos-sat"
_FORTESCUE = "Fortescue, Swinerd and Stark 2011 (Spacecraft Systems Engineering, 4th ed.), table 11.3"
_HENNINGER = "Henninger 1984 (NASA RP-1121), tables as copied in public code"
_REFRACTIVE = "refractiveindex.info"


class Measurement(NamedTuple):
    """One measured reflectance that a preset is compared with.

    Parameters
    ----------
    material : name of the preset
    wavelength_nm : of the light [nm], or `SOLAR`
    reflectance : measured, total over all directions
    uncertainty : of reading and scale, about 1 sigma
    sample : what was measured
    source : where the figure stands
    """

    material: str
    wavelength_nm: float
    reflectance: float
    uncertainty: float
    sample: str
    source: str


# Two people digitised the solar cell: 0.295 and 0.329 at 1064 nm, on a steep edge, and 0.860 and 0.865 at 1570 nm. The
# scale of the Kapton curve passes 1 beyond 1.7 um, so it reads 2 to 4 % high. The curve of the black paint lies on the
# zero line at 1064 nm and ends at 1180 nm. The film behind Kapton of 25 um is computed from n and k of aluminium (Rakic
# 1995, McPeak 2015) and Kapton (French, n = 1.77, k = 4e-5 and 6e-5).
MEASUREMENTS = (
    Measurement("mli_gold", 1064.0, 0.93, 0.03, "flat aluminised Kapton", _REYES),
    Measurement("mli_gold", 1570.0, 1.00, 0.04, "flat aluminised Kapton", _REYES),
    Measurement("mli_gold", 1064.0, 0.90, 0.02, "aluminium behind 25 µm of Kapton, from n and k", _REFRACTIVE),
    Measurement("mli_gold", 1570.0, 0.93, 0.02, "aluminium behind 25 µm of Kapton, from n and k", _REFRACTIVE),
    Measurement("mli_gold", SOLAR, 0.60, 0.03, "aluminised Kapton, Kapton outside", _FORTESCUE),
    Measurement("mli_gold", SOLAR, 0.62, 0.02, "aluminised Kapton of 25 µm", _HENNINGER),
    Measurement("mli_gold", SOLAR, 0.59, 0.02, "aluminised Kapton of 50 µm", _HENNINGER),
    Measurement("mli_silver", 1064.0, 0.952, 0.002, "smooth aluminium, from n and k", _REFRACTIVE),
    Measurement("mli_silver", 1570.0, 0.975, 0.001, "smooth aluminium, from n and k", _REFRACTIVE),
    Measurement("mli_silver", SOLAR, 0.86, 0.02, "aluminised Kapton, aluminium outside", _FORTESCUE),
    Measurement("solar_cell", SOLAR, 0.12, 0.03, "GaAs cells, typical", _FORTESCUE),
    Measurement("solar_cell_si", 1064.0, 0.31, 0.02, "GPS solar cell, band edge at 1.1 µm", _REYES),
    Measurement("solar_cell_si", 1570.0, 0.86, 0.01, "GPS solar cell, band edge at 1.1 µm", _REYES),
    Measurement("solar_cell_si", SOLAR, 0.25, 0.03, "silicon cells, typical", _FORTESCUE),
    Measurement("solar_cell_si", SOLAR, 0.19, 0.02, "GPS solar cells", _HENNINGER),
    Measurement("white_paint", SOLAR, 0.88, 0.02, "silicate paint", _FORTESCUE),
    Measurement("white_paint", SOLAR, 0.74, 0.03, "silicone paint", _FORTESCUE),
    Measurement("white_paint", SOLAR, 0.83, 0.02, "Z-93", _HENNINGER),
    Measurement("white_paint", SOLAR, 0.8, 0.02, "S-13G", _HENNINGER),
    Measurement("white_paint", SOLAR, 0.74, 0.02, "A-276", _HENNINGER),
    Measurement("black_paint", 1064.0, 0.00, 0.01, "RM-550, at the zero of the scale", _REYES),
    Measurement("black_paint", SOLAR, 0.05, 0.01, "polyurethane paint", _FORTESCUE),
    Measurement("black_paint", SOLAR, 0.04, 0.01, "Z306", _HENNINGER),
    Measurement("black_anodise", SOLAR, 0.12, 0.02, "black anodise, one sample", _HENNINGER),
    Measurement("black_anodise", SOLAR, 0.35, 0.02, "black anodise, another sample", _HENNINGER),
    Measurement("clear_anodise", SOLAR, 0.73, 0.02, "clear anodise, one sample", _HENNINGER),
    Measurement("clear_anodise", SOLAR, 0.65, 0.02, "clear anodise, another sample", _HENNINGER),
    Measurement("cfrp", 1064.0, 0.039, 0.005, "carbon-carbon composite, without resin", _REYES),
    Measurement("cfrp", 1570.0, 0.031, 0.005, "carbon-carbon composite, without resin", _REYES),
    Measurement("osr", SOLAR, 0.93, 0.01, "optical solar reflector", _FORTESCUE),
    Measurement("aluminium_bare", SOLAR, 0.92, 0.01, "aluminium on glass", _HENNINGER),
    Measurement("gold_bare", SOLAR, 0.81, 0.01, "gold on glass", _HENNINGER),
    Measurement("gold_bare", SOLAR, 0.77, 0.02, "electroplated gold", _HENNINGER),
    Measurement("silver_bare", SOLAR, 0.96, 0.01, "silver on glass", _HENNINGER),
    Measurement("titanium_bare", SOLAR, 0.48, 0.02, "titanium on glass", _HENNINGER),
)


def preset_reflectance(table: Mapping[str, Any], wavelength_nm: float) -> float:
    """Return the total reflectance of a preset's entry at a wavelength [nm], or its mean over sunlight for `SOLAR`.

    Parameters
    ----------
    table : entry of materials.toml
    """
    if wavelength_nm != SOLAR:
        return total_reflectance(table, wavelength_nm * units.NM)
    return sum(share * total_reflectance(table, middle_m) for middle_m, share in _share_sunlight())


@functools.cache
def _share_sunlight() -> tuple[tuple[float, float], ...]:
    """Return the middles [m] of bands from 300 to 2500 nm, and the share of the Sun's energy in each."""
    middles_m = [(312.5 + 25.0 * k) * units.NM for k in range(88)]
    energy = [sun_photons_per_s_m2(at_m, 25.0 * units.NM) * units.photon_energy_j(at_m) for at_m in middles_m]
    return tuple((at_m, part / sum(energy)) for at_m, part in zip(middles_m, energy, strict=True))


def describe_measurements(name: str, table: Mapping[str, Any]) -> str:
    """Describe what was measured of a preset's material, and how far the preset is off; empty if nothing was found.

    Parameters
    ----------
    name, table : of the entry in materials.toml
    """
    texts = []
    for one in MEASUREMENTS:
        if one.material == name:
            at = "over the solar spectrum" if one.wavelength_nm == SOLAR else f"at {one.wavelength_nm:.0f} nm"
            off = preset_reflectance(table, one.wavelength_nm) - one.reflectance
            texts.append(f"{one.reflectance:.2f} {at} ({one.sample}; preset {off:+.2f})")
    if not texts:
        return ""
    return "Measured: " + "; ".join(texts) + ". Sources: docs/calibration.md"
