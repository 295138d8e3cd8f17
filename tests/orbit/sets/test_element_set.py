"""The native record: OMM fields in, a Satrec and OMM fields out, and what is refused in words."""

import datetime

import numpy as np
import pytest

from rso_lidar.orbit import Epochs
from rso_lidar.orbit.sets.element_set import NO_EPOCH, element_set_from_omm, parse_epoch
from rso_lidar.orbit.sets.formats import parse_lines
from rso_lidar.orbit.sets.teme import propagate_in_teme

# python-sgp4's sample_omm.csv: Vanguard 1, CelesTrak
VANGUARD = {
    "OBJECT_NAME": "VANGUARD 1",
    "OBJECT_ID": "1958-002B",
    "EPOCH": "2020-10-13T04:52:48.472320",
    "MEAN_MOTION": "10.84869164",
    "ECCENTRICITY": ".1845686",
    "INCLINATION": "34.2443",
    "RA_OF_ASC_NODE": "225.5254",
    "ARG_OF_PERICENTER": "162.2516",
    "MEAN_ANOMALY": "205.2356",
    "EPHEMERIS_TYPE": "0",
    "CLASSIFICATION_TYPE": "U",
    "NORAD_CAT_ID": "5",
    "ELEMENT_SET_NO": "999",
    "REV_AT_EPOCH": "21814",
    "BSTAR": "-.22483E-4",
    "MEAN_MOTION_DOT": "-1.6E-7",
    "MEAN_MOTION_DDOT": "0",
}
# the same elements as a TLE (python-sgp4's tests)
VANGUARD_LINES = (
    "1 00005U 58002B   20287.20333880 -.00000016  00000-0 -22483-4 0  9998",
    "2 00005  34.2443 225.5254 1845686 162.2516 205.2356 10.84869164218149",
)


def states_of(elements):
    position_m, velocity_m_s, error = propagate_in_teme(
        elements, Epochs(elements.epoch_utc, np.linspace(-86400.0, 86400.0, 49))
    )
    assert not error.any()
    return position_m, velocity_m_s


def test_a_message_and_its_tle_fly_alike():
    omm, (tle,) = element_set_from_omm(VANGUARD, "here"), parse_lines(VANGUARD_LINES, "here")
    assert omm.problem is tle.problem is None
    for field in ("norad_id", "object_id", "epoch_utc", "eccentricity", "bstar_per_earth_radius", "element_set_no"):
        assert getattr(omm, field) == getattr(tle, field)
    assert (omm.mean_motion_dot_rev_day2, tle.mean_motion_dot_rev_day2) == (-1.6e-7, -1.6e-7)
    # the same digits through two readers: the last bit of an angle is 1e-16 rad, which a day of motion grows to um
    for ours, theirs in zip(states_of(omm), states_of(tle), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-5)


def test_the_number_is_no_part_of_the_motion():
    base = states_of(element_set_from_omm(VANGUARD, "here"))[0]
    for number in (339_999, 340_000, 799_500_123, 999_999_999):
        elements = element_set_from_omm({**VANGUARD, "NORAD_CAT_ID": number}, "here")
        assert (elements.norad_id, elements.problem) == (number, None)
        assert elements.label == f"VANGUARD 1 (NORAD {number})"
        np.testing.assert_array_equal(states_of(elements)[0], base)


def test_a_later_epoch_is_the_same_path_later():
    """A nanosecond is 6 um of this orbit: the epoch's digits below the microsecond are not lost."""
    plain = element_set_from_omm({**VANGUARD, "EPOCH": "2020-10-13T04:52:48"}, "here")
    later = element_set_from_omm({**VANGUARD, "EPOCH": "2020-10-13T04:52:48.000000500"}, "here")
    assert plain.problem is None  # an epoch without a fraction, which sgp4's own reader refuses
    assert (later.epoch_utc, later.epoch_rest_ns) == (plain.epoch_utc, 500.0)
    epochs = Epochs(plain.epoch_utc, np.array([0.0, 3000.0]))
    (position_m, velocity_m_s, _), (moved_m, _, _) = propagate_in_teme(plain, epochs), propagate_in_teme(later, epochs)
    # sgp4 counts minutes since epoch as a difference of days: 1e-16 day is 1e-11 s, below 1e-7 m
    np.testing.assert_allclose(position_m - moved_m, velocity_m_s * 500e-9, rtol=0, atol=5e-6)


