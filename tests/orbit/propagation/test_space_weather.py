"""Files of space weather: what is read from both formats, and what is refused."""

import datetime

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.propagation.space_weather import SpaceWeather
from tests.orbit.propagation.weather_for_tests import TEXT, make_csv


@pytest.fixture
def save(tmp_path):
    def write(text, name="sw.csv"):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return write


def test_both_formats_hold_the_same_days(save):
    csv, text = SpaceWeather.from_file(save(make_csv())), SpaceWeather.from_file(save(TEXT, "sw.txt"))
    assert csv.first_day == text.first_day == datetime.date(2024, 5, 5).toordinal()
    for name in ("flux", "daily_ap", "ap"):
        np.testing.assert_array_equal(getattr(csv, name), getattr(text, name))


def test_activity_is_that_which_the_model_takes(save):
    """The flux of the day before, and ap back from the current three hours: rows of CelesTrak's file, read by eye."""
    weather = SpaceWeather.from_file(save(TEXT))
    activity = weather.find_activity(datetime.date(2024, 5, 11).toordinal(), 1)
    assert (activity.f107, activity.f107a) == (223.4, 177.1)
    # 10 May: 12 12 9 7 22 179 300 300; 11 May: 400 236
    assert activity.ap[:5] == (271.0, 236.0, 400.0, 300.0, 300.0)
    assert activity.ap[5] == (22 + 179 + 7 + 9 + 12 + 12 + 9 + 7) / 8  # 9 May ends with 9 7


def test_activity_agrees_with_pymsis(save):
    pymsis = pytest.importorskip("pymsis", reason="the extra `atmosphere` is not installed")
    path = save(make_csv())
    weather = SpaceWeather.from_file(path)
    pymsis.utils.use_space_weather_file(path)
    try:
        for hour in range(3 * 24, 9 * 24, 5):
            instant = datetime.datetime(2024, 5, 5) + datetime.timedelta(hours=hour)
            flux, mean, ap = pymsis.utils.get_f107_ap(np.datetime64(instant))
            got = weather.find_activity(instant.toordinal(), instant.hour // 3)
            assert (got.f107, got.f107a) == (flux[0], mean[0])
            np.testing.assert_allclose(got.ap, ap[0], rtol=1e-12)
    finally:
        pymsis.utils.use_space_weather_file(save(make_csv(), "again.csv"))


@pytest.mark.parametrize("date", [(2024, 5, 7), (2024, 5, 14), (1990, 1, 1)])
def test_a_day_without_data_or_history_is_refused(save, date):
    weather = SpaceWeather.from_file(save(TEXT))
    with pytest.raises(ScenarioError, match=r"has no space weather for .*, only from 2024-05-08 to 2024-05-13; give"):
        weather.find_activity(datetime.date(*date).toordinal(), 0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "has neither a column DATE nor a line BEGIN OBSERVED"),
        (make_csv().replace("AP5,", "AP5x,"), "has no column AP5"),
        (make_csv().replace("F10.7_OBS,", "F10.7_SEEN,"), "has no column F10.7_OBS"),
        (make_csv().replace("2024-05-08", "2024-05-38"), "line 5: lacks a date"),
        (make_csv().replace(",236,236,", ",none,236,"), "line 8: lacks a date, a flux or an ap"),
        (make_csv().replace(",236,236,", ",536,236,"), "line 8: its numbers are no space weather"),
        (make_csv().replace("\n2024-05-08", "\n2024-05-09"), "2024-05-09 does not follow|2024-05-0. does not follow"),
        ("\n".join(make_csv().splitlines()[:3]), "has 2 days of space weather"),
        (TEXT.replace(" 400 236", " 4o0 236"), "lacks a date, a flux or an ap"),
    ],
)
def test_a_file_that_is_none_is_refused(save, text, message):
    with pytest.raises(ScenarioError, match=message):
        SpaceWeather.from_file(save(text))


def test_a_missing_file_is_named():
    with pytest.raises(ScenarioError, match=r"nrlmsis: none\.csv: no such file; give SW-All\.csv"):
        SpaceWeather.from_file("none.csv")
