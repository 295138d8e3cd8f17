"""What the catalogue's materials do with sunlight, over the whole solar spectrum."""

from __future__ import annotations

from typing import NamedTuple


class SolarFinish(NamedTuple):
    """Shares of sunlight that a material absorbs and reflects as a mirror, and whether the absorbed share is assumed.

    The split of the reflected light is assumed for every material, as that of its preset for lidars is.
    """

    absorbed: float
    specular: float
    is_assumed: bool = True


# Absorptances that are not assumed: Fortescue, Swinerd & Stark 2011, table 11.3, as docs/calibration.md quotes them.
SOLAR_FINISHES = {
    "mli_gold": SolarFinish(0.40, 0.49, is_assumed=False),
    "mli_gold_crinkled": SolarFinish(0.40, 0.49, is_assumed=False),
    "mli_silver": SolarFinish(0.14, 0.76, is_assumed=False),
    "mli_silver_crinkled": SolarFinish(0.14, 0.76, is_assumed=False),
    "solar_cell": SolarFinish(0.88, 0.10, is_assumed=False),
    "solar_cell_si": SolarFinish(0.75, 0.20, is_assumed=False),
    "white_paint": SolarFinish(0.19, 0.0, is_assumed=False),  # mean of silicate and silicone paint
    "black_paint": SolarFinish(0.95, 0.0, is_assumed=False),
    "osr": SolarFinish(0.07, 0.90, is_assumed=False),
    "black_anodise": SolarFinish(0.88, 0.0),
    "aluminium": SolarFinish(0.40, 0.30),
    "clear_anodise": SolarFinish(0.35, 0.20),
    "cfrp": SolarFinish(0.92, 0.0),
    "lens_glass": SolarFinish(0.90, 0.04),
    "aluminium_bare": SolarFinish(0.10, 0.80),
    "gold_bare": SolarFinish(0.25, 0.65),
    "silver_bare": SolarFinish(0.07, 0.85),
    "titanium_bare": SolarFinish(0.50, 0.30),
    "ablator": SolarFinish(0.93, 0.0),
    "cube_corner": SolarFinish(0.20, 0.70),
    "regolith_highland": SolarFinish(0.88, 0.0),
    "regolith_mare": SolarFinish(0.93, 0.0),
}
ASSUMED_FINISH = SolarFinish(0.70, 0.0)  # the Lambertian 0.30 of Fuller et al., for sunlight too
