"""The Moon, the pole and the sky of an integrator."""

import datetime
import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.orbit import Epochs, equator_axes, moon_position_m, sun_position_m
from rso_lidar.orbit.sky.almanac import Almanac
from rso_lidar.orbit.sky.moon import ecliptic_of_date
from rso_lidar.orbit.sky.precession import pole_direction

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)


def test_meeus_example_47a():
    # Meeus, Astronomical Algorithms 2nd ed., example 47.a: 1992 April 12, 0h TD, printed to 1e-6 degree and 0.1 km
    longitude, latitude, distance = ecliptic_of_date(np.array([(2448724.5 - 2451545.0) / 36525.0]))
    assert longitude[0] / units.DEG % 360.0 == pytest.approx(133.162655, abs=1e-6)
    assert latitude[0] / units.DEG == pytest.approx(-3.229126, abs=1e-6)
    assert distance[0] / units.KM == pytest.approx(368409.7, abs=0.1)


def test_the_moon_moves_like_the_moon():
    days = np.arange(0.0, 365.25 * 19, 0.5) * units.DAY_S
    position = moon_position_m(Epochs(START, days))
    distance = np.linalg.norm(position, axis=1)
    # Meeus ch. 50: perigees from 356,355 km, apogees to 406,726 km in the 21st century
    assert 356_300e3 < distance.min() < 357_500e3 and 406_000e3 < distance.max() < 406_800e3
    declination = np.arcsin(position[:, 2] / distance) / units.DEG
    assert 28.0 < declination.max() < 28.8  # obliquity 23.44 + inclination 5.15, once in 18.6 years


def test_new_moon_of_an_eclipse_is_before_the_sun():
    # NASA, solar eclipse of 2024 April 8: greatest at 18:17:18 UT, gamma 0.3431: Earth radii by which the axis misses
    at = Epochs(datetime.datetime(2024, 4, 8, 18, 17, 18, tzinfo=datetime.UTC), np.zeros(1))
    moon, sun = moon_position_m(at)[0], sun_position_m(at)[0]
    axis = (moon - sun) / np.linalg.norm(moon - sun)
    gamma = np.linalg.norm(np.cross(moon, axis)) / units.EARTH_RADIUS_M
    # the Sun is good to 0.0105 degree of the Moon's distance: 0.011 radii at most
    assert gamma == pytest.approx(0.3431, abs=0.012)


def test_pole_against_skyfield():
    epochs = Epochs(START, np.linspace(-24, 24, 25) * 365.25 * units.DAY_S)
    # skyfield: IAU 2006 precession, 2000A nutation; third row of true-of-date from GCRS
    true = np.moveaxis(epochs.skyfield_time().M, -1, 0)[:, 2]
    assert np.linalg.norm(pole_direction(epochs) - true, axis=1).max() < 0.3 / 3600 * units.DEG
    axes = equator_axes(epochs)
    np.testing.assert_allclose(
        np.einsum("tij,tkj->tik", axes, axes), np.broadcast_to(np.eye(3), axes.shape), atol=1e-15
    )
    np.testing.assert_array_equal(axes[:, 2], pole_direction(epochs))


def test_sky_interpolates_and_forgets_what_was_asked():
    times = np.array([-1e5, -1.0, 0.0, 450.0, 86399.0, 86400.0, 3e5])
    epochs = Epochs(START, times)
    sky = Almanac(START, sun=True, moon=True)
    got = [np.array(column) for column in zip(*(sky(t) for t in times.tolist()), strict=True)]
    for values, right in zip(
        got, (pole_direction(epochs), sun_position_m(epochs), moon_position_m(epochs)), strict=True
    ):
        off = np.linalg.norm(values - right, axis=1) / np.linalg.norm(right, axis=1)
        assert off.max() < 1e-11
    assert Almanac(START, sun=True, moon=True)(3e5) == sky(3e5)
    assert Almanac(START, sun=False, moon=False)(0.0)[1:] == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert math.isclose(np.linalg.norm(got[0][0]), 1.0, rel_tol=1e-12)
