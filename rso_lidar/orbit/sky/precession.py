"""Precession (IAU 1976), and the Earth's pole with the four largest terms of nutation.

Precession: Lieske 1977 (Vallado 4th ed. eq. 3-88). Nutation: Meeus, Astronomical Algorithms 2nd ed., ch. 22. From 2000 to
2050 the pole is within 0.2 arcsecond of IAU 2006/2000A (ERFA's pnm06a). Through J2 that moves a low orbit by less than a
metre a day; without nutation it would be 10 arcseconds and 30 m.
"""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.orbit.epochs import Epochs

_ARCSEC = units.DEG / 3600.0


def pole_direction(epochs: Epochs) -> np.ndarray:
    """Return unit vectors (time, 3) along the Earth's axis of date in GCRS axes."""
    t = epochs.tt_centuries()
    node = (125.044_52 - 1934.136_261 * t) * units.DEG
    sun, moon = (280.4665 + 36_000.7698 * t) * units.DEG, (218.3165 + 481_267.8813 * t) * units.DEG
    longitude = -17.20 * np.sin(node) - 1.32 * np.sin(2 * sun) - 0.23 * np.sin(2 * moon) + 0.21 * np.sin(2 * node)
    obliquity = 9.20 * np.cos(node) + 0.57 * np.cos(2 * sun) + 0.10 * np.cos(2 * moon) - 0.09 * np.cos(2 * node)
    mean_obliquity = (23.439_291 - 0.013_004_2 * t) * units.DEG
    x, y = longitude * _ARCSEC * np.sin(mean_obliquity), obliquity * _ARCSEC
    of_date = np.stack([x, y, np.sqrt(1.0 - x * x - y * y)], axis=-1)
    return gcrs_from_mean_of_date(of_date, t)


def equator_axes(epochs: Epochs) -> np.ndarray:
    """Return rotation matrices (time, 3, 3) equator_from_gcrs.

    z is the pole of date; x is GCRS x after the smallest rotation that takes GCRS z to the pole.

    Parameters
    ----------
    epochs : instants
    """
    z = pole_direction(epochs)
    x = np.stack([1.0 - z[:, 0] ** 2, -z[:, 0] * z[:, 1], -z[:, 0] * z[:, 2]], axis=-1)
    x = x / np.sqrt(x[:, 0] ** 2 + x[:, 1] ** 2 + x[:, 2] ** 2)[:, None]
    return np.stack([x, np.cross(z, x), z], axis=-2)


def gcrs_from_mean_of_date(vectors: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Rotate vectors (time, 3) from mean-of-date to J2000.0 axes, which GCRS equals within 0.02 arcsecond."""
    zeta = (2306.2181 * t + 0.301_88 * t**2 + 0.017_998 * t**3) * _ARCSEC
    theta = (2004.3109 * t - 0.426_65 * t**2 - 0.041_833 * t**3) * _ARCSEC
    z = (2306.2181 * t + 1.094_68 * t**2 + 0.018_203 * t**3) * _ARCSEC
    x0, y0, z0 = vectors.T
    # J2000 = Rz(-zeta) Ry(theta) Rz(-z) as active rotations
    x1, y1 = np.cos(z) * x0 + np.sin(z) * y0, np.cos(z) * y0 - np.sin(z) * x0
    x2, z2 = np.cos(theta) * x1 + np.sin(theta) * z0, np.cos(theta) * z0 - np.sin(theta) * x1
    x3, y3 = np.cos(zeta) * x2 + np.sin(zeta) * y1, np.cos(zeta) * y1 - np.sin(zeta) * x2
    return np.stack([x3, y3, z2], axis=-1)