@pytest.mark.parametrize(
    ("text", "expected", "rest_ns"),
    [
        ("2024-03-01T12:00:00", (2024, 3, 1, 12), 0.0),
        ("2024-061T12:00:00Z", (2024, 3, 1, 12), 0.0),
        ("2024-03-01 12:00:00.5", (2024, 3, 1, 12, 0, 0, 500000), 0.0),
        ("2024-03-01T12:00:00.123456789z", (2024, 3, 1, 12, 0, 0, 123456), 789.0),
        ("2024-366T23:59:59.+00:00", (2024, 12, 31, 23, 59, 59), 0.0),
    ],
)
def test_epochs_as_they_are_written(text, expected, rest_ns):
    assert parse_epoch(text) == (datetime.datetime(*expected, tzinfo=datetime.UTC), rest_ns)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("2023-366T00:00:00", "is not a calendar date"),
        ("2023-02-29T00:00:00", "is not a calendar date"),
        ("2016-12-31T23:59:60.5", "leap second"),
        ("2024-03-01T12:00:00+01:00", "is not a UTC instant"),
        ("2024-03-01", "is not a UTC instant"),
        ("1024-03-01T12:00:00", "is not between 1957 and 2200"),
        ("２０24-03-01T12:00:00", "is not a UTC instant"),
    ],
)
def test_epochs_that_are_none(text, why):
    with pytest.raises(ValueError, match=why):
        parse_epoch(text)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"ECCENTRICITY": "1.0"}, "eccentricity 1 is not from 0 to below 1"),
        ({"ECCENTRICITY": -0.1}, "eccentricity -0.1 is not"),
        ({"MEAN_MOTION": 0}, "mean motion 0 rev/day is not above 0"),
        # Kepler's third law: 17.04 rev/day at the Earth's radius, 0.0047 rev/day at its Hill sphere of 1.5 million km
        ({"MEAN_MOTION": 1e-300}, "mean motion 1e-300 rev/day is not that of an orbit about the Earth"),
        ({"MEAN_MOTION": 1e-9}, "is not that of an orbit about the Earth, which has 0.004 to 18"),
        ({"MEAN_MOTION": 1e300}, "is not that of an orbit about the Earth"),
        ({"INCLINATION": 181}, "inclination 181 is not from 0 to 180"),
        ({"RA_OF_ASC_NODE": 1e5}, "right ascension 100000 is not within 360"),
        ({"BSTAR": ""}, "BSTAR is missing"),
        ({"BSTAR": None, "EPOCH": None}, "EPOCH, BSTAR are missing"),
        ({"MEAN_ANOMALY": "nan"}, "MEAN_ANOMALY 'nan' is not a number"),
        ({"MEAN_ANOMALY": float("inf")}, "MEAN_ANOMALY 'inf' is not a number"),
        ({"MEAN_ANOMALY": "1_0"}, "MEAN_ANOMALY '1_0' is not a number"),
        ({"MEAN_ANOMALY": True}, "MEAN_ANOMALY 'True' is not a number"),
        ({"MEAN_ANOMALY": [1]}, "is not a number"),
        ({"NORAD_CAT_ID": "1000000000"}, "is not a whole number of at most 9 digits"),
        ({"NORAD_CAT_ID": "25544.5"}, "is not a whole number"),
        ({"EPOCH": "yesterday"}, "EPOCH 'yesterday' is not a UTC instant"),
        ({"REF_FRAME": "ICRF"}, "REF_FRAME is 'ICRF', which SGP4 cannot propagate: it needs TEME"),
        ({"MEAN_ELEMENT_THEORY": "DSST"}, "which SGP4 cannot propagate"),
        (
            {"EPHEMERIS_TYPE": 4},
            "record 7: is for SGP4-XP (ephemeris type 4), another theory than SGP4; fetch elements",
        ),
        (
            {"MEAN_ELEMENT_THEORY": "SGP4-XP", "BSTAR": None, "BTERM": 0.02, "EPHEMERIS_TYPE": 4},
            "record 7: MEAN_ELEMENT_THEORY is 'SGP4-XP', which SGP4 cannot propagate: it needs SGP4; fetch elements of SGP4",
        ),
        (
            {"BSTAR": None, "MEAN_MOTION": "x", "INCLINATION": "y"},
            "BSTAR is missing; MEAN_MOTION 'x' is not a number; INCLINATION 'y' is not a number; correct the record",
        ),
        (
            dict.fromkeys(("MEAN_MOTION", "ECCENTRICITY", "INCLINATION", "MEAN_ANOMALY", "BSTAR"), "x"),
            "MEAN_ANOMALY 'x' is not a number; BSTAR 'x' is not a number; correct the record",
        ),
    ],
)
def test_what_is_no_element_set_says_so(change, message):
    elements = element_set_from_omm({**VANGUARD, **change}, "file: record 7")
    assert elements.problem is not None
    assert elements.problem.startswith("file: record 7: ")
    assert message in elements.problem
    assert "\n" not in elements.problem


def test_fields_come_out_as_they_went_in():
    again = element_set_from_omm(element_set_from_omm(VANGUARD, "here").omm(), "here")
    assert again == element_set_from_omm(VANGUARD, "here")
    fine = {**VANGUARD, "EPOCH": "2020-10-13T04:52:48.472320789"}
    assert element_set_from_omm(element_set_from_omm(fine, "here").omm(), "here") == element_set_from_omm(fine, "here")
    assert element_set_from_omm({}, "here").epoch_utc == NO_EPOCH


def test_regimes_are_space_tracks():
    # www.space-track.org: LEO above 11.25 rev/day, MEO 600 to 800 min, GEO 0.99 to 1.01 rev/day, HEO e above 0.25
    for turns, e, regime in [
        (15.5, 0.001, "leo"),
        (11.2, 0.001, "other"),
        (2.0, 0.01, "meo"),
        (1.0027, 0.0003, "geo"),
        (1.0027, 0.05, "other"),
        (2.0, 0.7, "heo"),
    ]:
        assert element_set_from_omm({**VANGUARD, "MEAN_MOTION": turns, "ECCENTRICITY": e}, "here").regime == regime
