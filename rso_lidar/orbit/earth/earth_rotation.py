"""The rotation of the Earth: between inertial axes and axes fixed in the Earth."""

from __future__ import annotations

import math

import numpy as np

from rso_lidar import units
from rso_lidar.orbit.earth.earth_orientation import EarthOrientation
from rso_lidar.orbit.epochs import J2000_TT_JD, TT_MINUS_TAI_S, Epochs
from rso_lidar.orbit.sets.teme import gcrs_from_teme

_STEP_S = 10.0  # of the difference quotient; rounding adds 1e-7 m/s at the distance of GEO
_TIO_ARCSEC_PER_CENTURY = -47e-6  # IERS Conventions 2010, eq. 5.13


def itrs_from_gcrs(epochs: Epochs, orientation: EarthOrientation | None = None) -> np.ndarray:
    """Return rotation matrices (time, 3, 3) from GCRS to Earth-fixed (ITRS, ITRF) coordinates.

    Precession (IAU 2006) and nutation (IAU 2000A) are skyfield's, as in `gcrs_from_teme`; the Earth turns by GMST 1982
    about the axis of TEME, which is the same angle as GAST about the axis of date.

    Without an orientation UT1 is skyfield's built-in table, and polar motion is left out: up to 0.6 arcsecond, 20 m on
    the ground. Where UT1 has been observed it is good to half a millisecond, 0.2 m at the equator. Where it is predicted
    it is good to some 20 ms.

    Parameters
    ----------
    epochs : instants
    orientation : polar motion and UT1 of the IERS; if omitted, as above
    """
    angle = _sidereal_angle_rad(epochs, orientation)
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y, z = np.moveaxis(gcrs_from_teme(epochs), -1, 0)
    matrix: np.ndarray = np.stack([c * x + s * y, c * y - s * x, z], axis=-2)
    if orientation is not None:
        matrix = np.einsum("tij,tjk->tik", _itrs_from_tirs(epochs, orientation), matrix)
    return matrix


def itrs_from_gcrs_rate(epochs: Epochs, orientation: EarthOrientation | None = None) -> np.ndarray:
    """Return the derivatives (time, 3, 3) [1/s] of `itrs_from_gcrs`, which the velocity in Earth-fixed axes needs."""
    after, before = (
        itrs_from_gcrs(Epochs(epochs.start_utc, epochs.time_s + step_s), orientation) for step_s in (_STEP_S, -_STEP_S)
    )
    turned = units.EARTH_ROTATION_RAD_S * _STEP_S  # the quotient of a rotation is short by sin(a) / a
    rate: np.ndarray = (after - before) / (2.0 * _STEP_S * math.sin(turned) / turned)
    return rate


def _sidereal_angle_rad(epochs: Epochs, orientation: EarthOrientation | None) -> np.ndarray:
    """Return Greenwich mean sidereal time of 1982 (time,) [rad] (Vallado et al., AIAA 2006-6753, app. C)."""
    if orientation is None:
        ut1_minus_tt_s = -np.asarray(epochs.skyfield_time().delta_t)
    else:
        ut1_minus_tt_s = orientation.ut1_minus_tai_at(epochs) - TT_MINUS_TAI_S
    whole, fraction = epochs.tt_julian()
    fraction = fraction + ut1_minus_tt_s / units.DAY_S
    t = (whole - J2000_TT_JD + fraction) / 36_525.0
    sidereal_s = 67_310.548_41 + (8_640_184.812_866 + (0.093_104 - 6.2e-6 * t) * t) * t
    turns = whole % 1.0 + fraction + sidereal_s / units.DAY_S % 1.0
    angle: np.ndarray = turns % 1.0 * math.tau
    return angle


def _itrs_from_tirs(epochs: Epochs, orientation: EarthOrientation) -> np.ndarray:
    """Return the rotation (time, 3, 3) by polar motion: R1(-y) R2(-x) R3(s') (IERS Conventions 2010, sec. 5.4.1)."""
    x, y = orientation.pole_at(epochs).T
    locator = _TIO_ARCSEC_PER_CENTURY * units.ARCSEC * epochs.tt_centuries()
    cx, sx, cy, sy, cs, ss = np.cos(x), np.sin(x), np.cos(y), np.sin(y), np.cos(locator), np.sin(locator)
    rows = [
        [cx * cs, cx * ss, sx],
        [sy * sx * cs - cy * ss, sy * sx * ss + cy * cs, -sy * cx],
        [-cy * sx * cs - sy * ss, -cy * sx * ss + sy * cs, cy * cx],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
