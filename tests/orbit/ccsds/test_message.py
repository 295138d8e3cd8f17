"""The text of CCSDS messages: epochs, blocks, XML, and what is refused."""

import datetime

import numpy as np
import pytest

from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.orbit import Epochs
from rso_lidar.orbit.ccsds.kvn import format_kvn
from rso_lidar.orbit.ccsds.reader import read_message
from rso_lidar.orbit.epochs import PS_PER_S, format_epoch_ps, format_epochs, parse_epoch_ps

HEAD = "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2024-01-01T00:00:00\nORIGINATOR = TEST\n"
META = "META_START\nOBJECT_NAME = A\nOBJECT_ID = 2024-001A\nMETA_STOP\n"


def test_time_systems_differ_as_the_standards_say():
    # TAI - UTC = 37 s since 2017 (IERS Bulletin C 52); TT = TAI + 32.184 s; GPS = TAI - 19 s (IS-GPS-200)
    utc = parse_epoch_ps("2024-09-17T12:00:00", "UTC", "-")
    assert parse_epoch_ps("2024-09-17T12:00:37", "TAI", "-") == utc
    assert parse_epoch_ps("2024-09-17T12:01:09.184", "TT", "-") == utc
    assert parse_epoch_ps("2024-09-17T12:00:18", "GPS", "-") == utc


def test_day_of_year_and_calendar_are_the_same_instant():
    assert parse_epoch_ps("2024-261T12:00:00.25Z", "UTC", "-") == parse_epoch_ps("2024-09-17T12:00:00.250", "UTC", "-")
    assert parse_epoch_ps("2024-366T00:00:00", "UTC", "-") == parse_epoch_ps("2024-12-31T00:00:00", "UTC", "-")


def test_a_leap_second_is_a_second_of_its_own():
    before, leap, after = (
        parse_epoch_ps(text, "UTC", "-")
        for text in ("2016-12-31T23:59:59", "2016-12-31T23:59:60", "2017-01-01T00:00:00")
    )
    assert leap - before == after - leap == PS_PER_S
    epochs = Epochs(datetime.datetime(2016, 12, 31, 23, 59, 59, tzinfo=datetime.UTC), np.array([0.0, 1.5, 2.0]))
    assert format_epochs(epochs) == ["2016-12-31T23:59:59.000", "2016-12-31T23:59:60.500", "2017-01-01T00:00:00.000"]


def test_every_digit_of_an_epoch_survives():
    for text in ("2026-03-01T00:00:00.000000000001", "1999-12-31T23:59:59.999999999999", "2150-06-30T06:07:08.123"):
        assert format_epoch_ps(parse_epoch_ps(text, "UTC", "-")) == text


@pytest.mark.parametrize(
    ("text", "system", "says"),
    [
        ("2024-02-30T00:00:00", "UTC", "day does not exist"),
        ("2023-366T00:00:00", "UTC", "day does not exist"),
        ("2024-000T00:00:00", "UTC", "day does not exist"),
        ("2024-01-01T24:00:00", "UTC", "time of day does not exist"),
        ("2024-01-01T23:59:60", "UTC", "time of day does not exist"),  # no leap second that day
        ("2016-12-31T23:59:60", "TAI", "time of day does not exist"),  # TAI has none
        ("1066-10-14T09:00:00", "UTC", "year"),
        ("17 Sep 2024", "UTC", "write 2024-09-17"),
        ("2024-09-17T12:00", "UTC", "write 2024-09-17"),
    ],
)
def test_bad_epochs_are_refused(text, system, says):
    with pytest.raises(ScenarioError, match=says) as error:
        parse_epoch_ps(text, system, "file: line 7")
    assert str(error.value).startswith("file: line 7: epoch") and "\n" not in str(error.value)


def test_a_keyword_without_a_value_is_not_given():
    text = HEAD + META.replace("META_STOP", "USEABLE_START_TIME =\nINTERPOLATION_DEGREE = \nMETA_STOP")
    assert (
        read_message(text, "OEM", "f").segments[0].meta.keys()
        == read_message(HEAD + META, "OEM", "f").segments[0].meta.keys()
    )


