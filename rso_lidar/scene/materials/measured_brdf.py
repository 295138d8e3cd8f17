"""Measured BRDF: a table over the angle of incidence, with the detector beside the laser."""

import functools
import math
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, Strict, model_validator

from rso_lidar.part import NotNegative
from rso_lidar.scene.materials.scatterer import MaterialPart, complete_cosines, half_vector_cosines
from rso_lidar.units import DEG

_COARSE_DEG = 2.5  # wider steps of the table are divided for the integral over the hemisphere
_Incidence = Annotated[float, Strict(), Field(ge=0, le=90)]


class TableBrdf(MaterialPart):
    """A BRDF measured with light and viewer in one place, linear in the angle, and constant beyond its ends.

    `measured_per_sr` belongs to `incidence_deg`. For two different directions the table is read at the angle between the
    normal and the half vector. This is reciprocal, and gives the measurement itself where the two directions are one. A
    table that reflects more light than comes in, at any incidence, is an error.
    """

    type: Literal["table"] = "table"
    incidence_deg: tuple[_Incidence, ...] = Field(description="Angles of incidence, ascending [deg].")
    measured_per_sr: tuple[NotNegative, ...] = Field(
        description="BRDF measured with the detector beside the laser, one value per angle, without the cosine [1/sr]."
    )

    @model_validator(mode="after")
    def _conserve_energy(self) -> Self:
        n, m = len(self.incidence_deg), len(self.measured_per_sr)
        if n != m or n < 2:
            raise ValueError(f"{n} angles and {m} values; give one value for each angle, at least two")
        if any(b <= a for a, b in zip(self.incidence_deg, self.incidence_deg[1:], strict=False)):
            raise ValueError("incidence_deg does not ascend; sort the table")
        most, worst_deg = _greatest_reflectance(self.incidence_deg, self.measured_per_sr)
        if most > 1.0 + 1e-3:
            raise ValueError(
                f"the table reflects {most:.4g} of the light that is incident at {worst_deg:g} deg; check its unit, 1/sr"
            )
        return self

    @property
    def is_narrow(self) -> bool:
        """Whether the lobe may change over the Sun's disc."""
        return True

    def brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the BRDF [1/sr]."""
        cos_in, cos_out, phase = complete_cosines(cos_in, cos_out, cos_phase)
        half_deg = np.arccos(half_vector_cosines(cos_in, cos_out, phase)[0]) / DEG
        brdf: np.ndarray = np.interp(half_deg, self.incidence_deg, self.measured_per_sr)
        return brdf


@functools.lru_cache(maxsize=64)
def _greatest_reflectance(incidence_deg: tuple[float, ...], measured_per_sr: tuple[float, ...]) -> tuple[float, float]:
    """Return the greatest directional-hemispherical reflectance of a table, and its angle of incidence [deg].

    The integral is over half vectors, dω = 4 cos(half, light) dω_half, because the table is a function of those. Gauss
    points are between the table's steps, even if these are fine.
    """
    knots = np.union1d(np.clip(incidence_deg, 0.0, 90.0), np.arange(0.0, 90.1, _COARSE_DEG)) * DEG
    point, share = np.polynomial.legendre.leggauss(4)
    width = np.diff(knots)[:, None]
    theta = (knots[:-1, None] + 0.5 * width * (1.0 + point)).ravel()
    azimuth = (np.arange(48) + 0.5) * math.pi / 48  # half of the circle; the other half is symmetric
    brdf = np.interp(theta / DEG, incidence_deg, measured_per_sr)
    weight = (0.5 * width * share).ravel() * np.sin(theta) * brdf * (2.0 * math.pi / 48)
    across = np.sin(theta)[:, None] * np.cos(azimuth)
    totals = []
    for incidence in np.arange(0.0, 90.0, 3.0):
        cos_in, sin_in = math.cos(incidence * DEG), math.sin(incidence * DEG)
        cos_facet = np.maximum(np.cos(theta)[:, None] * cos_in + across * sin_in, 0.0)
        cos_out = np.maximum(2.0 * cos_facet * np.cos(theta)[:, None] - cos_in, 0.0)
        totals.append((float(np.einsum("t,ta->", weight, 4.0 * cos_facet * cos_out)), float(incidence)))
    return max(totals)
