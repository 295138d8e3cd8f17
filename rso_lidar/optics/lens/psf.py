"""Point spread functions: how the light of a point spreads over the pixels about its image.

A ray represents a sub-cell of a pixel. On the focal plane its light is the sub-cell's box convolved with the kernel.
`pixel_shares` gives the share of it that lands in each pixel nearby.
"""

from __future__ import annotations

import itertools
import math
from abc import abstractmethod
from functools import lru_cache
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.optics.lens.hat_weights import HatGrid, airy_hats, gaussian_hats, grid_hats, halo_hats
from rso_lidar.optics.tables import zemax
from rso_lidar.optics.tables.number_text import (
    cache_by_file,
    convert_decimal_commas,
    file_stamp,
    parse_matrix,
    read_text,
)
from rso_lidar.part import Fraction, NotNegative, Part, Positive, Text

MOST_REACH = 16  # pixels to each side
_LEAST_CAUGHT = 0.5  # a kernel that puts less than this within reach is a mistake in its size


class PsfPart(Part):
    """Base of all kernels: a share `halo_fraction` of the light may be in a wide halo of scattered light.

    The halo falls as (1 + (r / `halo_radius_um`)²)^(-3/2), as scatter from polished surfaces of slope 3 does (ABC
    model; Harvey & Shack). 29 % of its light is within the radius.
    """

    halo_fraction: Fraction = Field(default=0.0, description="Share of the light in a wide halo.")
    halo_radius_um: Positive | None = Field(
        default=None, description="Radius of the halo, within which 29 % of its light lies [µm]."
    )

    @model_validator(mode="after")
    def _check_halo(self) -> Self:
        if self.halo_fraction > 0.0 and self.halo_radius_um is None:
            raise ValueError("halo_fraction needs a halo_radius_um; give the radius of the halo")
        if self.halo_radius_um is not None and self.halo_fraction == 0.0:
            raise ValueError("halo_radius_um without a halo_fraction does nothing; give the halo's share of the light")
        return self

    def read(self) -> None:
        """Read the kernel's file, if it has one. An invalid file raises `ScenarioError`."""

    def read_bands(self) -> tuple[zemax.FileBand, ...]:
        """Read the wavelengths for which the kernel's file was computed; empty if it does not state them."""
        return ()

    @abstractmethod
    def core(self, at: HatGrid) -> np.ndarray:
        """Return the hat weights of the kernel without its halo: (row, col) share of the light at each point.

        Parameters
        ----------
        at : grid on the focal plane, with the width of its hats
        """

    def hats(self, at: HatGrid) -> np.ndarray:
        """Return the hat weights of the kernel, its halo included.

        Parameters
        ----------
        at : as for `core`
        """
        if self.halo_radius_um is None:
            return self.core(at)
        halo = halo_hats(self.halo_radius_um * units.UM, at)
        return (1.0 - self.halo_fraction) * self.core(at) + self.halo_fraction * halo


class GaussianPsf(PsfPart):
    """Gaussian blur of standard deviation `sigma_um` on the focal plane, along each axis."""

    type: Literal["gaussian"] = "gaussian"
    sigma_um: Positive = Field(description="Standard deviation on the focal plane, along each axis [µm].")

    def core(self, at: HatGrid) -> np.ndarray:
        """Return the hat weights (row, col): exact, by the error function."""
        return gaussian_hats(self.sigma_um * units.UM, at)


class AiryPsf(PsfPart):
    """Diffraction of a round aperture at the laser's wavelength and the receiver's f-number."""

    type: Literal["airy"] = "airy"

    def core(self, at: HatGrid) -> np.ndarray:
        """Return the hat weights (row, col), from rings of known energy."""
        return airy_hats(at)


class GridPsf(PsfPart):
    """Measured kernel: a table of intensities (rows from the top down) about the middle of its points.

    Commas, semicolons, tabs or spaces separate the numbers in `file`; `spacing_um` is the distance of the table's
    points on the focal plane. Each point represents the square about it.
    """

    type: Literal["grid"] = "grid"
    file: Text = Field(description="Path of a table of intensities, rows from the top down.")
    spacing_um: Positive = Field(description="Distance between points of the table on the focal plane [µm].")

    def read(self) -> None:
        """Read the table."""
        _table(self.file)

    def core(self, at: HatGrid) -> np.ndarray:
        """Return the hat weights (row, col) of the table."""
        values = _table(self.file)
        middle = (0.5 * (values.shape[0] - 1), 0.5 * (values.shape[1] - 1))
        return grid_hats(values, middle, self.spacing_um * units.UM, at)


