"""Optical presets of the models: the entries of models/materials.toml, at 1064 nm and at 1570 nm.

Each preset divides a total hemispherical reflectance into a diffuse and a specular share, as in the modified Phong model
(Lafortune & Willems 1994: kd/pi + ks (n+2)/(2 pi) cos^n). Totals come from tabulated data; the division into shares is an
engineering default. Where a measurement of the material is public, the source cites it and says how far the preset is off.
"""

from __future__ import annotations

from typing import Any

from models.build.measured import describe_measurements
from models.build.spectra import scale_spectrum
from rso_lidar import units
from rso_lidar.scene import total_reflectance

UNCALIBRATED = "uncalibrated engineering default"


def _phong(
    what: str,
    source: str,
    confidence: str,
    lobe: tuple[float, float, float],
    rgb: tuple[float, float, float],
    at_1570_nm: tuple[float, float, float] | None = None,
    crinkled: dict[str, float] | None = None,
) -> dict[str, Any]:
    """Make the entry of a modified Phong surface for materials.toml.

    Parameters
    ----------
    what, source, confidence : texts of the entry
    lobe : k_d, k_s and n at 1064 nm
    rgb : colour on screen, 0 to 1
    at_1570_nm : k_d, k_s and n at 1570 nm; by default those at 1064 nm
    crinkled : `tilt_deg` and `cell_mm` of creased foil
    """
    keys = ("diffuse", "specular", "exponent")
    return {
        "type": "crinkled" if crinkled else "phong",
        **dict(zip(keys, lobe, strict=True)),
        **(crinkled or {}),
        "at_1570_nm": dict(zip(keys, at_1570_nm or lobe, strict=True)),
        "what": what,
        "source": source,
        "confidence": f"{confidence}; split and exponent: {UNCALIBRATED}",
        "display_rgb": list(rgb),
    }


def _lambertian(
    what: str,
    source: str,
    confidence: str,
    reflectance: tuple[float, float],
    rgb: tuple[float, float, float],
) -> dict[str, Any]:
    """Make the entry of a Lambertian surface for materials.toml.

    Parameters
    ----------
    what, source, confidence : texts of the entry
    reflectance : at 1064 nm and at 1570 nm
    rgb : colour on screen, 0 to 1
    """
    return {
        "type": "lambertian",
        "reflectance": reflectance[0],
        "at_1570_nm": {"reflectance": reflectance[1]},
        "what": what,
        "source": source,
        "confidence": confidence,
        "display_rgb": list(rgb),
    }


_FOIL = {
    "tilt_deg": 5.0,
    "cell_mm": 50.0,
}  # the mean over cells equals that of the smooth material; the size of a crease is assumed

