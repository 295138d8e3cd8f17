"""Reflectances of the presets below 1064 nm, for cameras and lasers of visible and near infrared light.

Each spectrum is that of a sample, at a few wavelengths between which it is nearly straight. It gives the preset its colour:
the ratio of the sample's reflectance to that of the same sample at 1064 nm, times the preset's total at 1064 nm. What the
preset differs by at 1064 nm, such as the light that creased foil loses, it then differs by everywhere. No spectrum says how
the light is divided into directions. The split and the lobe of 1064 nm stay, which is assumed.
"""

from __future__ import annotations

from typing import Any, NamedTuple

_REYES = "Reyes et al. 2021 (Acta Astronautica 189, 576), curve digitised in Macqadoo/lumos-sat"
_RAKIC = "Normal reflectance of smooth aluminium from n,k: Rakic 1995 (McPeak 2015 within 0.012)"
_HENNINGER = "Henninger 1984 (NASA RP-1121)"
_VELIKODSKY = "Velikodsky et al. 2011 (Icarus 214, 30), equivalent albedo at a phase of 6 deg"


class Spectrum(NamedTuple):
    """Total reflectance of a sample at ascending wavelengths [nm], and of the same sample at 1064 nm."""

    wavelength_nm: tuple[float, ...]
    reflectance: tuple[float, ...]
    at_1064_nm: float
    source: str
    confidence: str


_BANDS = (460.0, 535.0, 625.0, 850.0)
_ALUMINIUM = (_BANDS, (0.921, 0.916, 0.909, 0.870), 0.950)

