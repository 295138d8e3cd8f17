"""Constants against their sources, and conversions that go there and back."""

import math

import pytest
from scipy import constants

from rso_lidar import units


def test_constants_of_the_si_are_exact():
    """CODATA, through scipy: both define the SI, so there is nothing to tolerate."""
    assert constants.c == units.SPEED_OF_LIGHT_M_S
    assert constants.h == units.PLANCK_J_S
    assert constants.au == units.ASTRONOMICAL_UNIT_M
    assert constants.day == units.DAY_S


def test_earth_agrees_with_the_first_wgs84():
    """WGS 84 was published with GM = (3986005 +- 0.6) 1e8 m3/s2, which sgp4 keeps; the refined value is within that."""
    from sgp4.earth_gravity import wgs84

    assert wgs84.radiusearthkm * units.KM == units.EARTH_RADIUS_M
    assert units.EARTH_GM_M3_S2 == pytest.approx(wgs84.mu * units.KM**3, abs=0.6e8)


def test_earth_agrees_with_skyfield():
    """skyfield keeps the radius of the IERS Conventions 2010, 6378136.6 m, for which WGS84 has 6378137."""
    from skyfield.constants import ERAD

    assert units.EARTH_RADIUS_M == pytest.approx(ERAD, abs=0.5)


@pytest.mark.parametrize(
    ("value", "unit", "si"),
    [
        (180.0, units.DEG, math.pi),
        (35_786.0, units.KM, 35_786_000.0),
        (15.0, units.MM, 0.015),
        (50.0, units.UM, 50e-6),
        (1064.0, units.NM, 1.064e-6),
        (8.0, units.NS, 8e-9),
        (50.0, units.MJ, 0.050),
    ],
)
def test_multiplying_reaches_si_and_dividing_leaves_it(value, unit, si):
    assert value * unit == pytest.approx(si, rel=4e-16)
    assert si / unit == pytest.approx(value, rel=4e-16)


def test_photon_energy_in_electronvolts():
    """hc = 1239.841984 eV nm exactly to the digits printed (CODATA 2018), so 1064 nm is 1.165265 eV."""
    assert units.photon_energy_j(1064e-9) / constants.e == pytest.approx(1239.841984 / 1064, rel=1e-9)


def test_a_delay_of_a_nanosecond_is_fifteen_centimetres_of_range():
    """Out and back: half of what light travels, c being exact."""
    assert units.NS * units.RANGE_PER_DELAY_M_S == pytest.approx(0.149896229, rel=4e-16)
