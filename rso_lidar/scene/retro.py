"""Cube corners, seen as a surface that sends light back where it came from."""

import math
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, Strict, model_validator

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.part import Fraction, Positive
from rso_lidar.scene.scatter import SUN_RADIUS_RAD, Scatterer, both_ways


class RetroReflector(Scatterer):
    """Round cube corners of one size side by side, diffraction limited, as the BRDF of the surface they stand on.

    Each sends an Airy pattern back; its peak at normal incidence is the cross-section σ = ρ π³ D⁴ / (4 λ²) (Degnan,
    Millimeter Accuracy Satellite Laser Ranging, 1993), its first dark ring at 1.22 λ/D. Off the normal the peak falls by
    the square of the area that is active (Degnan's η), in reciprocal form η(θᵢ) η(θₒ); the broader pattern that goes with
    that is not modelled, so such cubes return less than they could.

    `diameter_mm` is D, `reflectance` ρ of all three faces together, `fill_fraction` the share of the surface that is cube,
    `refractive_index` that of the glass (1 for a hollow cube), `diffuse` the reflectance of what lies between. The pattern
    depends on `wavelength_nm`, the laser's, which `at` writes in.
    """

    type: Literal["retro_reflector"] = "retro_reflector"
    diameter_mm: Positive
    reflectance: Fraction
    fill_fraction: Fraction
    refractive_index: Annotated[float, Strict(), Field(ge=1, le=4)] = 1.45
    diffuse: Fraction = 0.0
    wavelength_nm: Positive | None = None

    @property
    def retro(self) -> bool:
        """Return True: the lobe points back at the light."""
        return True

    @model_validator(mode="after")
    def _conserve_energy(self) -> Self:
        total = self.reflectance * self.fill_fraction + self.diffuse
        if total > 1.0 + 1e-12:
            raise ValueError(
                f"reflectance x fill_fraction + diffuse is {total:.4g}, more light than comes in; keep it at or below 1"
            )
        return self

    def at(self, wavelength_m: float) -> Scatterer:
        """Return the same cubes with the wavelength of the light [m] written in."""
        return self.replace(wavelength_nm=round(wavelength_m / units.NM, 6))

    def brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the BRDF [1/sr]: ρ F A η(θᵢ) η(θₒ) / (λ² cos θᵢ cos θₒ) (2 J₁(x)/x)², x = π D sin Δ / λ."""
        from scipy.special import j1

        if self.wavelength_nm is None:
            raise ScenarioError("retro_reflector: its lobe depends on the wavelength; give it one by at(wavelength_m)")
        cos_in, cos_out, phase = both_ways(cos_in, cos_out, cos_phase)
        diameter_m, wavelength_m = self.diameter_mm * units.MM, self.wavelength_nm * units.NM
        peak = 0.25 * math.pi * (diameter_m / wavelength_m) ** 2
        sine = np.sqrt(np.maximum((1.0 - phase) * (1.0 + phase), 0.0))
        x = np.maximum(math.pi * diameter_m / wavelength_m * sine, 1e-6)
        lobe = np.where(phase > 0.0, peak * (2.0 * j1(x) / x) ** 2, 0.0)
        return self._around(lobe, cos_in, cos_out)

    def gathered(self, brdf_per_sr: np.ndarray, sine: np.ndarray, aperture_rad: np.ndarray) -> np.ndarray:
        """Return the mean BRDF [1/sr] over a round aperture of half angle `aperture_rad` [rad] as the cubes see it.

        The lobe may be narrower than the lens: of the light in it no more than all arrives. The share within x is
        1 − J₀² − J₁² (Rayleigh 1881; Born and Wolf eq. 8.5.18). `sine` is that of the angle from the light to the lens's
        middle; light that stands outside the lens's rim is seen by the pattern at the middle.
        """
        from scipy.special import j0, j1

        assert self.wavelength_nm is not None
        scale = math.pi * self.diameter_mm * units.MM / (self.wavelength_nm * units.NM)
        x, rim = scale * sine, np.maximum(scale * np.sin(aperture_rad), 1e-9)
        at_middle = (2.0 * j1(np.maximum(x, 1e-6)) / np.maximum(x, 1e-6)) ** 2
        mean = (1.0 - j0(rim) ** 2 - j1(rim) ** 2) / (0.25 * rim**2)
        share = np.where((rim < 0.3) | (x > rim), 1.0, mean / np.maximum(at_middle, 1e-12))
        between = self.diffuse / math.pi
        result: np.ndarray = between + (brdf_per_sr - between) * share
        return result

    def sunlight_brdf_per_sr(self, cos_in: np.ndarray, cos_out: np.ndarray, cos_phase: np.ndarray) -> np.ndarray:
        """Return the BRDF [1/sr] in sunlight: the pattern, far narrower than the Sun's disc, spread evenly over it."""
        within = cos_phase >= math.cos(SUN_RADIUS_RAD)
        disc_sr = 2.0 * math.pi * (1.0 - math.cos(SUN_RADIUS_RAD))
        return self._around(within / disc_sr, cos_in, cos_out)

    def _around(self, lobe_per_sr: np.ndarray, cos_in: np.ndarray, cos_out: np.ndarray) -> np.ndarray:
        active = self._active(cos_in) * self._active(cos_out)
        brdf: np.ndarray = self.reflectance * self.fill_fraction * active * lobe_per_sr + self.diffuse / math.pi
        return brdf

    def _active(self, cosine: np.ndarray) -> np.ndarray:
        """Return η(θ) / cos θ of a round cube corner: (2/π) (asin μ - √2 μ tan θ'), μ² = 1 - 2 tan² θ', θ' in the glass."""
        sine2 = np.maximum(1.0 - np.square(cosine), 0.0) / self.refractive_index**2
        tangent2 = sine2 / np.maximum(1.0 - sine2, 1e-12)
        mu = np.sqrt(np.maximum(1.0 - 2.0 * tangent2, 0.0))
        share = 2.0 / math.pi * (np.arcsin(mu) - math.sqrt(2.0) * mu * np.sqrt(tangent2))
        active: np.ndarray = np.clip(share, 0.0, 1.0)
        return active
