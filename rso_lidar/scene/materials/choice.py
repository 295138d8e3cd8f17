"""Materials chosen by wavelength or by a name of the catalogue, and the field that takes any material."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError, model_validator

from rso_lidar import units
from rso_lidar.errors import MeshError, ScenarioError, did_you_mean
from rso_lidar.part import Positive, Seam, Text
from rso_lidar.scene.library import model_index
from rso_lidar.scene.materials.crinkle import Crinkled
from rso_lidar.scene.materials.measured_brdf import TableBrdf
from rso_lidar.scene.materials.microfacet import Ggx, OrenNayar
from rso_lidar.scene.materials.phong import Lambertian, Phong
from rso_lidar.scene.materials.retro import RetroReflector
from rso_lidar.scene.materials.scatterer import Material, MaterialPart, Scatterer

_NEAR_FRACTION = 0.05  # relative difference of wavelengths up to which a material may be used


OneMaterial = Annotated[
    Lambertian | Phong | Crinkled | OrenNayar | Ggx | RetroReflector | TableBrdf,
    Field(discriminator="type"),
]


class ByWavelength(MaterialPart):
    """One material for each of several wavelengths. The one nearest to the light's wavelength is used, within 5 %.

    The light is that of the laser, and that in the middle of each band of a camera.

    `wavelength_nm` and `materials` have one entry each for every material.
    """

    type: Literal["by_wavelength"] = "by_wavelength"
    wavelength_nm: tuple[Positive, ...] = Field(description="Wavelength of each material [nm].")
    materials: tuple[OneMaterial, ...] = Field(
        description=(
            "Material at each wavelength. The wavelength nearest to that of the laser, or of a camera's band, applies, "
            "within 5 %."
        )
    )

    @model_validator(mode="after")
    def _in_pairs(self) -> Self:
        n, m = len(self.wavelength_nm), len(self.materials)
        if n != m or n == 0:
            raise ValueError(f"{n} wavelengths and {m} materials; give one material for each wavelength, at least one")
        if len(set(self.wavelength_nm)) < n:
            raise ValueError("a wavelength occurs twice in wavelength_nm; leave one out")
        return self

    def at(self, wavelength_m: float) -> Scatterer:
        """Return the material of the wavelength nearest to that of the light.

        Parameters
        ----------
        wavelength_m : wavelength of the light [m]

        Raises
        ------
        ScenarioError
            If none is within 5 %.
        """
        light_nm = wavelength_m / units.NM
        off, nearest = min((abs(known / light_nm - 1.0), k) for k, known in enumerate(self.wavelength_nm))
        if off > _NEAR_FRACTION:
            known_nm = ", ".join(f"{known:g}" for known in sorted(self.wavelength_nm))
            raise ScenarioError(
                f"by_wavelength: no material within 5 % of {light_nm:g} nm (known: {known_nm}); add one for it"
            )
        return self.materials[nearest].at(wavelength_m)

    def brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Raise `ScenarioError`: the material is unknown before a wavelength selects it."""
        raise ScenarioError("by_wavelength: needs a wavelength for its BRDF; select a material by at(wavelength_m)")


