"""The light of one pixel, by following the energy of a pulse: a second way to what the ray-traced chain adds up.

Of the pulse a share falls onto the patch that the pixel sees; the patch sends ρ cos α of it into each unit of solid angle;
the lens is π D²/4R² of that, and the optics pass η. Nothing here calls the radiometry of the chain: it reads the parts'
numbers, and a material's BRDF.
"""

from __future__ import annotations

import math

import numpy as np

from rso_lidar import units
from rso_lidar.optics import Laser, Receiver
from rso_lidar.optics.tables.laser_profiles import read_pattern
from rso_lidar.scene import Scatterer

_SLICES = 256  # of a pixel, where the rim of a round beam crosses it


def pixel_width_m(receiver: Receiver, range_m: np.ndarray) -> np.ndarray:
    """Return how wide a pixel on the boresight is at these ranges [m], across the line of sight."""
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
    """Return the photons on a pixel centred on the boresight (range), and which share of it the facet fills (range).

    The facet is flat, lies on the boresight, and is tilted by `tilt_rad` [rad] against it. It fills the pixel and its
    neighbours, or is a square of `facet_m2` [m²]: where the pixel is larger than that, photons fall with R⁻⁴. A laser beside
    the lens lights the facet from there; its distance and angle count as the lens's own, right to offset / range.

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
    """Return for how long light returns from a tilted facet in one pixel (range) [s]: 2 w tan α / c, w the width seen."""
    seen_m = pixel_width_m(receiver, range_m) * np.sqrt(fill)
    spread: np.ndarray = seen_m * math.tan(tilt_rad) / units.RANGE_PER_DELAY_M_S
    return spread


def _illuminated_share(laser: Laser, across_m: np.ndarray, range_m: np.ndarray) -> np.ndarray:
    """Return the share of the pulse's energy that falls onto a square of width `across_m` on the boresight (range)."""
    right_m, down_m, ahead_m = laser.offset_m
    before = range_m > ahead_m
    depth_m = np.where(before, range_m - ahead_m, 1.0)
    t = math.tan(0.5 * laser.divergence_deg * units.DEG)
    half = 0.5 * across_m / depth_m / t  # all in units of the beam's half width
    x, y = -right_m / depth_m / t, -down_m / depth_m / t
    if laser.footprint in ("square", "as_printed"):
        energy = (
            4.0 if laser.footprint == "as_printed" else 1.0
        )  # eq. 7 of Fuller et al. as printed sends four times its energy
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
    """Return how much of [low, high] lies within `half` of `middle`."""
    length: np.ndarray = np.maximum(np.minimum(middle + half, high) - np.maximum(middle - half, low), 0.0)
    return length


def _gaussian_share(middle: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Return the share of a normal law within `half` of `middle`: exp(−2x²), of which 1 is the 1/e² half width."""
    from scipy.special import ndtr

    share: np.ndarray = ndtr(2.0 * (middle + half)) - ndtr(2.0 * (middle - half))
    return share


def _circle_share(x: np.ndarray, y: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Return the share of the unit circle inside a square, slice by slice."""
    place = (np.arange(_SLICES) + 0.5) / _SLICES * 2.0 - 1.0
    across = x[..., None] + half[..., None] * place
    chord = np.sqrt(np.maximum(1.0 - across**2, 0.0))
    low = np.maximum(y[..., None] - half[..., None], -chord)
    inside = np.maximum(np.minimum(y[..., None] + half[..., None], chord) - low, 0.0)
    share: np.ndarray = inside.mean(axis=-1) * 2.0 * half / math.pi
    return share


def _pattern_share(pattern: np.ndarray, x: np.ndarray, y: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Return the share of a measured pattern (row, col), its cells evenly lit, inside a square."""
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
