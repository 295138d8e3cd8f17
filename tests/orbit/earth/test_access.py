import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import (
    Catalog,
    Epochs,
    GroundStation,
    angle_rad,
    find_access,
    line_altitude_m,
    phase_angle_rad,
    sun_position_m,
    sunlit_fraction,
)
from tests.orbit.earth.earth_for_tests import GEO, LOW, START
from tests.orbit.sets.sets_for_tests import TERRASAR

DAY = Epochs(START, np.array([0.0, 86400.0]))
OTHER = LOW.replace(true_anomaly_deg=80.0, raan_deg=47.0, semi_major_axis_km=7078.137)


def mask_of(spans, time_s):
    return np.any([(time_s > one.from_s) & (time_s < one.to_s) for one in spans], axis=0) if spans else time_s < 0


def test_spans_are_those_of_a_fine_grid():
    fine = Epochs(START, np.arange(0.0, 86400.0, 7.0))
    a, b, sun = LOW.states(fine).position_m, OTHER.states(fine).position_m, sun_position_m(fine)
    conditions = {
        "max_range_m": (2.0e6, np.linalg.norm(b - a, axis=1) < 2.0e6),
        "sunlit": (True, sunlit_fraction(b, sun) > 0.5),
        "dark": (True, sunlit_fraction(a, sun) < 0.5),
        "sun_exclusion_deg": (40.0, angle_rad(b - a, sun - a) > 40.0 * units.DEG),
        "max_phase_deg": (70.0, phase_angle_rad(b, a, sun) < 70.0 * units.DEG),
    }
    clear = line_altitude_m(a, b) > 0.0
    for options in (
        ["max_range_m"],
        ["sunlit"],
        ["dark"],
        ["sun_exclusion_deg"],
        ["max_range_m", "sunlit", "max_phase_deg"],
    ):
        expected = clear.copy()
        for name in options:
            expected &= conditions[name][1]
        spans = find_access(LOW, OTHER, DAY, **{name: conditions[name][0] for name in options})
        assert 0 < expected.sum() < expected.size
        differ = mask_of(spans, fine.time_s) != expected
        edges = np.array([t for one in spans for t in (one.from_s, one.to_s)])
        # half of the Sun's disc is hidden where its centre is on the limb only to a part in some hundred of its disc
        assert np.all(np.abs(fine.time_s[differ, None] - edges).min(axis=1) < 0.2)
        assert all(np.linalg.norm(_line(one.closest_s)) == pytest.approx(one.closest_m) for one in spans)


def _line(time_s):
    at = Epochs(START, np.array([time_s]))
    return OTHER.states(at).position_m[0] - LOW.states(at).position_m[0]


def test_contacts_are_skyfields():
    from skyfield.api import EarthSatellite, load, wgs84

    (entry,) = Catalog.from_text("\n".join(TERRASAR))
    start = entry.epoch_utc.replace(hour=0, minute=0, second=0, microsecond=0)
    motion = Catalog.from_text("\n".join(TERRASAR)).trajectory(31698)
    station = GroundStation(47.0671, 15.4933, 539.4, least_elevation_deg=10.0)
    spans = find_access(station, motion, Epochs(start, np.array([0.0, 86400.0])))
    scale = load.timescale(builtin=True)
    t0 = scale.from_datetime(start)
    satellite = EarthSatellite(*TERRASAR, ts=scale)
    there = wgs84.latlon(station.latitude_deg, station.longitude_deg, elevation_m=station.height_m)
    times, kinds = satellite.find_events(there, t0, t0 + 1.0, altitude_degrees=10.0)
    rises, sets = ([(t - t0) * 86400.0 for t, kind in zip(times, kinds, strict=True) if kind == k] for k in (0, 2))
    assert len(spans) == len(rises) > 2
    # skyfield narrows events to half a second; between its own times its elevation changes by less than 0.1 deg/s
    np.testing.assert_allclose([one.from_s for one in spans], rises, atol=0.5)
    np.testing.assert_allclose([one.to_s for one in spans], sets, atol=0.5)
    edges = Epochs(start, np.array([t for one in spans for t in (one.from_s, one.to_s)]))
    altitude = (satellite - there).at(edges.skyfield_time()).altaz()[0].degrees
    np.testing.assert_allclose(altitude, 10.0, atol=2e-5)


def test_a_station_by_night_and_one_that_never_sees():
    night = find_access(GroundStation(0.0, 30.0), GEO, DAY, dark=True, sunlit=True)
    always = find_access(GroundStation(0.0, 30.0), GEO, DAY)
    lengths = [one.to_s - one.from_s for one in always]
    assert lengths in ([np.inf], [])  # of a geostationary satellite
    assert sum(min(one.to_s, 86400.0) - max(one.from_s, 0.0) for one in night) < 12 * 3600.0
    assert find_access(GroundStation(89.9, 0.0), GEO, DAY) == []  # below the horizon of the pole


def test_bad_limits_are_told():
    for options in (
        {"max_range_m": 0.0},
        {"sun_exclusion_deg": 200.0},
        {"max_phase_deg": -1.0},
        {"max_range_m": np.nan},
    ):
        with pytest.raises(ScenarioError, match="needs a number above 0"):
            find_access(LOW, OTHER, DAY, **options)
