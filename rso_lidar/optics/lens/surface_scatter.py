"""Veiling glare: how much light of a source in or beside the field a lens scatters onto its focal plane."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.part import Count, Fraction, Number, Part, Positive

_MOST_SCATTER = 0.5  # share of the light that all surfaces may scatter; the law is for polished optics


class Baffle(Part):
    """Cylinder before the lens, open in front, whose axis is the boresight.

    It shades the lens from sources outside the field. The lit part of the aperture is its overlap with the opening,
    displaced by the length times the tangent of the source's angle. Light that walls and vanes scatter toward the lens
    is `leak_fraction` of what falls on the opening over the aperture's area.
    """

    length_mm: Positive = Field(description="Distance from the lens to the opening [mm].")
    diameter_mm: Positive = Field(description="Diameter of the opening [mm]; it must leave the field free.")
    leak_fraction: Fraction = Field(
        default=1e-4,
        description="Share of the light that still reaches the lens where the baffle shades all of it. Default: assumed.",
    )

    def lit_fraction(self, angle_rad: np.ndarray, aperture_m: float) -> np.ndarray:
        """Return the share (…) of the aperture that a distant source lights, with what leaks in.

        Parameters
        ----------
        angle_rad : (…) angle of the source from the boresight [rad]
        aperture_m : diameter of the lens [m]
        """
        lens, opening = 0.5 * aperture_m, 0.5 * self.diameter_mm * units.MM
        apart = self.length_mm * units.MM * np.tan(np.minimum(angle_rad, 0.5 * math.pi - 1e-6))
        low, high = abs(opening - lens), opening + lens
        partly = np.clip(apart, low + 1e-12 * high, high)
        # Overlap of two circles by the chord that they share.
        from_lens = (partly**2 + lens**2 - opening**2) / (2.0 * partly)
        chord = np.sqrt(np.maximum(lens**2 - from_lens**2, 0.0))
        overlap = lens**2 * np.arctan2(chord, from_lens) + opening**2 * np.arctan2(chord, partly - from_lens)
        overlap -= partly * chord
        free = np.where(apart <= low, min(lens, opening) ** 2 * math.pi, np.where(apart >= high, 0.0, overlap))
        free = np.where(np.asarray(angle_rad) >= 0.5 * math.pi, 0.0, free) / (math.pi * lens**2)
        lit: np.ndarray = np.where(np.asarray(angle_rad) >= 0.5 * math.pi, 0.0, np.maximum(free, self.leak_fraction))
        return lit


class Glare(Part):
    """Light of Sun, Earth and Moon: their images in the field of view, and what the lens scatters of it over the image.

    Each of the `surfaces` scatters by the law of Harvey and Shack, b₀ (1 + (|β − β₀| / L)²)^(s/2) [1/sr]. The direction
    cosines are β for the scattered and β₀ for the incoming light. The parameters are the peak b₀, the knee L and the
    slope s. The point source transmittance is the irradiance of the focal plane over that of the lens. For N surfaces near
    the aperture stop it is T N b₀ (1 + (sin θ / L)²)^(s/2) cos θ · π / (4 F²), with the f-number F and the transmission
    T. This follows from the definition of the BSDF: a pixel sees the scattered radiance as it sees any
    other.

    Laser light is not scattered by this law: the halo of `psf` describes that. The Earth is a Lambertian sphere without an
    atmosphere, of uniform albedo. The Moon has the phase law of Allen (Astrophysical Quantities, 1973) in visible light.
    """

    sources: tuple[Literal["sun", "earth", "moon"], ...] = Field(
        default=("sun", "earth", "moon"), description="Bodies whose light is included. Default: all."
    )
    peak_per_sr: Positive = Field(
        default=0.1,
        description="Peak b₀ of the scatter of one surface [1/sr]. Default: that of the ray tracer FRED.",
    )
    knee_sine: Annotated[Positive, Field(le=1)] = Field(
        default=0.01,
        description=(
            "Sine L of the angle from which the scatter falls. Default: that of FRED, whose manual gives 0.0001 to 0.01."
        ),
    )
    slope: Annotated[Number, Field(ge=-4, le=0)] = Field(
        default=-1.5,
        description=(
            "Slope s of the scatter beyond the knee, of its logarithm over that of the sine. Default: that of FRED, whose "
            "manual gives -0.5 to -2, and below -2.5 for a superpolish."
        ),
    )
    surfaces: Annotated[Count, Field(le=100)] = Field(
        default=8, description="Number N of surfaces that scatter. Default: assumed, four lenses."
    )
    earth_albedo: Fraction = Field(
        default=0.30,
        description="Albedo of the Earth in the laser's band. Default: assumed, the Bond albedo; clouds reach 0.7.",
    )
    baffle: Baffle | None = Field(default=None, description="Baffle before the lens. If omitted, there is none.")

    @model_validator(mode="after")
    def _check_scatter(self) -> Self:
        if not self.sources:
            raise ValueError("glare.sources is empty; name one of sun, earth and moon, or leave glare out")
        if self.total_scatter > _MOST_SCATTER:
            raise ValueError(
                f"peak_per_sr, knee_sine, slope and surfaces scatter {self.total_scatter:.2g} of the light, and the law is "
                f"for polished optics, up to {_MOST_SCATTER:g}; lower the peak"
            )
        return self

    @property
    def total_scatter(self) -> float:
        """Share of the light that all surfaces scatter: N times 2π ∫ b₀ (1 + (β/L)²)^(s/2) β dβ up to 1."""
        power = 0.5 * self.slope + 1.0
        grown = 1.0 + self.knee_sine**-2
        integral = math.log(grown) if abs(power) < 1e-9 else (grown**power - 1.0) / power
        return self.surfaces * math.pi * self.peak_per_sr * self.knee_sine**2 * integral

    def scatter_per_sr(self, shift: np.ndarray) -> np.ndarray:
        """Return the scatter (…) of all surfaces [1/sr].

        Parameters
        ----------
        shift : (…) difference |β − β₀| of the direction cosines of scattered and incoming light
        """
        scatter: np.ndarray = (
            self.surfaces * self.peak_per_sr * (1.0 + (shift / self.knee_sine) ** 2) ** (0.5 * self.slope)
        )
        return scatter

    def point_source_transmittance(self, angle_rad: np.ndarray, f_number: float, transmission: float) -> np.ndarray:
        """Return the irradiance on the axis of the focal plane over that on a plane across the light (…), without a baffle.

        Parameters
        ----------
        angle_rad : (…) angle of the source from the boresight [rad]
        f_number, transmission : of the lens
        """
        angle = np.asarray(angle_rad, dtype=float)
        gathered = transmission * math.pi / (4.0 * f_number**2)
        transmittance: np.ndarray = gathered * self.scatter_per_sr(np.sin(angle)) * np.maximum(np.cos(angle), 0.0)
        return transmittance
