"""Retro-reflectors: a surface of cube corners, which reflect light back to its source."""

import math
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, Strict, model_validator

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.part import Fraction, Positive
from rso_lidar.scene.materials.diffraction import mean_irradiance
from rso_lidar.scene.materials.scatterer import SUN_RADIUS_RAD, MaterialPart, Scatterer, check_energy, complete_cosines


class RetroReflector(MaterialPart):
    """Round, diffraction-limited cube corners of one size side by side, as the BRDF of the surface that carries them.

    Each reflects an Airy pattern. Its peak at normal incidence is the cross-section σ = ρ π³ D⁴ / (4 λ²) (Degnan,
    Millimeter Accuracy Satellite Laser Ranging, 1993). Its first dark ring is at 1.22 λ/D. Off the normal the peak falls
    with the square of the active area (Degnan's η), in reciprocal form η(θᵢ) η(θₒ). The pattern also widens there, which
    is not modelled, so such cubes return less than they could. A lens gets the mean over its disc, in the near field too.

    `diameter_mm` is D and `reflectance` is ρ of all three faces together. `fill_fraction` is the share of the surface that
    is cube, and `diffuse` the reflectance of the rest. `refractive_index` is that of the glass, 1 for a hollow cube. The
    pattern depends on the laser's `wavelength_nm`, which `at` fills in.
    """

    type: Literal["retro_reflector"] = "retro_reflector"
    diameter_mm: Positive = Field(description="Diameter D of one corner cube [mm].")
    reflectance: Fraction = Field(description="Combined reflectance ρ of the three faces.")
    fill_fraction: Fraction = Field(description="Share of the surface covered by corner cubes.")
    refractive_index: Annotated[float, Strict(), Field(ge=1, le=4)] = Field(
        default=1.45, description="Refractive index of the glass; 1 for a hollow corner cube."
    )
    diffuse: Fraction = Field(default=0.0, description="Diffuse reflectance of the surface between the corner cubes.")
    wavelength_nm: Positive | None = Field(
        default=None, description="Wavelength of the light [nm]. If omitted, the laser's."
    )

    @property
    def is_retro(self) -> bool:
        """Whether the lobe points back at the light: it does."""
        return True

    @model_validator(mode="after")
    def _conserve_energy(self) -> Self:
        total = self.reflectance * self.fill_fraction + self.diffuse
        check_energy("reflectance x fill_fraction + diffuse", total)
        return self

    def at(self, wavelength_m: float) -> Scatterer:
        """Return the same cubes at the wavelength of the light [m]."""
        return self.replace(wavelength_nm=round(wavelength_m / units.NM, 6))

    def brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the far-field BRDF [1/sr]: ρ F A η(θᵢ) η(θₒ) / (λ² cos θᵢ cos θₒ) (2 J₁(x)/x)², x = π D sin Δ / λ.

        Parameters
        ----------
        cos_in, cos_out, cos_phase : as for `Scatterer.brdf_per_sr`

        Raises
        ------
        ScenarioError
            If the wavelength is unknown.
        """
        from scipy.special import j1

        if self.wavelength_nm is None:
            raise ScenarioError("retro_reflector: its lobe depends on the wavelength; set it by at(wavelength_m)")
        cos_in, cos_out, phase = complete_cosines(cos_in, cos_out, cos_phase)
        diameter_m, wavelength_m = self.diameter_mm * units.MM, self.wavelength_nm * units.NM
        peak = 0.25 * math.pi * (diameter_m / wavelength_m) ** 2
        sine = np.sqrt(np.maximum((1.0 - phase) * (1.0 + phase), 0.0))
        x = np.maximum(math.pi * diameter_m / wavelength_m * sine, 1e-6)
        lobe = np.where(phase > 0.0, peak * (2.0 * j1(x) / x) ** 2, 0.0)
        return self._around(lobe, cos_in, cos_out)

    def average_over_lens(
        self,
        peak_per_sr: np.ndarray,
        direction: np.ndarray,
        range_m: np.ndarray,
        laser_from_m: np.ndarray,
        aperture_m: float,
    ) -> np.ndarray:
        """Return the mean BRDF [1/sr] (hit) over a round lens: the shifted, defocused Airy pattern of each cube.

        A cube corner acts as a mirror whose pupil is rotated by half a turn. Light from a point at R₁ arrives at R₂ with
        the phase k r² (1/R₁ + 1/R₂)/2 over the cube's face. That is the far-field pattern out of focus. Near the lidar
        the pattern is therefore broader than Airy's, and never narrower than the cube. Off the axis the lens counts as a
        disc of the solid angle that the cube sees. The laser is a point, like a single-mode source.

        Parameters
        ----------
        peak_per_sr : (hit) f8, the far field's BRDF toward the light [1/sr]
        direction : (hit, xyz) f8, unit vectors to the cubes in lidar axes
        range_m : (hit) f8, distance of the cubes from the lens [m]
        laser_from_m : (xyz) f8, where the laser is in lidar axes [m]
        aperture_m : diameter of the lens [m]
        """
        assert self.wavelength_nm is not None
        to_laser = laser_from_m - direction * range_m[:, None]
        laser_m = np.linalg.norm(to_laser, axis=1)
        back = to_laser / laser_m[:, None]
        sine = np.linalg.norm(np.cross(direction, back), axis=1)
        rim = 0.5 * aperture_m * np.sqrt(np.maximum(direction[:, 2], 0.0)) / range_m
        diameter_m = self.diameter_mm * units.MM
        scale = math.pi * diameter_m / (self.wavelength_nm * units.NM)
        defocus = 0.5 * scale * diameter_m * (1.0 / laser_m + 1.0 / range_m)
        mean = np.zeros(len(range_m))
        on = np.flatnonzero(np.einsum("hi,hi->h", direction, back) < 0.0)  # elsewhere the laser is behind the cube
        mean[on] = mean_irradiance(scale * sine[on], scale * rim[on], defocus[on])
        between = self.diffuse / math.pi
        result: np.ndarray = between + (peak_per_sr - between) * mean
        return result

    def sunlight_brdf_per_sr(self, cos_in: np.ndarray, cos_out: np.ndarray, cos_phase: np.ndarray) -> np.ndarray:
        """Return the BRDF [1/sr] in sunlight: the pattern, spread evenly over the Sun's disc, which is far wider."""
        within = cos_phase >= math.cos(SUN_RADIUS_RAD)
        disc_sr = 2.0 * math.pi * (1.0 - math.cos(SUN_RADIUS_RAD))
        return self._around(within / disc_sr, cos_in, cos_out)

    def _around(self, lobe_per_sr: np.ndarray, cos_in: np.ndarray, cos_out: np.ndarray) -> np.ndarray:
        """Return the BRDF [1/sr] for a lobe, with the share of the cubes that are active and the diffuse surface about them.

        Parameters
        ----------
        lobe_per_sr : (hit) lobe of an active cube [1/sr]
        cos_in, cos_out : (hit) cosines of the angles from the normal to the light and to the viewer
        """
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