class Named(MaterialPart):
    """A material of the catalogue (models/materials.toml) by its `name`; it may be written as the name alone.

    It has one BRDF near 1064 nm and one near 1570 nm; the nearer applies. Below 1064 nm most materials have total
    reflectances at several wavelengths, linear in between. They scale the BRDF of 1064 nm, whose lobe stays (assumed).
    """

    type: Literal["named"] = "named"
    name: Text = Field(
        description=(
            "Name in the catalogue models/materials.toml. The nearer of 1064 and 1570 nm to the light's wavelength "
            "applies; below 1064 nm its tabulated reflectances scale that of 1064 nm."
        )
    )

    @model_validator(mode="after")
    def _known(self) -> Self:
        known = model_index.load_materials()
        if self.name not in known:
            guess = did_you_mean(self.name, known)
            raise ValueError(f"unknown material '{self.name}'{guess or ';'} (known: {', '.join(known)})")
        return self

    def at(self, wavelength_m: float) -> Scatterer:
        """Return the material as light of a wavelength [m] sees it."""
        return find_material(self.name, wavelength_m)

    def brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Raise `ScenarioError`: the material is unknown before a wavelength selects it."""
        raise ScenarioError(f"{self.name}: needs a wavelength for its BRDF; select a material by at(wavelength_m)")


_Described = Annotated[OneMaterial | ByWavelength | Named, Field(discriminator="type")]
_ONE: TypeAdapter[Scatterer] = TypeAdapter(OneMaterial)
_BETWEEN_M = 1.29e-6  # geometric mean of 1064 and 1570 nm
_MAIN_NM = 1064.0  # wavelength of the entries themselves
_REMARKS = ("what", "source", "confidence", "display_rgb", "at_1570_nm", "below_1064_nm")
_REFLECTANCES = ("reflectance", "diffuse", "specular")  # fields that scale with the total reflectance


def _by_name(given: Any) -> Any:
    return {"type": "named", "name": given} if isinstance(given, str) else given


_ByTable = Annotated[_Described, BeforeValidator(_by_name, json_schema_input_type=_Described | Text)]
AnyMaterial = Annotated[_Described | Material, Seam(_ByTable, Material)]


def find_material(name: str, wavelength_m: float) -> Scatterer:
    """Find a material of the catalogue by name, as light of a wavelength sees it.

    Parameters
    ----------
    name : name of the material
    wavelength_m : wavelength of the light [m]

    Returns
    -------
    the material at that wavelength.

    Raises
    ------
    MeshError : the catalogue has no material of that name, or its entry is wrong.
    """
    entry = model_index.load_materials().get(name)
    if entry is None:
        raise MeshError(
            f"models/materials.toml: unknown material '{name}'; add it, or give another in models/index.toml"
        )
    try:
        return _ONE.validate_python(_choose_fields(entry, wavelength_m)).at(wavelength_m)
    except ValidationError as error:
        raise MeshError(f"models/materials.toml: {name}: {error.errors()[0]['msg']}; correct the entry") from None


def total_reflectance(entry: Mapping[str, Any], wavelength_m: float) -> float:
    """Return the total reflectance of a material of the catalogue over all directions.

    It is the sum of the reflectances in the entry. Crinkled foil loses the light that meets it twice beside this.

    Parameters
    ----------
    entry : entry of the catalogue, as `load_materials` returns it
    wavelength_m : wavelength of the light [m]

    Returns
    -------
    Reflectance, from 0 to 1.

    >>> round(total_reflectance(model_index.load_materials()["gold_bare"], 460e-9), 2)
    0.38
    """
    return _add_reflectances(_choose_fields(entry, wavelength_m))


def _choose_fields(entry: Mapping[str, Any], wavelength_m: float) -> dict[str, Any]:
    """Return the fields of a material's BRDF at a wavelength [m]: the entry's, those at 1570 nm, or those scaled."""
    fields = {key: value for key, value in entry.items() if key not in _REMARKS}
    if wavelength_m > _BETWEEN_M:
        return {**fields, **entry.get("at_1570_nm", {})}
    below = entry.get("below_1064_nm")
    light_nm = round(wavelength_m / units.NM, 6)
    if below is None or light_nm >= _MAIN_NM:
        return fields
    main = _add_reflectances(fields)
    total = np.interp(light_nm, [*below["wavelength_nm"], _MAIN_NM], [*below["reflectance"], main])
    return fields | {key: fields[key] * float(total) / main for key in _REFLECTANCES if key in fields}


def _add_reflectances(fields: Mapping[str, Any]) -> float:
    """Return the total reflectance of the fields of a BRDF."""
    total = fields.get("reflectance", 0.0) * fields.get("fill_fraction", 1.0)
    return float(total + fields.get("diffuse", 0.0) + fields.get("specular", 0.0))