class ZemaxPsf(PsfPart):
    """Kernel of a Zemax Huygens PSF listing, about the listing's center point."""

    type: Literal["zemax_huygens"] = "zemax_huygens"
    file: Text = Field(
        description="Path of a Zemax Huygens PSF listing, in UTF-16, UTF-8 or Latin-1, with decimal points or commas."
    )

    def read(self) -> None:
        """Read the listing."""
        zemax.read_huygens_psf(self.file)

    def read_bands(self) -> tuple[zemax.FileBand, ...]:
        """Read the wavelengths of the listing.

        Returns
        -------
        path of the listing, with its shortest and longest wavelength [m]; empty if the listing does not state them.
        """
        band_m = zemax.read_huygens_psf(self.file).wavelength_m
        return () if band_m is None else ((self.file, *band_m),)

    def core(self, at: HatGrid) -> np.ndarray:
        """Return the hat weights (row, col) of the listing."""
        listing = zemax.read_huygens_psf(self.file)
        return grid_hats(listing.values, listing.center, listing.spacing_m, at)


SinglePsf = Annotated[GaussianPsf | AiryPsf | GridPsf | ZemaxPsf, Field(discriminator="type")]


class FieldPsf(Part):
    """Kernel at the angle `field_deg` from the axis, with its field point towards the top row (Zemax: +y)."""

    field_deg: NotNegative = Field(description="Field angle from the optical axis [deg].")
    psf: SinglePsf = Field(
        description="Point spread function at this field angle; its top row points away from the axis."
    )


class FieldDependentPsf(Part):
    """Kernels at several field angles, interpolated linearly between neighbours and constant beyond the first and the last.

    Each is turned so that its top row points away from the axis, as for a lens that is symmetric about its axis.
    """

    type: Literal["field_dependent"] = "field_dependent"
    fields: Annotated[tuple[FieldPsf, ...], Field(min_length=1)] = Field(
        description="Point spread functions by ascending field angle."
    )

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        angles = [entry.field_deg for entry in self.fields]
        if any(b <= a for a, b in itertools.pairwise(angles)):
            raise ValueError("the field_deg of fields do not ascend; sort them, one kernel for each angle")
        return self

    def read_bands(self) -> tuple[zemax.FileBand, ...]:
        """Read for which wavelengths the kernels' files were computed.

        Returns
        -------
        path, shortest and longest wavelength [m] of each kernel's file that states them.
        """
        return tuple(band for entry in self.fields for band in entry.psf.read_bands())


Psf = Annotated[GaussianPsf | AiryPsf | GridPsf | ZemaxPsf | FieldDependentPsf, Field(discriminator="type")]
AnyPsf = GaussianPsf | AiryPsf | GridPsf | ZemaxPsf | FieldDependentPsf


def pixel_shares(
    psf: AnyPsf,
    *,
    pitch_m: float,
    sub: int,
    wavelength_m: float,
    f_number: float,
    field_rad: float = 0.0,
    azimuth_rad: float = 0.0,
    reach: int,
    margin: int = 0,
) -> np.ndarray:
    """Return the shares of a sub-cell's light that land in the pixels about it.

    Light beyond `reach` is shared among the pixels within, so that no energy is lost; see `find_reach`.

    Parameters
    ----------
    sub : sub-cells along each side of a pixel
    field_rad : angle from the axis; only a `FieldDependentPsf` depends on it
    azimuth_rad : direction of the field point, atan2(y, x) in lidar axes (x right, y down)
    reach : pixels to each side
    margin : 1 adds a sub-cell of the next pixel at both ends of the first two axes, for interpolation; 0 does not

    Returns
    -------
    (sub row, sub col, row offset, col offset), read-only, of sum 1 over the last two axes. Offsets run from -reach to reach.

    Raises
    ------
    ScenarioError : if the kernel's file is wrong, or less than half of its light lands within reach.
    """
    angles = float(field_rad), float(azimuth_rad)
    return _shares(psf, _stamps(psf), pitch_m, sub, wavelength_m, f_number, *angles, reach, margin)


def find_reach(
    psf: AnyPsf,
    *,
    pitch_m: float,
    wavelength_m: float,
    f_number: float,
    field_rad: float = 0.0,
    azimuth_rad: float = 0.0,
    missed: float = 1e-4,
) -> int:
    """Find the number of pixels to each side that receive the light of an evenly lit pixel, except a share; at most 16.

    Parameters
    ----------
    pitch_m : pixel pitch [m]
    wavelength_m : wavelength of the light [m]
    field_rad, azimuth_rad : field angle and direction, as in `pixel_shares`
    missed : share of the light that may land farther
    """
    within = _within(psf, _stamps(psf), pitch_m, wavelength_m, f_number, float(field_rad), float(azimuth_rad))
    enough = np.flatnonzero(within >= 1.0 - missed)
    return int(enough[0]) if len(enough) else MOST_REACH


def psf_files(psf: AnyPsf) -> tuple[str, ...]:
    """Return the files that a point spread function is read from."""
    return tuple(kernel.file for kernel in _kernels(psf) if isinstance(kernel, GridPsf | ZemaxPsf))


def _kernels(psf: AnyPsf) -> list[GaussianPsf | AiryPsf | GridPsf | ZemaxPsf]:
    return [entry.psf for entry in psf.fields] if isinstance(psf, FieldDependentPsf) else [psf]


