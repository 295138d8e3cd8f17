"""Materials: how bright a surface is from one direction, lit from another."""

import math
from abc import ABC, abstractmethod
from functools import partial
from numbers import Real
from typing import Any, Protocol, runtime_checkable

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.part import (
    GREATEST,
    Part,
    call_member,
    check_values,
    lock_array,
    make_answer_error,
    name_object,
    read_member,
    show_value,
    to_real_array,
)
from rso_lidar.scene.materials.lobe import Lobe, check_lobe

# Angular radius of the Sun from 1 au, 0.2665 degree: 6.8e-5 sr.
SUN_RADIUS_RAD = math.asin(units.SUN_RADIUS_M / units.ASTRONOMICAL_UNIT_M)


@runtime_checkable
class Material(Protocol):
    """Protocol of user-defined materials, for any place where a scenario has a material.

    The single method `brdf_per_sr` is enough. Other members of `Scatterer` are used if present, such as
    `at(wavelength_m)` or `is_narrow`. For those absent, the defaults of `Scatterer` apply. Several threads call the
    method in parallel, so it must not change the object. `examples/seams/own_material.py` is an example.
    """

    def brdf_per_sr(self, cos_in: np.ndarray, cos_out: np.ndarray, cos_phase: np.ndarray) -> np.ndarray:
        """Return the BRDF [1/sr] of each hit, without the cosine of incidence.

        Parameters
        ----------
        cos_in, cos_out : (hit) f8, cosines of the angles from the normal to the light and to the viewer, from 0 to 1
        cos_phase : (hit) f8, cosine of the angle between the directions toward the light and toward the viewer; 1 where
            the laser is in the lens

        Returns
        -------
        (hit) f8, finite and at least 0. Energy is conserved where its integral over the hemisphere, times the cosine of
        exitance, is at most 1; that is not checked.
        """


class Scatterer(ABC):
    """A material with everything that the scene reads of it. The defaults are those of a plain, broad lobe."""

    @property
    def is_retro(self) -> bool:
        """Whether light returns to its source, in a lobe that may be narrower than a lens."""
        return False

    @property
    def is_narrow(self) -> bool:
        """Whether the lobe changes over the Sun's disc, so that sunlight has to be averaged over it."""
        return False

    @property
    def lambertian_per_sr(self) -> float:
        """BRDF [1/sr] of a material that looks the same from everywhere; NaN for all others."""
        return math.nan

    @property
    def lobe(self) -> Lobe | None:
        """Lobe about the mirror direction, from which second bounces are drawn; None draws them by the cosine."""
        return None

    @property
    def rms_slope(self) -> float:
        """Standard deviation of the slope of the surface's cells along any direction; 0 where it has no cells."""
        return 0.0

    @property
    def cell_m(self) -> float:
        """Side of the surface's cells [m], which decides how many rays sample them; assumed where a material has cells."""
        return 0.05

    def tilt_normals(self, normal: np.ndarray, point: np.ndarray) -> np.ndarray:
        """Tilt the normals of a surface to those of its structure.

        Parameters
        ----------
        normal : (xyz, hit) f8, unit normals
        point : (xyz, hit) f8, points on the surface in body axes [m]

        Returns
        -------
        (xyz, hit) f8, unit normals; here those given.
        """
        return normal

    def average_over_lens(
        self,
        peak_per_sr: np.ndarray,
        direction: np.ndarray,
        range_m: np.ndarray,
        laser_from_m: np.ndarray,
        aperture_m: float,
    ) -> np.ndarray:
        """Return the mean of the BRDF [1/sr] over a lens. A broad lobe has the same BRDF everywhere on it.

        Parameters
        ----------
        peak_per_sr : (hit) f8, BRDF toward the light [1/sr]
        direction : (hit, xyz) f8, unit vectors to the hits in lidar axes
        range_m : (hit) f8, their range [m]
        laser_from_m : (xyz) f8, position of the laser in lidar axes [m]
        aperture_m : diameter of the lens [m]
        """
        return peak_per_sr

    def at(self, wavelength_m: float) -> "Scatterer":
        """Return the material for light of one wavelength; here the same for all.

        Parameters
        ----------
        wavelength_m : wavelength of the light [m]
        """
        return self

    def summarize(self) -> str:
        """Return the material in a line, such as ``lambertian reflectance=0.3``."""
        return name_object(self)

    @abstractmethod
    def brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the BRDF [1/sr], without the cosine of incidence.

        With the last two parameters left out, the viewer is where the light is.

        Parameters
        ----------
        cos_in, cos_out : (hit) f8, cosines of the angles from the normal to the light and to the viewer, both at least
            0
        cos_phase : (hit) f8, cosine of the angle between the directions toward the light and toward the viewer
        """

    def mean_brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the BRDF [1/sr] of an area much larger than the structure of the surface.

        Parameters
        ----------
        cos_in, cos_out, cos_phase : as for `brdf_per_sr`
        """
        return self.brdf_per_sr(cos_in, cos_out, cos_phase)

    def sunlight_brdf_per_sr(self, cos_in: np.ndarray, cos_out: np.ndarray, cos_phase: np.ndarray) -> np.ndarray:
        """Return the BRDF [1/sr] in sunlight, averaged over the Sun's disc.

        Parameters
        ----------
        cos_in, cos_out, cos_phase : as for `brdf_per_sr`, toward the centre of the disc
        """
        return self.brdf_per_sr(cos_in, cos_out, cos_phase)


