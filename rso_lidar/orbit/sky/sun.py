"""Where the Sun is, with no ephemeris file: 0.0105 degree off at most and 0.0035 rms, 2000 to 2050 (against ERFA's epv00).

The Astronomical Almanac's low-precision Sun (section C; Vallado 4th ed. alg. 29), which is in the mean equator and equinox
of date, turned to GCRS by the IAU 1976 precession (Lieske 1977; Vallado eq. 3-88): to leave that out would cost 0.37
degree in 2026. Its longitude contains the aberration of light, so it is the Sun as seen, 8 minutes late. How much of
its disc the Earth hides is the conical shadow of a sphere.
"""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.orbit.epochs import Epochs

_ARCSEC = units.DEG / 3600.0


def sun_position_m(epochs: Epochs) -> np.ndarray:
    """Return the Sun's position (time, 3) [m] from the Earth's centre in GCRS axes."""
    t = epochs.tt_centuries()
    return gcrs_from_mean_of_date(_mean_of_date_m(t), t)


def sun_direction(epochs: Epochs) -> np.ndarray:
    """Return unit vectors (time, 3) from the Earth's centre to the Sun in GCRS axes."""
    position = sun_position_m(epochs)
    direction: np.ndarray = position / np.linalg.norm(position, axis=1, keepdims=True)
    return direction


def sunlit_fraction(position_m: np.ndarray, sun_position_m: np.ndarray) -> np.ndarray:
    """Return the share (time) of the Sun's disc that a spherical Earth leaves free: 1 in full light, 0 in the umbra.

    Overlapping discs on the sky (Montenbruck & Gill, Satellite Orbits, sec. 3.4.2). Inside the Earth it is dark.

    Parameters
    ----------
    position_m : (time, 3) from the Earth's centre [m].
    sun_position_m : (time, 3) from the Earth's centre, in the same axes [m].
    """
    to_sun = sun_position_m - position_m
    distance = np.linalg.norm(position_m, axis=-1)
    sun = np.arcsin(units.SUN_RADIUS_M / np.linalg.norm(to_sun, axis=-1))  # a and b of the source: apparent radii
    earth = np.arcsin(np.minimum(units.EARTH_RADIUS_M / np.maximum(distance, units.EARTH_RADIUS_M), 1.0))
    across = np.linalg.norm(np.cross(position_m, to_sun), axis=-1)
    apart = np.arctan2(across, -np.sum(position_m * to_sun, axis=-1))  # c: between the discs' centres
    smaller = np.minimum(sun, earth)
    clear, inside = apart >= sun + earth, apart <= np.abs(sun - earth)
    partly = ~(clear | inside)
    c = np.where(partly, apart, 1.0)
    x = (c**2 + sun**2 - earth**2) / (2.0 * c)  # from the Sun's centre to the chord that the two rims share
    y = np.sqrt(np.maximum(sun**2 - x**2, 0.0))
    lens = sun**2 * np.arctan2(y, x) + earth**2 * np.arctan2(y, c - x) - c * y
    hidden = np.where(clear, 0.0, np.where(inside, np.pi * smaller**2, lens)) / (np.pi * sun**2)
    free: np.ndarray = np.where(distance < units.EARTH_RADIUS_M, 0.0, np.clip(1.0 - hidden, 0.0, 1.0))
    return free


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


def gcrs_from_mean_of_date(vectors: np.ndarray, t: np.ndarray) -> np.ndarray:
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
