"""What a real lens does to the image: light of one direction spread over pixels.

The spread acts on the oversampled image, before light is binned to pixels, and on each return by itself, so that two depths
which meet in a pixel stay two returns.
"""

from functools import lru_cache

import numpy as np

from rso_lidar.optics.laser import Laser
from rso_lidar.optics.psf import FieldDependentPsf, blur, pixel_shares, reach_of
from rso_lidar.optics.receiver import Receiver
from rso_lidar.records import Hits

_LEAST_PHOTONS = 1e-3  # less than this of a ray is not worth a return of its own: it stays where most of the ray goes
_MISSED = 1e-3  # of the light may lie beyond the pixels that are looked at; it is shared among them
_FINEST = 8  # places of a ray along each side of its pixel that its light is told apart by
_ZONES = 8  # along each side of the focal plane, in which a PSF that changes over the field is taken as one


def blurred(
    hits: Hits, photons: np.ndarray, receiver: Receiver, wavelength_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the returns behind the lens: hit each comes from, pixel it falls on, and share of the hit's photons.

    They are ordered by pixel. A hit's shares sum to 1, less what falls beside the focal plane.
    """
    sub = min(receiver.rays_per_side, _FINEST)
    direction = hits.rays.direction[hits.ray]
    col, row = receiver.image_of(direction[:, 0] / direction[:, 2], direction[:, 1] / direction[:, 2])
    sub_row, sub_col = (np.clip(((at - np.floor(at)) * sub).astype(np.int64), 0, sub - 1) for at in (row, col))
    if not isinstance(receiver.psf, FieldDependentPsf):
        shares = _shares(receiver, wavelength_m, 0.0, 0.0)
        return blur(hits.pixel, sub_row, sub_col, photons, receiver.shape, shares, _LEAST_PHOTONS)
    zone_row, zone_col = hits.pixel // receiver.n_cols, hits.pixel % receiver.n_cols
    zone = zone_row * _ZONES // receiver.n_rows * _ZONES + zone_col * _ZONES // receiver.n_cols
    found = []
    for number in np.unique(zone):
        of = np.flatnonzero(zone == number)
        x = ((number % _ZONES + 0.5) / _ZONES - 0.5) * receiver.n_cols * receiver.pixel_tangent
        y = ((number // _ZONES + 0.5) / _ZONES - 0.5) * receiver.n_rows * receiver.pixel_tangent
        shares = _shares(receiver, wavelength_m, float(np.arctan(np.hypot(x, y))), float(np.arctan2(y, x)))
        source, pixel, share = blur(
            hits.pixel[of], sub_row[of], sub_col[of], photons[of], receiver.shape, shares, _LEAST_PHOTONS
        )
        found.append((of[source], pixel, share))
    if not found:
        return np.zeros(0, np.int64), np.zeros(0, np.int32), np.zeros(0)
    source, pixel, share = (np.concatenate(column) for column in zip(*found, strict=True))
    order = np.lexsort((source, pixel))
    return source[order], pixel[order], share[order]


@lru_cache(maxsize=256)
def _shares(receiver: Receiver, wavelength_m: float, field_rad: float, azimuth_rad: float) -> np.ndarray:
    """Return the shares (sub row, sub col, row offset, col offset) of a ray's light, for one place in the field."""
    assert receiver.psf is not None
    optics = {
        "pitch_m": receiver.pixel_pitch_m,
        "wavelength_m": wavelength_m,
        "f_number": receiver.focal_length_m / receiver.aperture_m,
        "field_rad": field_rad,
        "azimuth_rad": azimuth_rad,
    }
    reach = reach_of(receiver.psf, missed=_MISSED, **optics)
    return pixel_shares(receiver.psf, sub=min(receiver.rays_per_side, _FINEST), reach=reach, **optics)


def read_files(laser: Laser, receiver: Receiver) -> None:
    """Read all files that laser and receiver name, so that what is wrong with one is told before the first flash."""
    laser.density(np.zeros(1), np.zeros(1))
    _ = laser.pulse, receiver.line_of_sight
    if receiver.distortion is not None:
        half = 0.5 * receiver.pixel_tangent
        receiver.distortion.check(half * receiver.n_cols, half * receiver.n_rows)
    if receiver.psf is not None:
        _shares(receiver, laser.wavelength_m, 0.0, 0.0)
