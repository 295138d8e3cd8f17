"""Messages as text that was written badly, or with ill will: a record is spoilt alone, and a name stays one line."""

import json

import pytest

from rso_lidar.orbit import Catalog
from rso_lidar.orbit.sets.omm_text import read_xml
from tests.limits import growth

RECORD = {
    "OBJECT_NAME": "ONE",
    "OBJECT_ID": "2024-002B",
    "EPOCH": "2024-09-17T12:00:00.000000",
    "MEAN_MOTION": 15.06,
    "ECCENTRICITY": 0.001,
    "INCLINATION": 97.6,
    "RA_OF_ASC_NODE": 35.0,
    "ARG_OF_PERICENTER": 90.0,
    "MEAN_ANOMALY": 270.0,
    "NORAD_CAT_ID": 99002,
    "BSTAR": 1e-4,
    "MEAN_MOTION_DOT": 1e-6,
}
OTHER = RECORD | {"OBJECT_NAME": "TWO", "NORAD_CAT_ID": 99003}


def kvn(*records):
    lines = (["CCSDS_OMM_VERS = 2.0", *(f"{key} = {value}" for key, value in record.items())] for record in records)
    return "\n".join(line for record in lines for line in record) + "\n"


def xml(record, units="", inner=""):
    leaves = "".join(f"<{key}{units if key == 'INCLINATION' else ''}>{value}</{key}>" for key, value in record.items())
    return f"<omm>{leaves}{inner}</omm>"


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("A\nB\x1b[31m\x07", "A B [31m"),
        ("A\r\nseed = 77\n#", "A seed = 77 #"),
        ("x\ud800y", "x?y"),
        ("x\x85\u2028\u202ey\x00", "x y"),
        ('#1, "quoted"', '#1, "quoted"'),
        ("\u536b\u661f", "\u536b\u661f"),
    ],
)
@pytest.mark.parametrize("suffix", [".json", ".csv", ".tle"])
def test_a_name_is_one_line_in_every_file(name, shown, suffix, tmp_path):
    catalog = Catalog.from_text(json.dumps([RECORD | {"OBJECT_NAME": name, "CLASSIFICATION_TYPE": "U\n"}, OTHER]))
    assert [entry.name for entry in catalog] == [shown, "TWO"]
    catalog.write(tmp_path / f"a{suffix}")
    again = Catalog.from_file(tmp_path / f"a{suffix}")
    assert again.problems == ()
    assert [(entry.name, entry.norad_id) for entry in again] == [(shown, 99002), ("TWO", 99003)]


def test_what_is_told_of_a_bad_record_is_one_printable_line():
    bad = RECORD | {"OBJECT_NAME": "A\x1b[2J", "EPOCH": "x\x1b[2J\ud800\n"}
    for text in (json.dumps([bad, OTHER]), json.dumps(OTHER) + "\x1b[2J!" + json.dumps(OTHER | {"NORAD_CAT_ID": 5})):
        catalog = Catalog.from_text(text)
        assert catalog.sets
        assert catalog.problems
        assert all(problem.isprintable() for problem in catalog.problems)


@pytest.mark.parametrize(
    ("key", "value", "problem"),
    [
        ("INCLINATION", "1.7 [rad]", "INCLINATION is in [rad], which must be [deg]"),
        ("MEAN_MOTION", "0.0657 [rad/min]", "MEAN_MOTION is in [rad/min], which must be [rev/day]"),
        ("ECCENTRICITY", "0.001 [deg]", "ECCENTRICITY is in [deg], which must be without a unit"),
        ("MEAN_MOTION_DOT", "0 [rev/day]", "which must be [rev/day**2]"),
        ("INCLINATION", "97.6[DEG]", None),
        ("BSTAR", "0.0001 [1/ER]", None),  # as the examples of CCSDS 502.0-B-3 write it, and as its tables do
        ("BSTAR", "0.0001 [1/[Earth radii]]", None),
        ("MEAN_MOTION_DOT", "0.000001 [rev/day**2]", None),
        ("GM", "398600.8 [km**3/s**2]", None),
        ("OBJECT_NAME", "ONE [rad]", None),
    ],
)
def test_a_unit_that_is_not_the_standards_is_a_bad_record(key, value, problem):
    catalog = Catalog.from_text(kvn(RECORD | {key: value}, OTHER))
    assert [entry.norad_id for entry in catalog] == ([99003] if problem else [99002, 99003])
    assert len(catalog.problems) == bool(problem)
    assert problem is None or problem in catalog.problems[0]


def test_units_of_xml():
    both = xml(RECORD, ' units="rad"') + xml(OTHER, ' units="deg"')
    catalog = Catalog.from_text(f"<ndm>{both}</ndm>")
    assert [entry.norad_id for entry in catalog] == [99003]
    assert "INCLINATION is in [rad]" in catalog.problems[0]


def test_a_message_within_another_is_one_of_its_own():
    sets, junk = read_xml(xml(RECORD, inner=xml(OTHER)), "file")
    assert [(entry.norad_id, entry.problem) for entry in sets] == [(99002, None), (99003, None)]
    assert junk == []


@pytest.mark.parametrize("end", ["", "</omm>"])
def test_messages_that_never_end_take_no_more_than_their_number(end):
    def read(number):
        sets, _ = read_xml("<omm>" * number + end * number, "file")
        assert len(sets) == number
        assert all(entry.problem for entry in sets)

    assert growth(read, 2000, 16_000) < 24.0  # 8 where each is looked at once, 64 where the way to each is walked again
