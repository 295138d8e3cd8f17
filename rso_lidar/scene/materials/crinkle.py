"""Crinkled foil: a surface of small cells, each tilted by its own fixed angle."""

from __future__ import annotations

import functools
import math
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, Strict, model_validator

from rso_lidar import units
from rso_lidar.part import Fraction, NotNegative, Positive, Whole
from rso_lidar.scene.materials.lobe import Lobe
from rso_lidar.scene.materials.scatterer import MaterialPart, check_energy, complete_cosines, phong_per_sr

_Tilt = Annotated[float, Strict(), Field(gt=0, le=30)]
_NODES = 120  # along either slope: a lobe of exponent 300 is a third as wide as slopes of 5 degrees
_TIE = 1e-6  # components of a normal that differ by less are equal, to rounding
_OFF_THE_GRID = np.array([0.3819660, 0.2679492, 0.7320508])  # of a cell: faces are at round coordinates, cells are not


class Crinkled(MaterialPart):
    """Crinkled foil: Phong (Fuller et al., eq. 10) on cells of `cell_mm`, each tilted, so that glints sparkle as it turns.

    The slopes of a cell along two directions of the surface are normally distributed, each with the standard deviation
    tan(`tilt_deg`). `pattern` picks another set of slopes. A cell's light is weighted by its area as light and viewer see
    it, cos θᵢ' cos θₒ' / (cos θᵢ cos θₒ cos τ). Here τ is its tilt. Neighbouring cells shadow and mask it (Smith
    1967, normal slopes). Light that meets the foil twice is lost. Range and labels are those of the facet.

    A ray meets one cell. Where a ray's share of a pixel is much wider than a cell, frames sparkle too much. Phong with a
    lower exponent is then the better model, because it is the mean over cells.
    """

    type: Literal["crinkled"] = "crinkled"
    diffuse: Fraction = Field(description="Diffuse reflectance k_d of the foil itself, at the laser's wavelength.")
    specular: Fraction = Field(description="Specular reflectance k_s of the foil itself; k_d + k_s ≤ 1.")
    exponent: NotNegative = Field(
        description="Exponent n of the foil itself; a greater exponent gives a narrower glint from each cell."
    )
    tilt_deg: _Tilt = Field(description="Standard deviation of a cell's slope along any direction, as an angle [deg].")
    cell_mm: Positive = Field(default=50.0, description="Side of a cell [mm].")
    pattern: Whole = Field(
        default=0,
        description=(
            "Random seed of the arrangement; another number gives another arrangement with the same statistics."
        ),
    )

    @model_validator(mode="after")
    def _conserve_energy(self) -> Self:
        check_energy("diffuse + specular", self.diffuse + self.specular)
        return self

    @property
    def rms_slope(self) -> float:
        """Standard deviation of a cell's slope along any direction of the surface."""
        return math.tan(self.tilt_deg * units.DEG)

    @property
    def cell_m(self) -> float:
        """Side of a cell [m]."""
        return self.cell_mm * units.MM

    @property
    def is_narrow(self) -> bool:
        """Whether the lobe of a cell may change over the Sun's disc."""
        return self.specular > 0.0

    @property
    def lobe(self) -> Lobe | None:
        """The specular lobe of a cell."""
        return Lobe(self.specular / (self.diffuse + self.specular), self.exponent) if self.specular > 0.0 else None

    def tilt_normals(self, normal: np.ndarray, point: np.ndarray) -> np.ndarray:
        """Tilt normals of a surface to those of its cells. Each cell has one tilt."""
        along, across = _slopes(point, self)
        first = np.cross(normal.T, _farthest_axis(normal)).T
        first /= np.sqrt(np.einsum("ih,ih->h", first, first))
        second = np.cross(normal.T, first.T).T
        turned = normal + along * first + across * second
        unit: np.ndarray = turned / np.sqrt(np.einsum("ih,ih->h", turned, turned))
        return unit

    def brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the BRDF [1/sr] of one cell, for cosines from the normal of the cell."""
        cos_in, cos_out, phase = complete_cosines(cos_in, cos_out, cos_phase)
        return phong_per_sr(self.diffuse, self.specular, self.exponent, cos_in, cos_out, phase)

    def mean_brdf_per_sr(
        self, cos_in: np.ndarray, cos_out: np.ndarray | None = None, cos_phase: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the mean BRDF [1/sr] over many cells, by Gauss-Hermite quadrature over their slopes."""
        shape = np.shape(cos_in)
        given = np.broadcast_arrays(*complete_cosines(cos_in, cos_out, cos_phase))
        cos_in, cos_out, phase = (np.reshape(cosine, (-1, 1)) for cosine in given)
        node, weight = _nodes()
        p, q = (grid.ravel() * self.rms_slope for grid in np.meshgrid(node, node, indexing="ij"))
        share = np.outer(weight, weight).ravel()
        cos_tilt = 1.0 / np.sqrt(1.0 + p**2 + q**2)
        sin_in, sin_out = np.sqrt(np.maximum(1.0 - cos_in**2, 0.0)), np.sqrt(np.maximum(1.0 - cos_out**2, 0.0))
        flat = np.maximum(sin_in * sin_out, 1e-300)
        turn = np.clip((phase - cos_in * cos_out) / flat, -1.0, 1.0)  # cosine of the azimuth between the two
        met = np.maximum((cos_in + p * sin_in) * cos_tilt, 0.0)
        left = np.maximum((cos_out + sin_out * (p * turn + q * np.sqrt(1.0 - turn**2))) * cos_tilt, 0.0)
        seen = masking_shadowing(cos_in, cos_out, phase, self.rms_slope)
        rho = phong_per_sr(self.diffuse, self.specular, self.exponent, met, left, phase)
        mean = (share * rho * met * left / cos_tilt).sum(axis=-1, keepdims=True)
        return np.reshape(mean * seen / np.maximum(cos_in * cos_out, 1e-9), shape)