class MaterialPart(Part, Scatterer):
    """A material that a table of a scenario describes."""

    def summarize(self) -> str:
        """Return the type of the material and its numbers."""
        fields = self.model_dump(exclude_none=True)
        kind = fields.pop("type")
        return " ".join([kind, *(f"{name}={_short(value)}" for name, value in fields.items())])


def complete(material: Material) -> Scatterer:
    """Return a material with all members that the scene reads. An object that is not a `MaterialPart` is wrapped.

    Parameters
    ----------
    material : a part, or a user-defined object
    """
    return material if isinstance(material, MaterialPart | _Completed) else _Completed(material)


class _Completed(Scatterer):
    """An object with the protocol `Material`, and the defaults of `Scatterer` for what it lacks."""

    def __init__(self, material: Material) -> None:
        self._material = material
        for name in ("is_retro", "is_narrow"):
            read_member(material, name, False, bool, "make it True or False, or a property")
        for name, other in (("lambertian_per_sr", " or NaN"), ("rms_slope", "")):
            value = read_member(material, name, 0.0, Real, "make it a number, or a property")
            if not (0.0 <= value <= GREATEST or (other and math.isnan(value))):
                cure = f"make it a number from 0 to {GREATEST:g}{other}"
                raise ScenarioError(f"{name_object(material)}: {name} is {show_value(value)}; {cure}")
        if why := check_lobe(getattr(material, "lobe", None)):
            raise ScenarioError(f"{name_object(material)}: lobe {why}")

    def __getattribute__(self, name: str) -> Any:
        """Return the object's own member, where it has one."""
        if not name.startswith("_") and name not in _CHECKED:  # in another process it begins without a material
            own = object.__getattribute__(self, "_material")
            if hasattr(own, name):
                return getattr(own, name)
        return object.__getattribute__(self, name)

    def at(self, wavelength_m: float) -> Scatterer:
        """Return the object as light of a wavelength [m] sees it."""
        own: Any = self._material
        if not hasattr(own, "at"):
            return self
        seen = own.at(wavelength_m)
        if not isinstance(seen, Material):
            raise make_answer_error(own, "at", seen, "return a material")
        return complete(seen)

    def summarize(self) -> str:
        """Return the name of the object."""
        return name_object(self._material)

    def brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the object's BRDF [1/sr], after checking that it is one finite number from 0 up for each hit."""
        return self._ask("brdf_per_sr", cos_in, cos_out, cos_phase)

    def mean_brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the object's mean BRDF [1/sr], or else its BRDF, checked."""
        return self._ask("mean_brdf_per_sr", cos_in, cos_out, cos_phase)

    def sunlight_brdf_per_sr(self, cos_in: np.ndarray, cos_out: np.ndarray, cos_phase: np.ndarray) -> np.ndarray:
        """Return the object's BRDF [1/sr] in sunlight, or else its BRDF, checked."""
        return self._ask("sunlight_brdf_per_sr", cos_in, cos_out, cos_phase)

    def tilt_normals(self, normal: np.ndarray, point: np.ndarray) -> np.ndarray:
        """Return the normals that the object tilts, or else those given, checked."""
        tilted = call_member(self._material, "tilt_normals", normal, point, default=normal)
        return check_values(self._material, "tilt_normals", tilted, shape=normal.shape, least=-1.0, most=1.0)

    def average_over_lens(
        self,
        peak_per_sr: np.ndarray,
        direction: np.ndarray,
        range_m: np.ndarray,
        laser_from_m: np.ndarray,
        aperture_m: float,
    ) -> np.ndarray:
        """Return the object's mean BRDF [1/sr] over a lens, or else its BRDF, checked."""
        given = (peak_per_sr, direction, range_m, laser_from_m, aperture_m)
        mean_per_sr = call_member(self._material, "average_over_lens", *given, default=peak_per_sr)
        check = partial(check_values, self._material, "average_over_lens", mean_per_sr)
        return check(shape=np.shape(peak_per_sr), least=0.0, most=GREATEST)

    def _ask(
        self, method: str, cos_in: np.ndarray, cos_out: np.ndarray | None, cos_phase: np.ndarray | None
    ) -> np.ndarray:
        """Call a method of the object with read-only arrays, and check its BRDF; return (hit) BRDF [1/sr].

        Parameters
        ----------
        method : its name; an object that lacks it has `brdf_per_sr`
        cos_in, cos_out, cos_phase : as in `Scatterer.brdf_per_sr`

        Raises
        ------
        ScenarioError
            If the result is not one finite number from 0 up for each hit.
        """
        own = self._material
        method = method if hasattr(own, method) else "brdf_per_sr"
        cos_in, cos_out, phase = complete_cosines(cos_in, cos_out, cos_phase)
        cosines = [lock_array(values) for values in np.broadcast_arrays(cos_in, cos_out, phase)]
        answer = getattr(own, method)(*cosines)
        brdf = to_real_array(answer)
        if brdf is None:
            raise make_answer_error(own, method, answer, "return a real number for each hit")
        if brdf.shape not in ((), cosines[0].shape):
            raise ScenarioError(
                f"{self.summarize()}: {method} returns an array of shape {brdf.shape} for cosines of shape "
                f"{cosines[0].shape}; return one number for each hit"
            )
        sound = (brdf >= 0.0) & (brdf <= GREATEST)
        if not np.all(sound):
            raise ScenarioError(
                f"{self.summarize()}: {method} returns {brdf[~sound].flat[0]:g}; "
                f"a BRDF is at least 0 and at most {GREATEST:g}"
            )
        return np.array(np.broadcast_to(brdf, cosines[0].shape))  # a copy, because the object may return its argument


