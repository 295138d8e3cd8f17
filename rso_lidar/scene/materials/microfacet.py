"""Microfacet models of rough surfaces: matt facets (Oren-Nayar) and mirror facets (GGX)."""

import math
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, Strict, model_validator

from rso_lidar.part import Fraction
from rso_lidar.scene.materials.lobe import Lobe
from rso_lidar.scene.materials.scatterer import MaterialPart, check_energy, complete_cosines, half_vector_cosines
from rso_lidar.units import DEG

_NARROW_ROUGHNESS = 0.1  # rougher lobes hardly change over the Sun's disc: 0.5 % at the peak


class OrenNayar(MaterialPart):
    """A rough matt surface of Lambertian facets: flatter over the disc and brighter at full phase than Lambert's.

    This is the qualitative model of Oren and Nayar (SIGGRAPH 1994, eq. 30), ρ₀/π (A + B max(0, cos Δφ) sin α tan β).
    Its coefficients are A = 1 - 0.5 σ²/(σ² + 0.33) and B = 0.45 σ²/(σ² + 0.09). `reflectance` is ρ₀ of a facet.
    `roughness_deg` is σ, the standard deviation of the slope angles. With 0 the surface is Lambertian.
    """

    type: Literal["oren_nayar"] = "oren_nayar"
    reflectance: Fraction = Field(description="Reflectance ρ₀ of a microfacet at the laser's wavelength.")
    roughness_deg: Annotated[float, Strict(), Field(ge=0, le=90)] = Field(
        description="Standard deviation σ of the slope angles of the microfacets [deg]; 0 is Lambertian."
    )

    @model_validator(mode="after")
    def _conserve_energy(self) -> Self:
        # Reflectance is greatest at grazing incidence, where the integral of the model is ρ₀ (A + B/2).
        flat, rough = self._a_b
        most = flat + 0.5 * rough
        if self.reflectance * most > 1.0 + 1e-3:
            raise ValueError(
                f"reflectance {self.reflectance:g} at roughness_deg {self.roughness_deg:g} reflects more than the "
                f"incident light at grazing incidence; keep reflectance at or below {math.floor(1e3 / most) / 1e3:g}"
            )
        return self

    @property
    def _a_b(self) -> tuple[float, float]:
        variance = (self.roughness_deg * DEG) ** 2
        return 1.0 - 0.5 * variance / (variance + 0.33), 0.45 * variance / (variance + 0.09)

    def brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the BRDF [1/sr]; cos Δφ sin α tan β is (cos Δ - cos θᵢ cos θₒ) / max(cos θᵢ, cos θₒ)."""
        cos_in, cos_out, phase = complete_cosines(cos_in, cos_out, cos_phase)
        flat, rough = self._a_b
        toward = np.maximum(phase - cos_in * cos_out, 0.0) / np.maximum(np.maximum(cos_in, cos_out), 1e-9)
        brdf: np.ndarray = self.reflectance / math.pi * (flat + rough * toward)
        return brdf


class Ggx(MaterialPart):
    """A rough mirror over a matt ground: D F G / (4 cos θᵢ cos θₒ) + (k_d/π) (1 - S(θᵢ)) (1 - S(θₒ)).

    D is the GGX distribution of facet normals and G Smith's separable shadowing (Walter et al., EGSR 2007, eqs. 33 and
    34). F is Schlick's Fresnel reflectance (1994), F₀ + (1 - F₀) S, with S = (1 - cos)⁵. `specular` is F₀, `roughness` is
    Walter's α_g, and `diffuse` is k_d. The ground gets what the mirror transmits on the way in and out. The model is
    therefore reciprocal, and it conserves energy for k_d + F₀ up to 1.
    """

    type: Literal["ggx"] = "ggx"
    diffuse: Fraction = Field(description="Reflectance k_d of the diffuse base at the laser's wavelength.")
    specular: Fraction = Field(description="Fresnel reflectance F₀ at normal incidence; k_d + F₀ ≤ 1.")
    roughness: Annotated[float, Strict(), Field(ge=0.01, le=1)] = Field(
        description="Roughness α_g: 0.01 is nearly a mirror, 1 is very rough."
    )

    @model_validator(mode="after")
    def _conserve_energy(self) -> Self:
        check_energy("diffuse + specular", self.diffuse + self.specular)
        return self

    @property
    def is_narrow(self) -> bool:
        """Whether the lobe changes over the Sun's disc."""
        return self.roughness < _NARROW_ROUGHNESS

    @property
    def lobe(self) -> Lobe | None:
        """The lobe of the mirror facets."""
        total = self.diffuse + self.specular
        return Lobe(self.specular / total, roughness=self.roughness) if self.specular > 0.0 else None

    def brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the BRDF [1/sr]."""
        cos_in, cos_out, phase = complete_cosines(cos_in, cos_out, cos_phase)
        cos_in, cos_out = np.maximum(cos_in, 1e-9), np.maximum(cos_out, 1e-9)
        cos_half, cos_facet = half_vector_cosines(cos_in, cos_out, phase)
        alpha2 = self.roughness**2
        distribution = alpha2 / (math.pi * (1.0 - (1.0 - alpha2) * cos_half**2) ** 2)
        fresnel = self.specular + (1.0 - self.specular) * _schlick(cos_facet)
        shadowing = 1.0 / (_smith(cos_in, alpha2) * _smith(cos_out, alpha2))  # G / (4 cos cos)
        ground = self.diffuse / math.pi * (1.0 - _schlick(cos_in)) * (1.0 - _schlick(cos_out))
        brdf: np.ndarray = fresnel * distribution * shadowing + ground
        return brdf


def _schlick(cosine: np.ndarray | float) -> np.ndarray | float:
    return (1.0 - cosine) ** 5


def _smith(cosine: np.ndarray, alpha2: float) -> np.ndarray:
    """Return 2 cos θ / G₁(θ)."""
    length: np.ndarray = cosine + np.sqrt(alpha2 + (1.0 - alpha2) * cosine**2)
    return length