@functools.cache
def _nodes() -> tuple[np.ndarray, np.ndarray]:
    """Return nodes and weights of the mean over a standard normal variable."""
    node, weight = np.polynomial.hermite_e.hermegauss(_NODES)
    return node, weight / weight.sum()


def masking_shadowing(
    cos_in: np.ndarray, cos_out: np.ndarray, cos_phase: np.ndarray | float, slope: np.ndarray | float
) -> np.ndarray:
    """Return the share of cells that neighbours hide neither from the light nor from the viewer.

    For one direction this is Smith's share for normal slopes, 1 / (1 + Λ) (Smith 1967). Cells that are hidden from the one
    direction are also hidden from the other, the more so the smaller the azimuth φ between the two. The share of both is
    1 / (1 + max Λ + λ min Λ). Here λ is 4.41 φ / (4.41 φ + 1) (van Ginneken, Stavridi and Koenderink 1998). It equals
    Smith's share where light and viewer are in one place. It is nearly the product where they are on opposite sides.

    Parameters
    ----------
    slope : rms slope of the cells
    """
    cos_in, cos_out = np.clip(cos_in, 1e-9, 1.0), np.clip(cos_out, 1e-9, 1.0)
    flat = np.sqrt(np.maximum(1.0 - cos_in**2, 1e-18) * np.maximum(1.0 - cos_out**2, 1e-18))
    turn = 4.41 * np.arccos(np.clip((cos_phase - cos_in * cos_out) / flat, -1.0, 1.0))
    lambda_in, lambda_out = _smith_lambda(cos_in, slope), _smith_lambda(cos_out, slope)
    share: np.ndarray = 1.0 / (
        1.0 + np.maximum(lambda_in, lambda_out) + turn / (turn + 1.0) * np.minimum(lambda_in, lambda_out)
    )
    return share


def _smith_lambda(cosine: np.ndarray, slope: np.ndarray | float) -> np.ndarray:
    """Return Smith's Λ for a direction with that cosine from the normal."""
    from scipy.special import erf

    a = cosine / (np.sqrt(np.maximum(1.0 - cosine**2, 1e-18)) * math.sqrt(2.0) * slope)
    hidden: np.ndarray = 0.5 * (erf(a) - 1.0) + np.exp(-np.minimum(a * a, 700.0)) / (2.0 * a * math.sqrt(math.pi))
    above: np.ndarray = np.maximum(hidden, 0.0)
    return above


def _farthest_axis(normal: np.ndarray) -> np.ndarray:
    """Return the coordinate axis (hit, xyz) farthest from each normal (xyz, hit), the first of equal ones."""
    slant = np.abs(normal)
    axis: np.ndarray = np.eye(3)[np.argmax(slant < slant.min(axis=0) + _TIE, axis=0)]
    return axis


def _slopes(point: np.ndarray, material: Crinkled) -> tuple[np.ndarray, np.ndarray]:
    """Return the two slopes (hit) of the cells that hold points (xyz, hit): normal numbers, derived from the position."""
    cell = np.floor(point.T / (material.cell_mm * units.MM) + _OFF_THE_GRID).astype(np.int64).view(np.uint64)
    key = np.full(len(cell), np.uint64(material.pattern % 2**63))
    for axis in range(3):
        key = _mix_bits(key ^ cell[:, axis])
    first, second = ((_mix_bits(key + np.uint64(k)) >> np.uint64(11)).astype(float) * 2.0**-53 for k in (1, 2))
    radius = material.rms_slope * np.sqrt(-2.0 * np.log1p(-first))  # Box and Muller
    return radius * np.cos(2.0 * math.pi * second), radius * np.sin(2.0 * math.pi * second)


def _mix_bits(key: np.ndarray) -> np.ndarray:
    """Mix 64 bits of a key (hit), so that each affects all others (the finaliser of SplitMix64, Steele 2014)."""
    key = key + np.uint64(0x9E3779B97F4A7C15)
    key = (key ^ (key >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    key = (key ^ (key >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    spread: np.ndarray = key ^ (key >> np.uint64(31))
    return spread