def test_blocks_comments_and_covariance():
    text = (
        HEAD
        + "COMMENT x = y\n\n"
        + META
        + "COMMENT rows\n2024-001T00:00:00 1 2\nCOVARIANCE_START\nEPOCH = 2024-001T00:00:00\n1 2 3\nCOVARIANCE_STOP\n"
        + "2024-001T00:01:00 3 4\n"
        + META
    )
    message = read_message(text, "OEM", "f")
    assert [len(segment.rows) for segment in message.segments] == [2, 0]
    assert message.segments[0].rows[1] == (16, ["2024-001T00:01:00", "3", "4"])
    assert message.header["ORIGINATOR"].value == "TEST" and message.segments[0].meta["OBJECT_ID"].line == 8


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("CREATION_DATE = 2024-01-01\n", "line 1: .*begins with CCSDS_OEM_VERS"),
        ("CCSDS_AEM_VERS = 1.0\n", "line 1: .*begins with CCSDS_OEM_VERS"),
        ("CCSDS_OEM_VERS = seven\n" + META, "VERS seven"),
        (HEAD, "no segment"),
        (HEAD + "META_START\nOBJECT_NAME = A\n", "line 4: META_START is never closed"),
        (HEAD + "META_START\nMETA_START\n", "line 5: META_START while META_START of line 4"),
        (HEAD + "META_STOP\n", "line 4: META_STOP while no block"),
        (HEAD + "COVARIANCE_START\n", "line 4: COVARIANCE_START before any META_START"),
        (HEAD + "META_START\nOBJECT_NAME = A\nOBJECT_NAME = B\nMETA_STOP\n", "line 6: OBJECT_NAME is given twice"),
        (HEAD + "META_START\nwhat is this\nMETA_STOP\n", "line 5: 'what is this'"),
        (HEAD + META + "REF_FRAME = GCRF\n", "line 8: keyword REF_FRAME among the rows"),
        ("<oem version='2.0'><body></oem>", "line 1: is not well-formed XML"),
        ("<oem version='2.0'><body><stateVector><X>1</X></stateVector></body></oem>", "has no segment"),
        ("<aem version='2.0'></aem>", "does not contain <oem>"),
        (
            "<!DOCTYPE html><html><p>403 Forbidden</html>",
            r"is a web page \(HTML\) and no OEM; fetch the file again",
        ),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><oem version='2.0'/>", "DOCTYPE"),
        (
            "<oem version='2.0'><body><segment><data><stateVector><X units='m'>1</X></stateVector></data>"
            "</segment></body></oem>",
            "X in m; write km",
        ),
    ],
)
def test_broken_messages_are_refused_with_their_line(text, says):
    with pytest.raises(ScenarioError, match=says) as error:
        read_message(text, "OEM", "some.oem")
    assert str(error.value).startswith("some.oem: ") and "\n" not in str(error.value)


def test_text_that_would_break_the_format_is_refused():
    for name in ("A\nMETA_STOP", "Ünit", " "):
        with pytest.raises(RecordingError, match="OBJECT_NAME"):
            format_kvn("OEM", "2.0", {}, [({"OBJECT_NAME": name}, [])])


def write_rows(kind, rows, meta=""):
    return (
        f"<{kind} version='2.0'><header><CREATION_DATE>2026-05-01</CREATION_DATE></header><body><segment>"
        f"<metadata><OBJECT_NAME>A</OBJECT_NAME>{meta}</metadata><data>{rows}</data></segment></body></{kind}>"
    )


STATE = "<stateVector><EPOCH>2026-05-01</EPOCH>" + "".join(
    f"<{name}>{k}</{name}>" for k, name in enumerate(("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT"))
)


def test_xml_is_read_by_local_names_within_its_own_message():
    plain = write_rows("oem", f"{STATE}</stateVector>")
    other = write_rows("opm", f"{STATE}</stateVector>", "<OBJECT_NAME>B</OBJECT_NAME>")
    prefixed = plain.replace("<oem", "<ndm:oem xmlns:ndm='urn:ccsds'").replace("</oem", "</ndm:oem")
    for text in (plain, f"<ndm>{other}{plain}{other}</ndm>", prefixed, f"<ndm>{other}{prefixed}</ndm>"):
        message = read_message(text, "OEM", "a.xml")
        (segment,) = message.segments
        assert segment.rows == [(1, ["2026-05-01", "0", "1", "2", "3", "4", "5"])]
        assert {key: entry.value for key, entry in segment.meta.items()} == {"OBJECT_NAME": "A"}
    with pytest.raises(ScenarioError, match=r"a.xml: holds several <oem>; split it"):
        read_message(f"<ndm>{plain}{prefixed}</ndm>", "OEM", "a.xml")


def test_elements_of_a_row_that_are_not_read_may_have_any_unit_and_value():
    turn = "".join(f"<{name}>0.5</{name}>" for name in ("Q1", "Q2", "Q3", "QC"))
    rates = "".join(f"<{name} units='1/s'>often</{name}>" for name in ("Q1_DOT", "Q2_DOT", "Q3_DOT", "QC_DOT"))
    row = (
        "<attitudeState><quaternionDerivative><EPOCH>2026-05-01</EPOCH>"
        f"<quaternion>{turn}</quaternion><quaternionDot>{rates}</quaternionDot></quaternionDerivative></attitudeState>"
    )
    message = read_message(write_rows("aem", row), "AEM", "a.xml")
    assert message.segments[0].rows == [(1, ["2026-05-01", "0.5", "0.5", "0.5", "0.5"])]
    push = "<X_DDOT units='m/s**2'>NaN</X_DDOT></stateVector>"
    assert len(read_message(write_rows("oem", STATE + push), "OEM", "a.xml").segments[0].rows[0][1]) == 7
    with pytest.raises(ScenarioError, match=r"a.xml: line 1: Q1 in deg; leave the unit out"):
        read_message(write_rows("aem", row.replace("<Q1>", "<Q1 units='deg'>")), "AEM", "a.xml")
