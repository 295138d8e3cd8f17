"""How a surface sends light back toward the lidar: BRDFs without the cosine (seed eqs. 8-10)."""

import math
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.part import Fraction, NotNegative, Part


class Lambertian(Part):
    """A surface equally bright from everywhere: ρ = ρ₀/π (seed eq. 9).

    `reflectance` is ρ₀ at the laser's wavelength.
    """

    type: Literal["lambertian"] = "lambertian"
    reflectance: Fraction = 0.30

    def brdf_per_sr(self, cos_incidence: np.ndarray) -> np.ndarray:
        """Return the BRDF [1/sr] toward the lidar, which is the laser's place too, for cos α.

        >>> float(Lambertian(reflectance=0.5).brdf_per_sr(np.array(1.0)) * math.pi)
        0.5
        """
        return np.full(np.shape(cos_incidence), self.reflectance / math.pi)


class Phong(Part):
    """The modified Phong surface ρ = k_d/π + k_s (n+2)/(2π) cosⁿφ (seed eq. 10; Lafortune and Willems 1994).

    `diffuse` is k_d, `specular` k_s and `exponent` n, at the laser's wavelength; k_d + k_s may not exceed 1, or the
    surface would send back more than it gets.
    """

    type: Literal["phong"] = "phong"
    diffuse: Fraction
    specular: Fraction
    exponent: NotNegative

    @model_validator(mode="after")
    def _conserve_energy(self) -> Self:
        if self.diffuse + self.specular > 1.0 + 1e-12:
            total = self.diffuse + self.specular
            raise ValueError(f"diffuse + specular is {total:.4g}, more light than comes in; keep the sum at or below 1")
        return self

    def brdf_per_sr(self, cos_incidence: np.ndarray) -> np.ndarray:
        """Return the BRDF [1/sr] toward the lidar; light comes and goes one way, so φ = 2α, and cos φ < 0 counts 0."""
        cos_phi = np.clip(2.0 * np.square(cos_incidence) - 1.0, 0.0, 1.0)
        lobe = self.specular * (self.exponent + 2.0) / (2.0 * math.pi)
        brdf: np.ndarray = self.diffuse / math.pi + lobe * cos_phi**self.exponent
        return brdf


Material = Annotated[Lambertian | Phong, Field(discriminator="type")]
