"""Light of one facet on one pixel in closed form, independent of the ray-traced chain.

A share of the pulse falls onto the patch that the pixel sees. The patch scatters ρ cos α of it into each unit of solid
angle. The lens covers π D²/4R² of that, and the optics transmit η. This module uses the parts' numbers and a material's
BRDF only, so that it can verify the radiometry of the chain.
"""

from __future__ import annotations

import math

import numpy as np

from rso_lidar import units
from rso_lidar.optics import Laser, Receiver, read_pattern
from rso_lidar.scene import Scatterer

_SLICES = 256  # of a pixel that the edge of a round beam crosses


def pixel_width_m(receiver: Receiver, range_m: np.ndarray) -> np.ndarray:
    """Return the width [m] of a pixel on the boresight at some ranges [m], across the line of sight."""
    width: np.ndarray = np.asarray(range_m, dtype=float) * (receiver.pixel_pitch_m / receiver.focal_length_m)
    return width


def compute_photons(
    laser: Laser,
    receiver: Receiver,
    material: Scatterer,
    tilt_rad: float,
    range_m: np.ndarray,
    facet_m2: float | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the photons on a pixel centred on the boresight, and the share of the pixel that the facet fills.

    The facet is flat and lies on the boresight. Where the pixel is larger than the facet, photons fall with R⁻⁴. A laser
    beside the lens illuminates the facet from its own place. Its distance and angle are taken as those of the lens, an
    approximation good to offset / range.

    Parameters
    ----------
    tilt_rad : angle between the facet's normal and the boresight [rad]
    range_m : (range) ranges of the facet [m]
    facet_m2 : area of a square facet [m²] (None: it fills the pixel and its neighbours)

    Returns
    -------
    photons : (range) expected photons on the pixel.
    fill : (range) share of the pixel that the facet fills.

    >>> from rso_lidar.scene import Lambertian
    >>> photons, _ = compute_photons(Laser(), Receiver(fov_deg=2.5, f_number=2.8), Lambertian(), 0.0, np.array([3000.0]))
    >>> round(float(photons[0]))
    1001
    """
    range_m = np.asarray(range_m, dtype=float)
    cosine = math.cos(tilt_rad)
    pixel_m = pixel_width_m(receiver, range_m)
    across_m = pixel_m if facet_m2 is None else np.minimum(pixel_m, math.sqrt(facet_m2 * cosine))
    seen = material.at(laser.wavelength_m)
    toward_light = np.full(len(range_m), float(seen.mean_brdf_per_sr(np.array(cosine))))
    ahead = np.tile([0.0, 0.0, 1.0], (len(range_m), 1))
    brdf_per_sr = seen.average_over_lens(toward_light, ahead, range_m, np.array(laser.offset_m), receiver.aperture_m)
    sent = laser.energy_mj * units.MJ / units.photon_energy_j(laser.wavelength_nm * units.NM)
    lens_sr = 0.25 * math.pi * receiver.aperture_m**2 / range_m**2
    photons: np.ndarray = (
        sent * _illuminated_share(laser, across_m, range_m) * brdf_per_sr * cosine * lens_sr * receiver.transmission
    )
    return photons, (across_m / pixel_m) ** 2


def depth_spread_s(receiver: Receiver, tilt_rad: float, range_m: np.ndarray, fill: np.ndarray) -> np.ndarray:
    """Return the time (range) [s] over which light returns from a tilted facet in one pixel: 2 w tan α / c.

    Parameters
    ----------
    tilt_rad : angle between the facet's normal and the boresight [rad]
    range_m : (range) ranges of the facet [m]
    fill : (range) share of the pixel that the facet fills, which gives the visible width w
    """
    seen_m = pixel_width_m(receiver, range_m) * np.sqrt(fill)
    spread: np.ndarray = seen_m * math.tan(tilt_rad) / units.RANGE_PER_DELAY_M_S
    return spread


def _illuminated_share(laser: Laser, across_m: np.ndarray, range_m: np.ndarray) -> np.ndarray:
    """Return the share of the pulse's energy on a square on the boresight, by its width [m] and range [m] (range)."""
    right_m, down_m, ahead_m = laser.offset_m
    before = range_m > ahead_m
    depth_m = np.where(before, range_m - ahead_m, 1.0)
    t = math.tan(0.5 * laser.divergence_deg * units.DEG)
    half = 0.5 * across_m / depth_m / t  # all in units of the beam's half width
    x, y = -right_m / depth_m / t, -down_m / depth_m / t
    if laser.footprint in ("square", "as_printed"):
        energy = 4.0 if laser.footprint == "as_printed" else 1.0  # Fuller et al., eq. 7, as printed has a factor of 4
        share = energy * 0.25 * _overlap(x, half) * _overlap(y, half)
    elif laser.footprint == "gaussian":
        share = _gaussian_share(x, half) * _gaussian_share(y, half)
    elif laser.footprint == "circle":
        share = _circle_share(x, y, half)
    else:
        assert laser.pattern_file is not None
        share = _pattern_share(read_pattern(laser.pattern_file), x, y, half)
    return np.where(before, share, 0.0)


def _overlap(middle: np.ndarray, half: np.ndarray, low: float = -1.0, high: float = 1.0) -> np.ndarray:
    """Return the length of the part of an interval that lies within `half` of `middle`."""
    length: np.ndarray = np.maximum(np.minimum(middle + half, high) - np.maximum(middle - half, low), 0.0)
    return length


def _gaussian_share(middle: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Return the share of the Gaussian exp(−2x²), whose 1/e² half width is 1, within `half` of `middle`."""
    from scipy.special import ndtr

    share: np.ndarray = ndtr(2.0 * (middle + half)) - ndtr(2.0 * (middle - half))
    return share


def _circle_share(x: np.ndarray, y: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Return the share of the unit circle inside a square, summed over slices."""
    place = (np.arange(_SLICES) + 0.5) / _SLICES * 2.0 - 1.0
    across = x[..., None] + half[..., None] * place
    chord = np.sqrt(np.maximum(1.0 - across**2, 0.0))
    low = np.maximum(y[..., None] - half[..., None], -chord)
    inside = np.maximum(np.minimum(y[..., None] + half[..., None], chord) - low, 0.0)
    share: np.ndarray = inside.mean(axis=-1) * 2.0 * half / math.pi
    return share


def _pattern_share(pattern: np.ndarray, x: np.ndarray, y: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Return the share of a measured pattern inside a square.

    Parameters
    ----------
    pattern : (row, col) share of the energy in each cell, uniform within the cell
    x, y : middle of the square in units of the pattern's half width
    """
    rows, cols = pattern.shape
    shares = []
    for at_x, at_y, reach in np.broadcast(x, y, half):
        down, right = (
            _overlap(np.array(at), np.array(reach), np.arange(n) / n * 2.0 - 1.0, (np.arange(n) + 1.0) / n * 2.0 - 1.0)
            / (2.0 / n)
            for at, n in ((at_y, rows), (at_x, cols))
        )
        shares.append(float((pattern * down[:, None] * right).sum()))
    return np.array(shares).reshape(half.shape)


def filled_pixel_photons(laser: Laser, receiver: Receiver, brdf_per_sr: float, range_m: float) -> float:
    """Return the photons of a pixel on the boresight that a facet facing the lidar fills.

    Fuller et al., eq. 7, with the factor 4 (or the area of another footprint), before the APD.

    Examples
    --------
    >>> from rso_lidar.optics import Laser, Receiver
    >>> from math import pi
    >>> round(filled_pixel_photons(Laser(), Receiver(fov_deg=2.5, f_number=2.8), 0.30 / pi, 3000.0))
    1001
    """
    gathered = receiver.pixel_tangent**2 * receiver.aperture_area_m2 * receiver.transmission / range_m**2
    return float(laser.density(0.0, 0.0)) * brdf_per_sr * gathered  # type: ignore[arg-type]
