"""How a surface sends light back toward the lidar: BRDFs without the cosine (seed eqs. 8-10)."""

import math
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError, model_validator

from rso_lidar import units
from rso_lidar.errors import MeshError, ScenarioError, did_you_mean
from rso_lidar.part import Fraction, NotNegative, Positive, Text
from rso_lidar.scene.library import catalogue
from rso_lidar.scene.materials.crinkle import Crinkled
from rso_lidar.scene.materials.measured import TableBrdf
from rso_lidar.scene.materials.microfacet import Ggx, OrenNayar
from rso_lidar.scene.materials.retro import RetroReflector
from rso_lidar.scene.materials.scatterer import Scatterer, both_ways, phong_per_sr

_NARROW_EXPONENT = 100.0  # below it the mean over the Sun's disc is that of its centre, to 0.5 % at the peak
_NEAR_FRACTION = 0.05  # of the wavelength: materials hold so far


class Lambertian(Scatterer):
    """A surface equally bright from everywhere: ρ = ρ₀/π (seed eq. 9).

    `reflectance` is ρ₀ at the laser's wavelength.
    """

    type: Literal["lambertian"] = "lambertian"
    reflectance: Fraction = Field(
        default=0.30, description="Reflectance ρ₀ at the laser's wavelength. Default: Fuller et al., sec. 5."
    )

    def brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the BRDF [1/sr], the same from everywhere.

        >>> float(Lambertian(reflectance=0.5).brdf_per_sr(np.array(1.0)) * math.pi)
        0.5
        """
        return np.full(np.shape(cos_in), self.reflectance / math.pi)


class Phong(Scatterer):
    """The modified Phong surface ρ = k_d/π + k_s (n+2)/(2π) cosⁿφ (seed eq. 10; Lafortune and Willems 1994).

    `diffuse` is k_d, `specular` k_s and `exponent` n, at the laser's wavelength; k_d + k_s may not exceed 1, or the
    surface would send back more than it gets. φ is the angle between the mirror's direction and the viewer.
    """

    type: Literal["phong"] = "phong"
    diffuse: Fraction = Field(description="Diffuse reflectance k_d at the laser's wavelength.")
    specular: Fraction = Field(description="Specular reflectance k_s at the laser's wavelength; k_d + k_s ≤ 1.")
    exponent: NotNegative = Field(
        description="Exponent n of the specular lobe; a greater exponent gives a narrower glint."
    )

    @model_validator(mode="after")
    def _conserve_energy(self) -> Self:
        if self.diffuse + self.specular > 1.0 + 1e-12:
            total = self.diffuse + self.specular
            raise ValueError(f"diffuse + specular is {total:.4g}, more light than comes in; keep the sum at or below 1")
        return self

    @property
    def narrow(self) -> bool:
        """Return whether the lobe changes over the Sun's disc."""
        return self.specular > 0.0 and self.exponent > _NARROW_EXPONENT

    def brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the BRDF [1/sr]; cos φ = 2 cos θᵢ cos θₒ - cos Δ, in monostatic geometry φ = 2α; cos φ < 0 counts 0."""
        cos_in, cos_out, phase = both_ways(cos_in, cos_out, cos_phase)
        return phong_per_sr(self.diffuse, self.specular, self.exponent, cos_in, cos_out, phase)


OneMaterial = Annotated[
    Lambertian | Phong | Crinkled | OrenNayar | Ggx | RetroReflector | TableBrdf,
    Field(discriminator="type"),
]


class ByWavelength(Scatterer):
    """One material for each of several wavelengths; the laser's picks the nearest, within 5 %.

    `wavelength_nm` and `materials` go in pairs.
    """

    type: Literal["by_wavelength"] = "by_wavelength"
    wavelength_nm: tuple[Positive, ...] = Field(description="Wavelength of each material [nm].")
    materials: tuple[OneMaterial, ...] = Field(
        description="Material at each wavelength. The wavelength nearest to the laser's applies, within 5 %."
    )

    @model_validator(mode="after")
    def _in_pairs(self) -> Self:
        n, m = len(self.wavelength_nm), len(self.materials)
        if n != m or n == 0:
            raise ValueError(f"{n} wavelengths and {m} materials; give one material for each wavelength, at least one")
        if len(set(self.wavelength_nm)) < n:
            raise ValueError("a wavelength stands twice in wavelength_nm; leave one out")
        return self

    def at(self, wavelength_m: float) -> Scatterer:
        """Return the material of the wavelength nearest to that of the light [m]."""
        asked_nm = wavelength_m / units.NM
        off, nearest = min((abs(known / asked_nm - 1.0), k) for k, known in enumerate(self.wavelength_nm))
        if off > _NEAR_FRACTION:
            known_nm = ", ".join(f"{known:g}" for known in sorted(self.wavelength_nm))
            raise ScenarioError(
                f"by_wavelength: no material within 5 % of {asked_nm:g} nm (known: {known_nm}); add one for it"
            )
        return self.materials[nearest].at(wavelength_m)

    def brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Refuse: which material it is, only a wavelength says."""
        raise ScenarioError("by_wavelength: has no BRDF of its own; choose one by at(wavelength_m)")


class Named(Scatterer):
    """A material of the catalogue (models/materials.toml) by its `name`; it may be written as the name alone.

    It has one BRDF near 1064 nm and one near 1570 nm; the laser takes the nearer.
    """

    type: Literal["named"] = "named"
    name: Text = Field(
        description=(
            "Name in the catalogue models/materials.toml. The nearer of 1064 and 1570 nm to the laser's wavelength "
            "applies."
        )
    )

    @model_validator(mode="after")
    def _known(self) -> Self:
        known = catalogue.materials()
        if self.name not in known:
            guess = did_you_mean(self.name, known)
            raise ValueError(f"no material '{self.name}'{guess or ';'} (known: {', '.join(known)})")
        return self

    def at(self, wavelength_m: float) -> Scatterer:
        """Return the material as light of a wavelength [m] sees it."""
        return material_named(self.name, wavelength_m)

    def brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Refuse: which material it is, only a wavelength says."""
        raise ScenarioError(f"{self.name}: has no BRDF of its own; choose one by at(wavelength_m)")


_Described = Annotated[OneMaterial | ByWavelength | Named, Field(discriminator="type")]
_ONE: TypeAdapter[Scatterer] = TypeAdapter(OneMaterial)
_BETWEEN_M = 1.29e-6  # midway, in ratio, between 1064 and 1570 nm
_REMARKS = ("what", "source", "confidence", "display_rgb", "at_1570_nm")


def _by_name(given: Any) -> Any:
    return {"type": "named", "name": given} if isinstance(given, str) else given


Material = Annotated[_Described, BeforeValidator(_by_name, json_schema_input_type=_Described | Text)]


def material_named(name: str, wavelength_m: float) -> Scatterer:
    """Return a material of the catalogue by name, of the two wavelengths that it knows the nearer one."""
    fields = catalogue.materials().get(name)
    if fields is None:
        raise MeshError(f"models/materials.toml: no material '{name}'; add it, or name another in models/index.toml")
    if wavelength_m > _BETWEEN_M:
        fields = {**fields, **fields.get("at_1570_nm", {})}
    known = {key: value for key, value in fields.items() if key not in _REMARKS}
    try:
        return _ONE.validate_python(known).at(wavelength_m)
    except ValidationError as error:
        raise MeshError(f"models/materials.toml: {name}: {error.errors()[0]['msg']}; mend the entry") from None
