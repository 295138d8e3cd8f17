"""Where the Sun is, with no ephemeris file: 0.0105 degree off at most and 0.0035 rms, 2000 to 2050 (against ERFA's epv00).

The Astronomical Almanac's low-precision Sun (section C; Vallado 4th ed. alg. 29), which is in the mean equator and equinox
of date, turned to GCRS by the IAU 1976 precession (Lieske 1977; Vallado eq. 3-88): to leave that out would cost 0.37
degree in 2026. Its longitude contains the aberration of light, so it is the Sun as seen, 8 minutes late.
"""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.motion.epochs import Epochs

_ARCSEC = units.DEG / 3600.0


def sun_position_m(epochs: Epochs) -> np.ndarray:
    """Return the Sun's position (time, 3) [m] from the Earth's centre in GCRS axes."""
    t = epochs.tt_centuries()
    return _gcrs_from_mean_of_date(_mean_of_date_m(t), t)


def sun_direction(epochs: Epochs) -> np.ndarray:
    """Return unit vectors (time, 3) from the Earth's centre to the Sun in GCRS axes."""
    position = sun_position_m(epochs)
    direction: np.ndarray = position / np.linalg.norm(position, axis=1, keepdims=True)
    return direction


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


def _gcrs_from_mean_of_date(vectors: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return vectors (time, 3) turned from mean-of-date to J2000.0 axes, which GCRS equals within 0.02 arcsecond."""
    zeta = (2306.2181 * t + 0.301_88 * t**2 + 0.017_998 * t**3) * _ARCSEC
    theta = (2004.3109 * t - 0.426_65 * t**2 - 0.041_833 * t**3) * _ARCSEC
    z = (2306.2181 * t + 1.094_68 * t**2 + 0.018_203 * t**3) * _ARCSEC
    x0, y0, z0 = vectors.T
    # J2000 = Rz(-zeta) Ry(theta) Rz(-z) as active rotations
    x1, y1 = np.cos(z) * x0 + np.sin(z) * y0, np.cos(z) * y0 - np.sin(z) * x0
    x2, z2 = np.cos(theta) * x1 + np.sin(theta) * z0, np.cos(theta) * z0 - np.sin(theta) * x1
    x3, y3 = np.cos(zeta) * x2 + np.sin(zeta) * y1, np.cos(zeta) * y1 - np.sin(zeta) * x2
    return np.stack([x3, y3, z2], axis=-1)
