"""Sunlight in the receiver's band: the solar spectrum above the atmosphere, about the lines of usual lasers."""

import math
from functools import lru_cache

import numpy as np

from rso_lidar import units

# ASTM E490-00a, the Sun at 1 au outside the atmosphere [nm, W m-2 um-1].
_E490 = ((1060.0, 641.5), (1064.0, 645.9), (1550.0, 271.3), (1570.0, 264.5), (1572.0, 267.3))
_SUN_TEMPERATURE_K = 5772.0  # IAU 2015 resolution B3, nominal effective temperature
_SUN_SOLID_ANGLE_SR = math.pi * (units.SUN_RADIUS_M / units.ASTRONOMICAL_UNIT_M) ** 2
_BOLTZMANN_J_K = 1.380_649e-23  # SI
_DARK_EXPONENT = 600.0  # beyond it the irradiance underflows a float


def sun_irradiance_w_m2_um(wavelength_m: float) -> float:
    """Return the spectral irradiance of the Sun at 1 au [W m-2 um-1] (ASTM E490 at the lines of usual lasers).

    The ratio to a black body of 5772 K is interpolated between the five tabulated wavelengths and constant beyond them.
    Outside 400 to 2500 nm that is good to some 10 %.

    >>> round(sun_irradiance_w_m2_um(1064e-9), 1), round(sun_irradiance_w_m2_um(1570e-9), 1)
    (645.9, 264.5)
    """
    nm = wavelength_m / units.NM
    ratio = np.interp(nm, [at for at, _ in _E490], [value / _black_body(at * units.NM) for at, value in _E490])
    return float(ratio) * _black_body(wavelength_m)


def _black_body(wavelength_m: float) -> float:
    """Return the spectral irradiance of a black body as large and as hot as the Sun [W m-2 um-1] (Planck)."""
    exponent = units.photon_energy_j(wavelength_m) / (_BOLTZMANN_J_K * _SUN_TEMPERATURE_K)
    if exponent > _DARK_EXPONENT:
        return 0.0
    radiance = 2.0 * units.PLANCK_J_S * units.SPEED_OF_LIGHT_M_S**2 / wavelength_m**5 / math.expm1(exponent)
    return radiance * _SUN_SOLID_ANGLE_SR * units.UM


@lru_cache(maxsize=64)
def sun_photons_per_s_m2(wavelength_m: float, width_m: float) -> float:
    """Return the Sun's photons per second and square metre at 1 au in a band (ASTM E490 at the lines of usual lasers).

    Parameters
    ----------
    wavelength_m : middle of the band [m]
    width_m : of the band [m]
    """
    return sun_irradiance_w_m2_um(wavelength_m) * (width_m / units.UM) / units.photon_energy_j(wavelength_m)