# What `_Completed` does not take from the object as it is.
_CHECKED = (
    "at",
    "summarize",
    "brdf_per_sr",
    "mean_brdf_per_sr",
    "sunlight_brdf_per_sr",
    "tilt_normals",
    "average_over_lens",
)


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, int | float) else "..."


def check_energy(what: str, total: float) -> None:
    """Raise `ValueError` if the reflectances of a material, which `what` names, add up to more than 1."""
    if total > 1.0 + 1e-12:
        raise ValueError(f"{what} is {total:.4g}, which is more than the incident light; keep the sum at or below 1")


def complete_cosines(
    cos_in: np.ndarray, cos_out: np.ndarray | None, cos_phase: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray | float]:
    """Return the three cosines as arrays. Those left out are the ones of a viewer where the light is.

    Parameters
    ----------
    cos_in, cos_out, cos_phase : as in `Scatterer.brdf_per_sr`
    """
    cos_in = np.asarray(cos_in, dtype=float)
    return cos_in, cos_in if cos_out is None else cos_out, 1.0 if cos_phase is None else cos_phase


def half_vector_cosines(
    cos_in: np.ndarray, cos_out: np.ndarray, cos_phase: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray | float]:
    """Return the cosines of the half vector's angles from the normal and from the light.

    Parameters
    ----------
    cos_in, cos_out, cos_phase : as in `Scatterer.brdf_per_sr`
    """
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
    """Return ρ = k_d/π + k_s (n+2)/(2π) cosⁿφ [1/sr] (Fuller et al., eq. 10), cos φ = 2 cos θᵢ cos θₒ - cos Δ ≥ 0.

    Parameters
    ----------
    cos_in, cos_out, cos_phase : as in `Scatterer.brdf_per_sr`
    """
    cos_phi = np.clip(2.0 * (cos_in * cos_out) - cos_phase, 0.0, 1.0)
    brdf: np.ndarray = diffuse / math.pi + specular * (exponent + 2.0) / (2.0 * math.pi) * cos_phi**exponent
    return brdf
