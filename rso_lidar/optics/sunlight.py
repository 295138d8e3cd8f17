"""Sunlight in a band: the solar spectrum above the atmosphere, from 325 nm and about the lines of usual lasers."""

import math
from functools import lru_cache

import numpy as np

from rso_lidar import units

# ASTM E490-00a, the Sun at 1 au outside the atmosphere [nm, W m-2 um-1].
_E490 = ((1060.0, 641.5), (1064.0, 645.9), (1550.0, 271.3), (1570.0, 264.5), (1572.0, 267.3))
# ASTM G173-03, extraterrestrial column: means over 25 nm about each wavelength [nm, W m-2 um-1].
_G173 = (
    *((325.0, 842.6), (350.0, 971.6), (375.0, 1104.2), (400.0, 1431.2), (425.0, 1678.6), (450.0, 1956.0)),
    *((475.0, 1995.4), (500.0, 1932.5), (525.0, 1852.9), (550.0, 1850.8), (575.0, 1836.0), (600.0, 1758.6)),
    *((625.0, 1670.5), (650.0, 1571.0), (675.0, 1510.7), (700.0, 1428.7), (725.0, 1339.7), (750.0, 1273.1)),
    *((775.0, 1208.2), (800.0, 1136.3), (825.0, 1073.4), (850.0, 1002.0), (875.0, 951.5), (900.0, 916.3)),
    *((925.0, 872.6), (950.0, 820.6), (975.0, 779.7), (1000.0, 741.1), (1025.0, 697.6)),
)
_WIDEST_STEP_M = 25e-9  # of the integral over a band
_SUN_TEMPERATURE_K = 5772.0  # IAU 2015 resolution B3, nominal effective temperature
_SUN_SOLID_ANGLE_SR = math.pi * (units.SUN_RADIUS_M / units.ASTRONOMICAL_UNIT_M) ** 2
_BOLTZMANN_J_K = 1.380_649e-23  # SI
_DARK_EXPONENT = 600.0  # beyond it the irradiance underflows a float


def sun_irradiance_w_m2_um(wavelength_m: float) -> float:
    """Return the spectral irradiance of the Sun at 1 au [W m-2 um-1] (ASTM G173, and E490 at the lines of usual lasers).

    The ratio to a black body of 5772 K is interpolated between the tabulated wavelengths and constant beyond them. Up to
    1025 nm the table holds means over 25 nm, without the lines of Fraunhofer. From 1.1 to 2.5 um it is good to some 10 %.

    >>> round(sun_irradiance_w_m2_um(1064e-9), 1), round(sun_irradiance_w_m2_um(1570e-9), 1)
    (645.9, 264.5)
    """
    nm = wavelength_m / units.NM
    ratio = np.interp(nm, *_ratios())
    return float(ratio) * _black_body(wavelength_m)


@lru_cache(maxsize=1)
def _ratios() -> tuple[np.ndarray, np.ndarray]:
    """Return the tabulated wavelengths [nm] and the ratio of the Sun's irradiance to the black body's there."""
    table = np.array([*_G173, *_E490])
    return table[:, 0], np.array([value / _black_body(at * units.NM) for at, value in table.tolist()])


def _black_body(wavelength_m: float) -> float:
    """Return the spectral irradiance of a black body as large and as hot as the Sun [W m-2 um-1] (Planck)."""
    exponent = units.photon_energy_j(wavelength_m) / (_BOLTZMANN_J_K * _SUN_TEMPERATURE_K)
    if exponent > _DARK_EXPONENT:
        return 0.0
    radiance = 2.0 * units.PLANCK_J_S * units.SPEED_OF_LIGHT_M_S**2 / wavelength_m**5 / math.expm1(exponent)
    return radiance * _SUN_SOLID_ANGLE_SR * units.UM


@lru_cache(maxsize=64)
def sun_photons_per_s_m2(wavelength_m: float, width_m: float) -> float:
    """Return the Sun's photons per second and square metre at 1 au in a band.

    A band wider than 25 nm is integrated in steps of at most that width.

    Parameters
    ----------
    wavelength_m : middle of the band [m]
    width_m : of the band [m]
    """
    steps = max(1, math.ceil(width_m / _WIDEST_STEP_M - 1e-9))
    step_m = width_m / steps
    middles = [wavelength_m + (k + 0.5 - 0.5 * steps) * step_m for k in range(steps)]
    return sum(
        sun_irradiance_w_m2_um(at) * (step_m / units.UM) / units.photon_energy_j(at) for at in middles if at > 0.0
    )
