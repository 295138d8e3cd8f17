"""The pulsed laser: how many photons leave, and how they spread over the tangent plane."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from rso_lidar import units
from rso_lidar.part import Part, Positive

Divergence = Annotated[Positive, Field(lt=180)]


class Laser(Part):
    """A laser that lights the scene with one pulse for each frame, from the lidar's origin along its boresight.

    `divergence_deg` is the full angle, edge to edge of a square or circular footprint, 1/e² of a Gaussian one. The
    footprint ``as_printed`` is the square of the seed's eq. 7 as printed, which returns four times the energy sent.
    """

    wavelength_nm: Positive = 1064.0
    energy_mj: Positive = 50.0
    pulse_fwhm_ns: Positive = 8.0
    divergence_deg: Divergence = 2.5
    footprint: Literal["square", "circle", "gaussian", "as_printed"] = "square"

    @property
    def wavelength_m(self) -> float:
        """Return the vacuum wavelength [m]."""
        return self.wavelength_nm * units.NM

    @property
    def photons(self) -> float:
        """Return how many photons one pulse holds (the seed's E_tx in photons)."""
        return self.energy_mj * units.MJ / units.photon_energy_j(self.wavelength_m)

    @property
    def pulse_fwhm_s(self) -> float:
        """Return the full width of the pulse at half maximum [s]."""
        return self.pulse_fwhm_ns * units.NS

    @property
    def divergence_rad(self) -> float:
        """Return the full angle of the beam [rad]."""
        return self.divergence_deg * units.DEG

    @property
    def half_width_tangent(self) -> float:
        """Return tan(θ/2): half the footprint's width in the tangent plane at unit distance."""
        return math.tan(0.5 * self.divergence_rad)

    def lit(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return which points (x, y) of the tangent plane the footprint covers; a Gaussian covers all."""
        if self.footprint == "gaussian":
            return np.ones(np.broadcast(x, y).shape, dtype=bool)
        if self.footprint == "circle":
            inside: np.ndarray = x * x + y * y <= self.half_width_tangent**2
        else:
            inside = (np.abs(x) <= self.half_width_tangent) & (np.abs(y) <= self.half_width_tangent)
        return inside

    def density(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return photons per unit area of the tangent plane at (x, y), whose integral is `photons`.

        Square E/(4t²), circle E/(πt²), Gaussian 2E/(πt²)·exp(−2r²/t²), with t = tan(θ/2). ``as_printed`` is E/t²
        (seed eq. 7).

        >>> laser = Laser(divergence_deg=2.5)
        >>> float(laser.density(0.0, 0.0) * (2 * laser.half_width_tangent) ** 2 / laser.photons)
        1.0
        """
        t2 = self.half_width_tangent**2
        if self.footprint == "gaussian":
            bell: np.ndarray = 2.0 * self.photons / (math.pi * t2) * np.exp(-2.0 * (x * x + y * y) / t2)
            return bell
        area = {"square": 4.0 * t2, "circle": math.pi * t2, "as_printed": t2}[self.footprint]
        return np.where(self.lit(x, y), self.photons / area, 0.0)
