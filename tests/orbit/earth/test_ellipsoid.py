import numpy as np

from rso_lidar import units
from rso_lidar.orbit import Geodetic, geodetic_from_itrs, itrs_from_geodetic


def test_published_places():
    # Vallado 4th ed., example 3-3: geodetic coordinates of a satellite
    place = geodetic_from_itrs(1e3 * np.array([6524.834, 6862.875, 6448.296]))
    np.testing.assert_allclose(place.latitude_rad / units.DEG, 34.352496, atol=5e-7)
    np.testing.assert_allclose(place.longitude_rad / units.DEG, 46.4464, atol=5e-5)
    np.testing.assert_allclose(place.height_m, 5085.22e3, atol=5.0)
    # example 3-1: the telescope on Mount Evans
    site = itrs_from_geodetic(
        Geodetic(np.array(39.586667 * units.DEG), np.array(-105.64 * units.DEG), np.array(4347.667))
    )
    np.testing.assert_allclose([np.hypot(*site[:2]), site[2]], [4925429.8026, 4045493.7426], atol=0.1)


def test_it_is_skyfields():
    from skyfield.api import wgs84

    rng = np.random.default_rng(5)
    latitude, longitude = rng.uniform(-90.0, 90.0, 50), rng.uniform(-180.0, 180.0, 50)
    height_m = 10.0 ** rng.uniform(0.0, 7.6, 50)
    place = Geodetic(latitude * units.DEG, longitude * units.DEG, height_m)
    other = wgs84.latlon(latitude, longitude, height_m).itrs_xyz.m.T
    np.testing.assert_allclose(itrs_from_geodetic(place), other, rtol=0, atol=1e-6)


def test_there_and_back_from_deep_to_far():
    rng = np.random.default_rng(7)
    latitude = np.concatenate([[-np.pi / 2, np.pi / 2, 0.0], rng.uniform(-np.pi / 2, np.pi / 2, 500)])
    longitude = rng.uniform(-np.pi, np.pi, latitude.size)
    for height_m in (-1e6, -1e4, 0.0, 4e5, 4.2e7, 4e8):
        again = geodetic_from_itrs(itrs_from_geodetic(Geodetic(latitude, longitude, np.full_like(latitude, height_m))))
        np.testing.assert_allclose(again.latitude_rad, latitude, rtol=0, atol=1e-14)
        np.testing.assert_allclose(again.longitude_rad[3:], longitude[3:], rtol=0, atol=1e-14)
        np.testing.assert_allclose(again.height_m, height_m, rtol=1e-14, atol=2e-8)  # the radius rounds to 1e-9 m
