"""Time scales: leap seconds, split precision, and what skyfield is fed."""

import datetime

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs, format_utc

UTC = datetime.UTC
BEFORE_LEAP = datetime.datetime(2016, 12, 31, 23, 59, 55, tzinfo=UTC)
NOON = datetime.datetime(2024, 9, 17, 12, tzinfo=UTC)


def test_leap_second_is_an_ordinary_second():
    epochs = Epochs(BEFORE_LEAP, np.arange(10.0))
    # IERS Bulletin C 52: 23:59:60 follows 23:59:59 on 2016-12-31, so midnight is 6 s after 23:59:55
    assert format_utc(BEFORE_LEAP, 5.0) == "2016-12-31T23:59:60.000Z"
    assert format_utc(BEFORE_LEAP, 5.5) == "2016-12-31T23:59:60.500Z"
    assert format_utc(BEFORE_LEAP, 6.0) == "2017-01-01T00:00:00.000Z"
    np.testing.assert_array_equal(epochs.since(BEFORE_LEAP), np.arange(10.0))
    midnight = datetime.datetime(2017, 1, 1, tzinfo=UTC)
    np.testing.assert_array_equal(epochs.since(midnight), np.arange(10.0) - 6.0)
    whole, fraction = epochs.tt_julian()
    # 1e-16 day is the rounding of a fraction of a day
    np.testing.assert_allclose(np.diff(whole) + np.diff(fraction), 1.0 / 86400.0, rtol=0, atol=2.3e-16)


def test_leap_seconds_of_an_instant_can_be_held():
    epochs = Epochs(BEFORE_LEAP, np.arange(10.0))
    whole, fraction = epochs.utc_julian(leap_seconds_at=BEFORE_LEAP)
    steps = (np.diff(whole) + np.diff(fraction)) * 86400.0
    np.testing.assert_allclose(steps, 1.0, rtol=0, atol=2e-11)
    whole, fraction = epochs.utc_julian()
    steps = (np.diff(whole) + np.diff(fraction)) * 86400.0
    np.testing.assert_allclose(steps, [1, 1, 1, 1, 1, 0, 1, 1, 1], rtol=0, atol=2e-11)


@pytest.mark.parametrize("zone_h", [0, 2, -9])
def test_start_may_be_in_any_zone(zone_h):
    zone = datetime.timezone(datetime.timedelta(hours=zone_h))
    local = Epochs(NOON.astimezone(zone), np.array([0.25]))
    assert local.since(NOON)[0] == 0.25
    np.testing.assert_array_equal(local.utc_julian(), Epochs(NOON, np.array([0.25])).utc_julian())


def test_julian_dates_are_those_that_skyfield_feeds_to_sgp4():
    epochs = Epochs(datetime.datetime(2026, 3, 4, 5, 6, 7, 891234, tzinfo=UTC), np.linspace(-1e5, 1e5, 501))
    time = epochs.skyfield_time()
    whole, fraction = epochs.utc_julian()
    np.testing.assert_array_equal(whole, time.whole)
    np.testing.assert_array_equal(fraction, time.tai_fraction - time._leap_seconds() / 86400.0)


def test_split_precision_keeps_nanoseconds():
    # one float64 of a Julian date is 40 us coarse, 0.3 m along a low orbit
    time = Epochs(NOON, np.array([1000.0, 1000.0 + 1e-9])).skyfield_time()
    gap_s = ((time.whole[1] - time.whole[0]) + (time.tt_fraction[1] - time.tt_fraction[0])) * 86400.0
    assert gap_s == pytest.approx(1e-9, abs=2e-11)


def test_skyfield_reads_the_same_calendar():
    time = Epochs(NOON, np.array([86400.0 * 3 + 61.5])).skyfield_time()
    assert time.utc_iso(places=3)[0] == "2024-09-20T12:01:01.500Z"
    assert format_utc(NOON, 0.0) == "2024-09-17T12:00:00.000Z"
    assert format_utc(NOON, -0.0004) == "2024-09-17T12:00:00.000Z"


def test_centuries_since_j2000():
    # J2000.0 = 2000-01-01T12:00:00 TT = 11:58:55.816 UTC
    start = datetime.datetime(2000, 1, 1, 11, 58, 55, 816000, tzinfo=UTC)
    np.testing.assert_allclose(
        Epochs(start, np.array([0.0, 36525 * 86400.0])).tt_centuries(), [0.0, 1.0], rtol=0, atol=1e-20 + 4.5e-16
    )


def test_picking_and_shifting():
    epochs = Epochs(NOON, np.arange(5.0))
    assert len(epochs) == 5
    np.testing.assert_array_equal(epochs.at(2).time_s, [2.0])
    np.testing.assert_array_equal(epochs.at(slice(1, 3)).time_s, [1.0, 2.0])
    np.testing.assert_array_equal(epochs.at(np.array([4, 0])).time_s, [4.0, 0.0])
    np.testing.assert_array_equal(epochs.shift(-1.0).time_s, np.arange(5.0) - 1.0)
    assert not epochs.time_s.flags.writeable


@pytest.mark.parametrize("time_s", [[[0.0]], [np.nan], [np.inf]])
def test_times_must_be_a_finite_row(time_s):
    with pytest.raises(ScenarioError, match="time_s: needs one row"):
        Epochs(NOON, np.array(time_s))


def test_start_without_offset_is_refused():
    with pytest.raises(ScenarioError, match="ambiguous"):
        Epochs(datetime.datetime(2024, 9, 17), np.zeros(1))
