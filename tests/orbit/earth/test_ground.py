import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs, GroundStation, find_ground_track
from tests.orbit.earth.earth_for_tests import GEO, LOW, START

EPOCHS = Epochs(START, np.linspace(0.0, 7200.0, 61))


def skyfield_position(motion):
    from skyfield.positionlib import Geocentric

    states, time = motion.states(EPOCHS), EPOCHS.skyfield_time()
    au = units.ASTRONOMICAL_UNIT_M
    return Geocentric(states.position_m.T / au, states.velocity_m_s.T / au * units.DAY_S, t=time, center=399)


def test_the_track_is_skyfields():
    from skyfield.api import wgs84

    track, other = find_ground_track(LOW, EPOCHS), wgs84.geographic_position_of(skyfield_position(LOW))
    np.testing.assert_allclose(track.latitude_rad, other.latitude.radians, rtol=0, atol=1e-9)  # its three rounds
    turned = (track.longitude_rad - other.longitude.radians + math.pi) % math.tau - math.pi
    np.testing.assert_allclose(turned, 0.0, atol=1e-10)
    np.testing.assert_allclose(track.height_m, other.elevation.m, rtol=0, atol=1e-4)


def test_look_angles_are_skyfields():
    from skyfield.api import wgs84

    station = GroundStation(47.0671, 15.4933, 539.4)
    there = wgs84.latlon(station.latitude_deg, station.longitude_deg, elevation_m=station.height_m)
    for motion in (LOW, GEO):
        line = skyfield_position(motion) - there.at(EPOCHS.skyfield_time())
        altitude, azimuth, distance, _, _, rate = line.frame_latlon_and_rates(there)
        seen = station.see(motion, EPOCHS)
        np.testing.assert_allclose(seen.elevation_rad, altitude.radians, rtol=0, atol=1e-9)
        np.testing.assert_allclose(seen.azimuth_rad, azimuth.radians, rtol=0, atol=1e-8)
        np.testing.assert_allclose(seen.range_m, distance.m, rtol=0, atol=1e-2)
        np.testing.assert_allclose(seen.range_rate_m_s, rate.km_per_s * 1e3, rtol=0, atol=1e-3)
    np.testing.assert_allclose(
        station.states(EPOCHS).position_m, there.at(EPOCHS.skyfield_time()).position.m.T, atol=1e-3
    )


def test_a_station_moves_with_the_ground():
    states = GroundStation(60.0, 10.0).states(EPOCHS)
    speed = np.linalg.norm(
        states.velocity_m_s, axis=1
    )  # half of the equator's 465.1 m/s, and a little more: flattening
    np.testing.assert_allclose(speed, 465.101 * math.cos(math.radians(60.0)) * 1.00252, rtol=1e-4)


def test_bad_stations_are_told():
    for numbers in (
        (91.0, 0.0),
        (0.0, 361.0),
        (0.0, 0.0, 2e6),
        (0.0, 0.0, 0.0, 100.0),
        (float("nan"), 0.0),
        ("0", 0.0),
    ):
        with pytest.raises(ScenarioError, match="is not within"):
            GroundStation(*numbers)
