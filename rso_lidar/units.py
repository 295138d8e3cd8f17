"""Physical constants in SI, and the only unit conversions of the package.

A conversion is a multiplication: ``laser.energy_mj * units.MJ`` is joules, ``angle_rad / units.DEG`` is degrees.
"""

import math

# CODATA 2018: both exact by definition of the SI.
SPEED_OF_LIGHT_M_S = 299_792_458.0
PLANCK_J_S = 6.626_070_15e-34
ELEMENTARY_CHARGE_C = 1.602_176_634e-19

# Earth. GM and equatorial radius of EGM96/WGS84 (IERS Conventions 2010, table 1.1 rounds GM to the same digits).
# SGP4 keeps its own WGS72 constants inside the sgp4 package.
EARTH_GM_M3_S2 = 3.986_004_418e14
EARTH_RADIUS_M = 6_378_137.0

# Zonal harmonics of EGM96, tide free (Lemoine et al. 1998): J_n = -sqrt(2 n + 1) C_n0, which belong to its own radius.
EARTH_J2 = 1.082_626_683_6e-3
EARTH_J3 = -2.532_656_485e-6
EARTH_J4 = -1.619_621_591e-6
EARTH_J5 = -2.272_960_83e-7
EARTH_J6 = 5.406_812_39e-7
EARTH_ZONAL_RADIUS_M = 6_378_136.3

# IERS Conventions 2010, table 1.1, to the digits of WGS84.
EARTH_ROTATION_RAD_S = 7.292_115e-5

# DE430 (Folkner et al. 2014, IPN 42-196), table 8.
SUN_GM_M3_S2 = 1.327_124_400_42e20
MOON_GM_M3_S2 = 4.902_800_066e12

# IAU working group on cartographic coordinates (2015): mean radius.
MOON_RADIUS_M = 1_737_400.0

# GRAIL, as in DE430 (Folkner et al. 2014, IPN 42-196), to four digits; radius 1738 km.
MOON_J2 = 2.032e-4

# IAU 2012 resolution B2, exact.
ASTRONOMICAL_UNIT_M = 149_597_870_700.0

# IAU 2015 resolution B3, nominal.
SUN_RADIUS_M = 6.957e8

# IAU 2015 resolution B3, nominal irradiance at 1 AU, 1361 W/m2, over the speed of light: on what absorbs it.
SOLAR_PRESSURE_N_M2 = 1361.0 / SPEED_OF_LIGHT_M_S

EARTH_FLATTENING = 1.0 / 298.257_223_563  # WGS84

STANDARD_GRAVITY_M_S2 = 9.806_65  # 3rd CGPM 1901, exact; specific impulse is counted in it

DAY_S = 86_400.0

# Multiply by these to reach SI; divide by them to leave it.
DEG = math.pi / 180.0
ARCSEC = DEG / 3600.0
MRAD = 1e-3
DEG_H = DEG / 3600.0  # deg/h to rad/s
DEG_SQRT_H = DEG / 60.0  # deg/√h to rad/√s
M_S_SQRT_H = 1.0 / 60.0  # m/s/√h to m/s²/√Hz
PER_SQRT_H = 1.0 / 60.0  # 1/√h to 1/√s
UG = 1e-6 * STANDARD_GRAVITY_M_S2
RPM = 2.0 * math.pi / 60.0
PPM = 1e-6
KM = 1e3
CM = 1e-2
MM = 1e-3
UM = 1e-6
NM = 1e-9
NS = 1e-9
NS_PER_S = 1_000_000_000  # an integer, for time stamps in whole nanoseconds
MJ = 1e-3
MS = 1e-3
US = 1e-6
MHZ = 1e6
NA = 1e-9
PA = 1e-12
NF = 1e-9


def photon_energy_j(wavelength_m: float) -> float:
    """Return the energy of one photon [J] of vacuum wavelength `wavelength_m` [m].

    >>> round(1e19 * photon_energy_j(1064e-9), 3)
    1.867
    """
    return PLANCK_J_S * SPEED_OF_LIGHT_M_S / wavelength_m


def format_count(count: float, noun: str) -> str:
    """Format a number of things.

    >>> format_count(1, "facet"), format_count(2000, "facet"), format_count(0.5, "day")
    ('1 facet', '2,000 facets', '0.5 days')
    """
    return f"{count:,.10g} {noun}{'s' * (count != 1)}"


# Light goes out and comes back: multiply a delay by this to have a range, divide a range by it to have a delay.
RANGE_PER_DELAY_M_S = 0.5 * SPEED_OF_LIGHT_M_S

# Full width at half maximum of a Gaussian over its sigma: 2 sqrt(2 ln 2).
FWHM_PER_SIGMA = 2.0 * math.sqrt(2.0 * math.log(2.0))