def _stamps(psf: AnyPsf) -> tuple[tuple[str, int, int], ...]:
    return tuple(file_stamp(file) for file in psf_files(psf))


@lru_cache(maxsize=512)
def _shares(
    psf: AnyPsf,
    _stamped: tuple[tuple[str, int, int], ...],
    pitch_m: float,
    sub: int,
    wavelength_m: float,
    f_number: float,
    field_rad: float,
    azimuth_rad: float,
    reach: int,
    margin: int,
) -> np.ndarray:
    """Compute what `pixel_shares` returns, cached until a file of the kernel changes.

    Parameters
    ----------
    sub, field_rad, azimuth_rad, reach, margin : as for `pixel_shares`
    _stamped : path and state of each file of the kernel, the key of the cache

    Returns
    -------
    as `pixel_shares`, which also states the errors that are raised: `ScenarioError`.
    """
    for kernel in _kernels(psf):
        kernel.read()  # every kernel, so that an error in a file is raised before its field angle is needed
    at = HatGrid(pitch_m / sub, (reach + 1) * sub, wavelength_m * f_number)
    hats = _hats(psf, at, field_rad, azimuth_rad)
    offsets = 2 * reach + 1
    # A sub-cell at i moved by m steps is in the pixel (i + m) // sub: sum the steps that lead to each pixel.
    cells = np.arange(-margin, sub + margin)
    low = sub * np.arange(1, offsets + 1) - cells[:, None]  # (cell, offset), the first step's place in hats
    high = low + sub
    total = np.zeros((hats.shape[0] + 1, hats.shape[1] + 1))
    total[1:, 1:] = hats.cumsum(axis=0).cumsum(axis=1)
    row_low, row_high = low[:, None, :, None], high[:, None, :, None]
    col_low, col_high = low[None, :, None, :], high[None, :, None, :]
    shares = total[row_high, col_high] - total[row_low, col_high] - total[row_high, col_low] + total[row_low, col_low]
    shares = shares.clip(0.0)
    caught = shares.sum(axis=(2, 3), keepdims=True)
    if caught.min() < _LEAST_CAUGHT:
        raise ScenarioError(
            f"psf: only {100 * float(caught.min()):.2g} % of its light lands within {reach} pixels of "
            f"{pitch_m / units.UM:g} um; check its width, spacing and centre"
        )
    fractions: np.ndarray = shares / caught
    fractions.flags.writeable = False
    return fractions


@lru_cache(maxsize=256)
def _within(
    psf: AnyPsf,
    _stamped: tuple[tuple[str, int, int], ...],
    pitch_m: float,
    wavelength_m: float,
    f_number: float,
    field_rad: float,
    azimuth_rad: float,
) -> np.ndarray:
    """Return the share of an evenly lit pixel's light (reach) that lands within 0, 1 ... 15 pixels to each side.

    Parameters
    ----------
    _stamped, field_rad, azimuth_rad : as for `_shares`
    """
    at = HatGrid(pitch_m, MOST_REACH, wavelength_m * f_number)
    hats = _hats(psf, at, field_rad, azimuth_rad)
    m = MOST_REACH
    within = np.array([hats[m - n : m + n + 1, m - n : m + n + 1].sum() for n in range(MOST_REACH)])
    within.flags.writeable = False
    return within


def _hats(psf: AnyPsf, at: HatGrid, field_rad: float, azimuth_rad: float) -> np.ndarray:
    """Return the hat weights (row, col) at a field angle and azimuth."""
    if not isinstance(psf, FieldDependentPsf):
        return psf.hats(at)
    # Towards the top is azimuth -90°, y being down.
    at = at._replace(turn_rad=azimuth_rad + 0.5 * math.pi)
    angles = [entry.field_deg * units.DEG for entry in psf.fields]
    upper = int(np.searchsorted(angles, field_rad))
    if upper == 0 or upper == len(angles):
        return psf.fields[min(upper, len(angles) - 1)].psf.hats(at)
    share = (field_rad - angles[upper - 1]) / (angles[upper] - angles[upper - 1])
    return (1.0 - share) * psf.fields[upper - 1].psf.hats(at) + share * psf.fields[upper].psf.hats(at)


@cache_by_file(32)
def _table(path: str) -> np.ndarray:
    """Return the intensities (row, col) of a text file of numbers.

    Raises
    ------
    ScenarioError
        If it has fewer than two rows or columns, or if it holds anything but numbers from 0 up.
    """
    text = convert_decimal_commas(read_text(path))
    lines = [(number, line) for number, line in enumerate(text.splitlines(), start=1) if line.strip()]
    lines = [(number, line.replace(",", " ").replace(";", " ")) for number, line in lines if line.strip()[0] != "#"]
    values = parse_matrix(path, lines)
    if min(values.shape) < 2:
        raise ScenarioError(f"{path}: has {values.shape[0]} rows of {values.shape[1]}; a kernel needs rows and columns")
    values.flags.writeable = False
    return values