MATERIALS: dict[str, dict[str, Any]] = {
    "lambertian_30": {
        "type": "lambertian",
        "reflectance": 0.30,
        "at_1570_nm": {"reflectance": 0.30},
        "what": "The default surface of the paper: Lambertian, reflectance 0.30 at every wavelength",
        "source": "Paper on Global Shutter Flash LiDAR simulation, section 5",
        "confidence": "a definition, not a measurement",
        "display_rgb": [0.62, 0.62, 0.62],
    },
    "mli_gold": _phong(
        "Multi-layer insulation, aluminised Kapton, creases as one lobe; total 0.80-0.88 at 1064 nm, 0.85-0.90 at 1570 nm",
        "Bare aluminium 0.95 (Rakic 1995, McPeak 2015 n,k) seen through Kapton",
        "medium",
        (0.15, 0.65, 30.0),
        (0.83, 0.62, 0.22),
        (0.16, 0.71, 30.0),
    ),
    "mli_silver": _phong(
        "Multi-layer insulation, aluminium outward, creases as one lobe; total 0.92-0.95 at 1064 nm, 0.95-0.97 at 1570 nm",
        "Bare aluminium 0.95 at 1064 nm (Rakic 1995, McPeak 2015 n,k)",
        "medium",
        (0.10, 0.80, 30.0),
        (0.80, 0.81, 0.83),
        (0.10, 0.86, 30.0),
    ),
    "solar_cell": _phong(
        "Triple-junction solar cell under cover glass; total 0.05-0.15 at 1064 nm, 0.10-0.25 at 1570 nm",
        "Range of published cell reflectances; first-surface glint of the cover glass as a narrow lobe",
        "low",
        (0.02, 0.08, 1000.0),
        (0.10, 0.12, 0.32),
        (0.03, 0.14, 1000.0),
    ),
    "solar_cell_si": _phong(
        "Silicon solar cell (1970s to 2000s); total 0.31 at 1064 nm, 0.86 at 1570 nm",
        "One GPS solar cell (Reyes et al. 2021); silicon grows transparent past 1.1 um and shows its back contact",
        "medium, one sample; at 1064 nm on a steep edge, which moves with temperature",
        (0.05, 0.26, 1000.0),
        (0.08, 0.10, 0.28),
        (0.14, 0.72, 1000.0),
    ),
    "white_paint": _phong(
        "White thermal paint (Z93, S13, A276 class); total 0.80-0.90 at 1064 nm, 0.65-0.80 at 1570 nm",
        "Published range for the class",
        "medium",
        (0.80, 0.02, 10.0),
        (0.92, 0.92, 0.90),
        (0.70, 0.02, 10.0),
    ),
    "black_paint": _phong(
        "Black optical paint (Z306 class); total 0.04-0.05 at 1064 and 1570 nm",
        "Published range for the class",
        "high",
        (0.04, 0.01, 20.0),
        (0.06, 0.06, 0.06),
    ),
    "black_anodise": _phong(
        "Black dyed anodise; total 0.3-0.6 at 1064 and 1570 nm, for the dye is transparent in the near infrared",
        "Published range for the class",
        "medium",
        (0.35, 0.05, 20.0),
        (0.12, 0.12, 0.13),
    ),
    "aluminium": _phong(
        "Machined or clear-anodised aluminium; total 0.60-0.75 at 1064 nm, 0.75-0.85 at 1570 nm; for other metals too",
        "Bare smooth aluminium 0.95 (Rakic 1995, McPeak 2015 n,k) less roughness and oxide",
        "medium",
        (0.25, 0.40, 60.0),
        (0.66, 0.67, 0.69),
        (0.30, 0.50, 60.0),
    ),
    "cfrp": _phong(
        "Bare carbon-fibre composite; total 0.05-0.10 at 1064 nm, 0.06-0.12 at 1570 nm",
        "Published range for the class",
        "low",
        (0.05, 0.03, 30.0),
        (0.18, 0.18, 0.19),
        (0.055, 0.035, 30.0),
    ),
    "osr": _phong(
        "Optical solar reflector or silvered Teflon, a mirror; total 0.95-0.97 at 1064 nm, 0.96 at 1570 nm",
        "Bare silver 0.99 (Johnson & Christy 1972, Ciesielski 2017 n,k) behind silica or Teflon",
        "medium",
        (0.02, 0.94, 3000.0),
        (0.75, 0.82, 0.90),
    ),
    "lens_glass": _phong(
        "Polished front lens, coated for other wavelengths; first surface 0.035-0.042, little wavelength dependence",
        "Fresnel reflectance at normal incidence for refractive indices of 1.46 to 1.52",
        "medium",
        (0.01, 0.04, 3000.0),
        (0.20, 0.24, 0.30),
    ),
    "mli_gold_crinkled": _phong(
        "The same as mli_gold, cell by cell: flat pieces of foil with slopes of 5 degrees; glints sparkle",
        "Bare aluminium 0.95 (Rakic 1995, McPeak 2015 n,k) seen through Kapton",
        "medium; tilt and size of the creases are assumed",
        (0.15, 0.65, 300.0),
        (0.83, 0.62, 0.22),
        (0.16, 0.71, 300.0),
        _FOIL,
    ),
    "mli_silver_crinkled": _phong(
        "The same as mli_silver, cell by cell: flat pieces of foil with slopes of 5 degrees; glints sparkle",
        "Bare aluminium 0.95 at 1064 nm (Rakic 1995, McPeak 2015 n,k)",
        "medium; tilt and size of the creases are assumed",
        (0.10, 0.80, 300.0),
        (0.80, 0.81, 0.83),
        (0.10, 0.86, 300.0),
        _FOIL,
    ),
    "clear_anodise": _phong(
        "Clear-anodised aluminium; total 0.50-0.60 at 1064 nm, 0.60 at 1570 nm",
        "Published range for the class",
        "medium",
        (0.25, 0.30, 60.0),
        (0.72, 0.73, 0.74),
        (0.27, 0.33, 60.0),
    ),
    "aluminium_bare": _phong(
        "Polished or vapour-deposited aluminium; total 0.95 at 1064 nm, 0.975 at 1570 nm",
        "Normal reflectance from n,k: Rakic 1995 (0.950, 0.975), McPeak 2015 (0.954, 0.974)",
        "high",
        (0.05, 0.90, 300.0),
        (0.78, 0.79, 0.81),
        (0.05, 0.92, 300.0),
    ),
    "gold_bare": _phong(
        "Polished or plated gold; total 0.975 at 1064 nm, 0.98 at 1570 nm",
        "Normal reflectance from n,k: Johnson & Christy 1972 (0.979, 0.982), Ciesielski 2017 (0.972, 0.981)",
        "high",
        (0.05, 0.92, 300.0),
        (0.90, 0.70, 0.25),
        (0.05, 0.93, 300.0),
    ),
    "silver_bare": _phong(
        "Polished or vapour-deposited silver; total 0.99 at 1064 and 1570 nm",
        "Normal reflectance from n,k: Johnson & Christy 1972 (0.997, 0.996), Ciesielski 2017 (0.988, 0.989)",
        "high",
        (0.04, 0.95, 300.0),
        (0.86, 0.87, 0.88),
    ),
    "titanium_bare": _phong(
        "Bare titanium, as of bottles and nozzles; total 0.615 at 1064 nm, 0.66 at 1570 nm",
        "Normal reflectance from n,k: Johnson & Christy 1974 (0.615, 0.661)",
        "high",
        (0.20, 0.41, 60.0),
        (0.54, 0.53, 0.52),
        (0.22, 0.44, 60.0),
    ),
    "ablator": _lambertian(
        "Charred ablative heat shield: carbon char, matt",
        "Range for carbon chars and black composites; no measurement at these wavelengths was found",
        "low; uncalibrated engineering default",
        (0.08, 0.09),
        (0.16, 0.13, 0.11),
    ),
    "cube_corner": {
        "type": "retro_reflector",
        "diameter_mm": 12.7,
        "reflectance": 0.85,
        "fill_fraction": 0.6,
        "diffuse": 0.05,
        "at_1570_nm": {"reflectance": 0.85},
        "what": "Array of cube corners of 12.7 mm, as on docking aids and small ranging arrays; coated back faces",
        "source": "Degnan 1993 for the cross-section; reflectance and packing of common arrays are assumed",
        "confidence": "high for the law, low for reflectance and packing; uncalibrated engineering default",
        "display_rgb": [0.62, 0.80, 0.88],
    },
    "regolith_highland": _lambertian(
        "Lunar highland soil as a lidar sees it, at zero phase: normal albedo 0.35 at 1064 nm",
        "Mapped at zero phase by LOLA (Lucey et al. 2014, J. Geophys. Res. Planets 119); the number as commonly quoted, not "
        "looked up; 1570 nm by the red slope of lunar spectra, assumed 15 % brighter",
        "medium at 1064 nm, low at 1570 nm; falls off with phase, so too bright for a Sun away from the lens",
        (0.35, 0.40),
        (0.60, 0.59, 0.57),
    ),
    "regolith_mare": _lambertian(
        "Lunar mare soil as a lidar sees it, at zero phase: normal albedo 0.20 at 1064 nm",
        "Mapped at zero phase by LOLA (Lucey et al. 2014, J. Geophys. Res. Planets 119); the number as commonly quoted, not "
        "looked up; 1570 nm by the red slope of lunar spectra, assumed 15 % brighter",
        "medium at 1064 nm, low at 1570 nm; falls off with phase, so too bright for a Sun away from the lens",
        (0.20, 0.23),
        (0.42, 0.41, 0.40),
    ),
}
for _name, _table in MATERIALS.items():
    if _below := scale_spectrum(_name, total_reflectance(_table, 1064.0 * units.NM)):
        _table["below_1064_nm"] = _below
    if _measured := describe_measurements(_name.removesuffix("_crinkled"), _table):
        _table["source"] = f"{_table['source']}. {_measured}"
