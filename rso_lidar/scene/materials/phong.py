"""Matt and glossy surfaces: the BRDFs of Lambert and Phong (Fuller et al., eqs. 8-10)."""

import math
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.part import Fraction, NotNegative
from rso_lidar.scene.materials.lobe import Lobe
from rso_lidar.scene.materials.scatterer import MaterialPart, check_energy, complete_cosines, phong_per_sr

_NARROW_EXPONENT = 100.0  # broader lobes hardly change over the Sun's disc: 0.5 % at the peak


class Lambertian(MaterialPart):
    """A surface equally bright from everywhere: ρ = ρ₀/π (Fuller et al., eq. 9).

    `reflectance` is ρ₀ at the laser's wavelength, and in every band of a camera.
    """

    type: Literal["lambertian"] = "lambertian"
    reflectance: Fraction = Field(
        default=0.30, description="Reflectance ρ₀ at the laser's wavelength. Default: Fuller et al., sec. 5."
    )

    @property
    def lambertian_per_sr(self) -> float:
        """BRDF [1/sr], the same from everywhere."""
        return self.reflectance / math.pi

    def brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the BRDF [1/sr], the same from everywhere.

        >>> float(Lambertian(reflectance=0.5).brdf_per_sr(np.array(1.0)) * math.pi)
        0.5
        """
        return np.full(np.shape(cos_in), self.lambertian_per_sr)


class Phong(MaterialPart):
    """The modified Phong surface ρ = k_d/π + k_s (n+2)/(2π) cosⁿφ (Fuller et al., eq. 10; Lafortune and Willems 1994).

    `diffuse` is k_d, `specular` k_s and `exponent` n, at the laser's wavelength. The sum k_d + k_s may not exceed 1, so that
    energy is conserved. The angle φ is the angle between the mirror direction and the viewer.
    """

    type: Literal["phong"] = "phong"
    diffuse: Fraction = Field(description="Diffuse reflectance k_d at the laser's wavelength.")
    specular: Fraction = Field(description="Specular reflectance k_s at the laser's wavelength; k_d + k_s ≤ 1.")
    exponent: NotNegative = Field(
        description="Exponent n of the specular lobe; a greater exponent gives a narrower glint."
    )

    @model_validator(mode="after")
    def _conserve_energy(self) -> Self:
        check_energy("diffuse + specular", self.diffuse + self.specular)
        return self

    @property
    def is_narrow(self) -> bool:
        """Whether the lobe changes over the Sun's disc."""
        return self.specular > 0.0 and self.exponent > _NARROW_EXPONENT

    @property
    def lobe(self) -> Lobe | None:
        """The specular lobe."""
        return Lobe(self.specular / (self.diffuse + self.specular), self.exponent) if self.specular > 0.0 else None

    def brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the BRDF [1/sr], with cos φ = 2 cos θᵢ cos θₒ - cos Δ, at least 0. In monostatic geometry φ = 2α."""
        cos_in, cos_out, phase = complete_cosines(cos_in, cos_out, cos_phase)
        return phong_per_sr(self.diffuse, self.specular, self.exponent, cos_in, cos_out, phase)
