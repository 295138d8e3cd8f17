"""The Sun's position, without an ephemeris file.

Astronomical Almanac, low-precision Sun (section C; Vallado 4th ed. alg. 29), in the mean equator and equinox of date,
rotated to GCRS by the IAU 1976 precession. Without that rotation the error would be 0.37 degree in 2026. The longitude
contains the aberration of light, so it is the apparent Sun, 8 minutes late. Against ERFA's epv00, 2000 to 2050: 0.0105
degree at most, 0.0035 degree rms.
"""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.sky.precession import gcrs_from_mean_of_date


def sun_position_m(epochs: Epochs) -> np.ndarray:
    """Return the apparent position (time, 3) [m] of the Sun from the Earth's centre, in GCRS axes.

    Parameters
    ----------
    epochs : instants
    """
    t = epochs.tt_centuries()
    return gcrs_from_mean_of_date(_mean_of_date_m(t), t)


def _mean_of_date_m(t: np.ndarray) -> np.ndarray:
    """Return the Sun's position (time, 3) [m] in the mean equator and equinox of date, t Julian centuries since J2000.0."""
    anomaly = (357.529_109_2 + 35_999.050_34 * t) * units.DEG
    mean_longitude = 280.460 + 36_000.771 * t
    longitude = (mean_longitude + 1.914_666_471 * np.sin(anomaly) + 0.019_994_643 * np.sin(2.0 * anomaly)) * units.DEG
    obliquity = (23.439_291 - 0.013_004_2 * t) * units.DEG
    distance = 1.000_140_612 - 0.016_708_617 * np.cos(anomaly) - 0.000_139_589 * np.cos(2.0 * anomaly)
    sine = np.sin(longitude)
    direction = np.stack([np.cos(longitude), np.cos(obliquity) * sine, np.sin(obliquity) * sine], axis=-1)
    position: np.ndarray = distance[:, None] * units.ASTRONOMICAL_UNIT_M * direction
    return position
