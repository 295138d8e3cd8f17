"""Reports of given light: a report near the range of the light counts, any other is a false alarm."""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.records import Photons, Reading

_NEAR_M = 5.0  # a report farther from the light of its pixel is a false alarm; a pulse length if that is more


def mark_reports(reading: Reading, photons: Photons, mine: np.ndarray) -> np.ndarray:
    """Mark the pixels (pixel) that report the given returns: pixels that they light and whose range is near theirs.

    Parameters
    ----------
    reading : of the flash
    photons : light of the flash
    mine : (return) whether a report of this return counts

    Returns
    -------
    np.ndarray
        (pixel) bool, row by row.
    """
    n_pixels = photons.shape[0] * photons.shape[1]
    listed = reading.range_m if reading.return_range_m is None else reading.return_range_m
    low_m, high_m = bound_reports(photons, mine)
    listed = np.asarray(listed, dtype=float).reshape(n_pixels, -1)
    with np.errstate(invalid="ignore"):
        inside = (listed >= low_m[:, None]) & (listed <= high_m[:, None])
    marked: np.ndarray = np.any(inside, axis=1)
    return marked


def bound_reports(photons: Photons, mine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and greatest range (pixel) [m] of a report of the given returns; least > greatest without any.

    Parameters
    ----------
    mine : (return) whether a report of this return counts
    """
    n_pixels = photons.shape[0] * photons.shape[1]
    low_m, high_m = np.full(n_pixels, np.inf), np.full(n_pixels, -np.inf)
    range_m = photons.delay_s[mine] * units.RANGE_PER_DELAY_M_S
    np.minimum.at(low_m, photons.pixel[mine], range_m)
    np.maximum.at(high_m, photons.pixel[mine], range_m)
    beside_m = max(_NEAR_M, photons.pulse_fwhm_s * units.RANGE_PER_DELAY_M_S)
    return low_m - beside_m, high_m + beside_m
