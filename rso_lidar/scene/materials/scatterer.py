"""What every material answers: how bright a surface is from one direction, lit from another."""

import math
from abc import abstractmethod

import numpy as np

from rso_lidar import units
from rso_lidar.part import Part

# Angular radius of the Sun from 1 au, 0.2665 degree: 6.8e-5 sr.
SUN_RADIUS_RAD = math.asin(units.SUN_RADIUS_M / units.ASTRONOMICAL_UNIT_M)


class Scatterer(Part):
    """A surface whose BRDF depends on three cosines: of incidence, of exitance, and of the angle between the two."""

    @property
    def retro(self) -> bool:
        """Return whether light goes back where it came from, in a lobe that may be narrower than a lens."""
        return False

    def average_over_lens(
        self,
        peak_per_sr: np.ndarray,
        direction: np.ndarray,
        range_m: np.ndarray,
        laser_from_m: np.ndarray,
        aperture_m: float,
    ) -> np.ndarray:
        """Return the mean of the BRDF [1/sr] over a lens, given the BRDF toward the light: for broad lobes, itself."""
        return peak_per_sr

    @property
    def narrow(self) -> bool:
        """Return whether the lobe changes over the Sun's disc, so that sunlight has to be averaged over it."""
        return False

    def at(self, wavelength_m: float) -> "Scatterer":
        """Return the material as light of a wavelength [m] sees it."""
        return self

    @abstractmethod
    def brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the BRDF [1/sr], without the cosine.

        Parameters
        ----------
        cos_in, cos_out
            Cosines of the angles from the normal to the light and to the viewer, both at least 0.
        cos_phase
            Cosine of the angle between the directions toward the light and toward the viewer.

        With the last two left out the viewer is where the light is.
        """

    def mean_brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the BRDF [1/sr] of a piece that holds all of the surface's structure: without any, the BRDF itself."""
        return self.brdf_per_sr(cos_in, cos_out, cos_phase)

    def sunlight_brdf_per_sr(self, cos_in: np.ndarray, cos_out: np.ndarray, cos_phase: np.ndarray) -> np.ndarray:
        """Return the BRDF [1/sr] in sunlight, in which no lobe is narrower than the Sun's disc."""
        return self.brdf_per_sr(cos_in, cos_out, cos_phase)


def both_ways(
    cos_in: np.ndarray, cos_out: np.ndarray | None, cos_phase: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray | float]:
    """Return the three cosines, those left out filled in with the viewer where the light is."""
    cos_in = np.asarray(cos_in, dtype=float)
    return cos_in, cos_in if cos_out is None else cos_out, 1.0 if cos_phase is None else cos_phase


def half_way(
    cos_in: np.ndarray, cos_out: np.ndarray, cos_phase: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray | float]:
    """Return the cosines of the half-way direction's angles from the normal and from the light."""
    length = np.sqrt(np.maximum(2.0 + 2.0 * np.asarray(cos_phase), 1e-30))  # of the sum of the two unit vectors
    return np.minimum((cos_in + cos_out) / length, 1.0), np.minimum(0.5 * length, 1.0)


def phong_per_sr(
    diffuse: float,
    specular: float,
    exponent: float,
    cos_in: np.ndarray,
    cos_out: np.ndarray,
    cos_phase: np.ndarray | float,
) -> np.ndarray:
    """Return ρ = k_d/π + k_s (n+2)/(2π) cosⁿφ [1/sr] (seed eq. 10), cos φ = 2 cos θᵢ cos θₒ - cos Δ; cos φ < 0 counts 0."""
    cos_phi = np.clip(2.0 * (cos_in * cos_out) - cos_phase, 0.0, 1.0)
    brdf: np.ndarray = diffuse / math.pi + specular * (exponent + 2.0) / (2.0 * math.pi) * cos_phi**exponent
    return brdf