# Presets without a spectrum are grey: lambertian_30 by definition.
SPECTRA = {
    "mli_gold": Spectrum(
        (460.0, 500.0, 535.0, 575.0, 625.0, 700.0, 850.0),
        (0.060, 0.084, 0.256, 0.474, 0.617, 0.707, 0.727),
        0.933,
        f"Flat aluminised Kapton: {_REYES}. Thinner film is paler: 0.31, 0.62, 0.78 and 0.77 at 460, 535, 625 and 850 nm "
        "by n,k of aluminium (Rakic 1995) behind 25 um of Kapton (French 2009)",
        "medium, one sample of unknown thickness",
    ),
    "mli_silver": Spectrum(*_ALUMINIUM, _RAKIC, "medium"),
    "solar_cell": Spectrum(
        (460.0, 535.0, 625.0, 700.0, 850.0),
        (0.039, 0.037, 0.040, 0.059, 0.10),
        0.10,
        "A GaAs cell without cover glass: Zilkova et al. 2025 (Acta Astronautica 236, 479), relative to silicon, curve "
        "digitised in Macqadoo/lumos-sat; at 850 nm the mean of its fringes from 0.05 to 0.18",
        "low; another cell, and its scale is assumed to be absolute",
    ),
    "solar_cell_si": Spectrum(
        (460.0, 535.0, 625.0, 750.0, 850.0, 1000.0),
        (0.054, 0.077, 0.056, 0.012, 0.002, 0.045),
        0.310,
        f"A GPS solar cell: {_REYES}, twice",
        "medium, one sample; at 850 nm at the zero of its scale",
    ),
    "white_paint": Spectrum(
        _BANDS,
        (0.88, 0.90, 0.90, 0.88),
        0.82,
        "Assumed: flat in visible light, so high that the mean over sunlight fits the solar absorptances of Z-93 and S-13G, "
        f"0.17 and 0.20 ({_HENNINGER})",
        "low; assumed",
    ),
    "black_paint": Spectrum(
        _BANDS,
        (0.045, 0.045, 0.045, 0.045),
        0.050,
        f"Z306 absorbs 0.96 of sunlight ({_HENNINGER}), polyurethane paint 0.95 (Fortescue et al. 2011); RM-550 is flat to "
        f"0.01 from 460 to 1064 nm ({_REYES})",
        "medium; that it is grey is assumed",
    ),
    "black_anodise": Spectrum(
        (460.0, 535.0, 625.0, 700.0, 850.0),
        (0.05, 0.05, 0.05, 0.08, 0.30),
        0.40,
        "Assumed: black to the eye, transparent dye beyond 700 nm. Two samples absorb 0.88 and 0.65 of sunlight "
        f"({_HENNINGER})",
        "low; assumed",
    ),
    "aluminium": Spectrum(*_ALUMINIUM, _RAKIC, "medium; the shape of smooth metal is assumed for machined metal"),
    "cfrp": Spectrum(
        _BANDS,
        (0.062, 0.066, 0.073, 0.081),
        0.080,
        f"Carbon-carbon composite, 0.021 to 0.040: {_REYES}; and 0.041 for the surface of the resin, assumed",
        "low",
    ),
    "osr": Spectrum(
        _BANDS,
        (0.950, 0.971, 0.979, 0.988),
        0.990,
        "Silver behind silica from n,k: mean of Johnson & Christy 1972 and Ciesielski 2017",
        "medium",
    ),
    "lens_glass": Spectrum(
        _BANDS,
        (0.0356, 0.0351, 0.0346, 0.0340),
        0.0337,
        "Fresnel reflectance of fused silica: Malitson 1965",
        "low; a coating for visible light has other colours",
    ),
    "clear_anodise": Spectrum(*_ALUMINIUM, _RAKIC, "medium; the oxide is assumed to be clear"),
    "aluminium_bare": Spectrum(*_ALUMINIUM, _RAKIC, "high"),
    "gold_bare": Spectrum(
        (460.0, 500.0, 535.0, 575.0, 625.0, 850.0),
        (0.384, 0.462, 0.694, 0.836, 0.912, 0.970),
        0.976,
        "Normal reflectance from n,k: mean of Johnson & Christy 1972 and Ciesielski 2017, which differ by up to 0.06",
        "high",
    ),
    "silver_bare": Spectrum(
        _BANDS,
        (0.960, 0.978, 0.985, 0.991),
        0.993,
        "Normal reflectance from n,k: mean of Johnson & Christy 1972 and Ciesielski 2017",
        "high",
    ),
    "titanium_bare": Spectrum(
        _BANDS,
        (0.547, 0.576, 0.611, 0.618),
        0.615,
        "Normal reflectance from n,k: Johnson & Christy 1974",
        "medium; vapour-deposited titanium absorbs 0.52 of sunlight, polished titanium 0.60",
    ),
    "ablator": Spectrum(
        _BANDS,
        (0.050, 0.055, 0.060, 0.075),
        0.080,
        "Assumed: reddish as carbon-carbon composite, but less so",
        "low; assumed",
    ),
    "cube_corner": Spectrum(
        _BANDS,
        (0.88, 0.86, 0.83, 0.68),
        1.0,
        "Three reflections by aluminium behind silica from n,k (Rakic 1995), over those at 1064 nm",
        "low; that the faces are aluminised is assumed",
    ),
    "regolith_highland": Spectrum(
        _BANDS,
        (0.124, 0.146, 0.168, 0.202),
        0.232,
        f"{_VELIKODSKY}; Apollo 16 soil 62231 is less red by 2 to 7 % (Pieters 1999, RELAB)",
        "medium; the level of 1064 nm, at zero phase, is too bright for a Sun away from the lens",
    ),
    "regolith_mare": Spectrum(
        _BANDS,
        (0.0758, 0.0890, 0.1031, 0.1250),
        0.1403,
        _VELIKODSKY,
        "medium; the level of 1064 nm, at zero phase, is too bright for a Sun away from the lens",
    ),
}


def scale_spectrum(name: str, total_at_1064_nm: float) -> dict[str, Any]:
    """Return the table `below_1064_nm` of a preset's entry, with the keys of `Spectrum`; empty for a grey preset.

    Parameters
    ----------
    name : of the preset; crinkled foil has the spectrum of smooth foil
    total_at_1064_nm : its total reflectance at 1064 nm
    """
    spectrum = SPECTRA.get(name.removesuffix("_crinkled"))
    if spectrum is None:
        return {}
    scale = total_at_1064_nm / spectrum.at_1064_nm
    return {
        "wavelength_nm": list(spectrum.wavelength_nm),
        "reflectance": [round(value * scale, 4) for value in spectrum.reflectance],
        "source": spectrum.source,
        "confidence": spectrum.confidence,
    }
