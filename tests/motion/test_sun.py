"""The analytic Sun against a published example, ERFA, and the seasons."""

import datetime
import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.motion.epochs import Epochs
from rso_lidar.motion.sun import _mean_of_date_m, sun_direction, sun_position_m

WORST_DEG = 0.0105  # of this formula against ERFA's epv00 with aberration, 2000 to 2050


def at(*parts):
    return Epochs(datetime.datetime(*parts, tzinfo=datetime.UTC), np.zeros(1))


def separation_deg(a, b):
    return 2 * math.asin(np.linalg.norm(np.subtract(a, b)) / 2) / units.DEG


def test_vallado_example_5_1():
    # 2 April 2006, 00:00 UTC, mean of date. Vallado counts centuries from UT1, here 0.3 s from UTC (6e-8 au), and his
    # printed numbers come from a mean longitude of 36000.77 degrees a century, 0.001 less (1.1e-6 au by 2006)
    whole, fraction = at(2006, 4, 2).utc_julian()
    position = _mean_of_date_m((whole - 2451545.0 + fraction) / 36525.0)
    np.testing.assert_allclose(
        position[0] / units.ASTRONOMICAL_UNIT_M, [0.9771945, 0.1924424, 0.0834308], rtol=0, atol=1.3e-6
    )


@pytest.mark.parametrize(
    ("year", "month", "direction", "distance_au"),
    [  # ERFA 2.0.1 (IAU SOFA) epv00, first of the month 00:00 UTC: Sun from the Earth, with annual aberration, BCRS axes
        (2001, 1, (0.1843615, -0.9017549, -0.3909589), 0.983316),
        (2012, 4, (0.979946, 0.1828243, 0.0792532), 0.999276),
        (2024, 7, (-0.1619501, 0.9053916, 0.3924771), 1.016672),
        (2026, 10, (-0.9915294, -0.1191715, -0.0516491), 1.001326),
        (2040, 1, (0.1668177, -0.9046617, -0.3921212), 0.983313),
    ],
)
def test_against_erfa(year, month, direction, distance_au):
    epochs = at(year, month, 1)
    assert separation_deg(sun_direction(epochs)[0], direction) < WORST_DEG
    distance = np.linalg.norm(sun_position_m(epochs)[0]) / units.ASTRONOMICAL_UNIT_M
    assert distance == pytest.approx(distance_au, abs=1e-4)  # perturbations left out: 9e-5 at most


def of_date(epochs):
    """Return right ascension and declination [deg] in the true equator and equinox of date, by skyfield's matrix."""
    x, y, z = np.einsum("ijt,tj->ti", epochs.skyfield_time().M, sun_direction(epochs))[0]
    return math.atan2(y, x) / units.DEG, math.asin(z) / units.DEG


def test_march_equinox_2024():
    # US Naval Observatory, Earth's Seasons: 2024 March 20 03:06 UTC, where apparent longitude is 0.
    # The published minute is half a minute coarse: 0.0004 degree of longitude.
    ascension, declination = of_date(at(2024, 3, 20, 3, 6))
    assert abs(ascension) < WORST_DEG + 0.0004
    assert abs(declination) < (WORST_DEG + 0.0004) * math.sin(23.44 * units.DEG) + 0.0005  # and 1.2" of latitude


def test_june_solstice_2024():
    # US Naval Observatory: 2024 June 20 20:51 UTC, apparent longitude 90 degrees; true obliquity then 23.4385 degrees
    # (mean 23.43610 + nutation 8.7" by IAU 2000A, from skyfield)
    epochs = at(2024, 6, 20, 20, 51)
    ascension, declination = of_date(epochs)
    assert abs(ascension - 90.0) < (WORST_DEG + 0.0004) / math.cos(23.44 * units.DEG)
    time = epochs.skyfield_time()
    obliquity = (time._mean_obliquity_radians + time._nutation_angles_radians[1])[0] / units.DEG
    assert declination == pytest.approx(obliquity, abs=0.0015)  # the formula's obliquity is mean: nutation within 9.2"


def test_precession_is_not_forgotten():
    epochs = at(2026, 4, 2)
    mean = _mean_of_date_m(epochs.tt_centuries())[0]
    # general precession, 50.29" a year for 26.25 years
    assert separation_deg(mean / np.linalg.norm(mean), sun_direction(epochs)[0]) == pytest.approx(
        50.29 * 26.25 / 3600, abs=0.002
    )


def test_directions_are_unit_and_the_same_bits_in_any_company():
    epochs = Epochs(datetime.datetime(2024, 1, 1, tzinfo=datetime.UTC), np.linspace(0.0, 3e7, 101))
    together = sun_direction(epochs)
    np.testing.assert_allclose(np.linalg.norm(together, axis=1), 1.0, rtol=0, atol=4e-16)
    for k in (0, 7, 100):
        np.testing.assert_array_equal(sun_direction(epochs.at(k))[0], together[k])
