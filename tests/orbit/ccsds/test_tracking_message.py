"""Tracking data messages: the standard's examples, both notations, corrections, and what a wrong file is told."""

import datetime

import numpy as np
import pytest

from rso_lidar.errors import RecordingError, RsoLidarWarning, ScenarioError
from rso_lidar.orbit import Epochs, TrackingDataMessage, gcrs_from_axes, write_tdm

START = datetime.datetime(2026, 5, 1, 12, tzinfo=datetime.UTC)
# 503.0-B-2, figure E-17: a radar with a correction that is not applied, a cross-section stated twice, and the weather
RADAR = """CCSDS_TDM_VERS = 2.0
COMMENT Test file
CREATION_DATE = 2011-05-12T00:00:00.000
ORIGINATOR = ESA
META_START
COMMENT
TIME_SYSTEM = UTC
PARTICIPANT_1 = CAMRA
PARTICIPANT_2 = CRYOSAT
MODE = SEQUENTIAL
PATH = 1,2,1
RANGE_UNITS = km
ANGLE_TYPE = AZEL
CORRECTION_RANGE = -1.48
CORRECTIONS_APPLIED = NO
META_STOP
DATA_START
RANGE = 2011-05-11T10:26:33.2613 2808.2696
ANGLE_1 = 2011-05-11T10:26:33.2613 191.40208435
ANGLE_2 = 2011-05-11T10:26:33.2613 25.44166756
CARRIER_POWER = 2011-05-11T10:26:33.2613 -36.73723984
RCS = 2011-05-11T10:26:33.2613 2.984
RANGE = 2011-05-11T10:26:33.7008 2803.1731
RCS = 2011-05-11T10:26:33.7008 2.992
RCS = 2011-05-11T10:26:33.7008 2.986
DATA_STOP
META_START
TIME_SYSTEM = UTC
PARTICIPANT_1 = CAMRA
META_STOP
DATA_START
PRESSURE = 2011-05-11T10:26:33.2613 896.2
DATA_STOP
"""
# 503.0-B-2, figure E-16: two segments of a telescope, of one-way light
TELESCOPE = """CCSDS_TDM_VERS = 2.0
CREATION_DATE = 2012-10-30T20:00:00
ORIGINATOR = ESA
META_START
TIME_SYSTEM = UTC
PARTICIPANT_1 = TFRM
PARTICIPANT_2 = TRACK NUMBER 001
MODE = SEQUENTIAL
PATH = 2,1
ANGLE_TYPE = RADEC
REFERENCE_FRAME = EME2000
META_STOP
DATA_START
ANGLE_1 = 2012-10-29T17:46:39.02 332.2298750
ANGLE_2 = 2012-10-29T17:46:39.02 -16.3028389
MAG = 2012-10-29T17:46:39.02 12.1
DATA_STOP
META_START
TIME_SYSTEM = UTC
PARTICIPANT_1 = TFRM
PARTICIPANT_2 = TRACK NUMBER 003
MODE = SEQUENTIAL
PATH = 2,1
ANGLE_TYPE = RADEC
REFERENCE_FRAME = EME2000
META_STOP
DATA_START
ANGLE_1 = 2012-10-29T17:57:14.02 335.1698333
ANGLE_2 = 2012-10-29T17:57:14.02 -17.7212861
DATA_STOP
"""
META = {"TIME_SYSTEM": "UTC", "PARTICIPANT_1": "A", "PARTICIPANT_2": "B", "PATH": "1,2,1", "ANGLE_TYPE": "RADEC",
        "REFERENCE_FRAME": "ICRF"}  # fmt: skip
ROWS = (("RANGE", 2.0), ("ANGLE_1", 90.0), ("ANGLE_2", 30.0))


def message_text(rows=ROWS, notes="", **changed):
    """Return a message of one segment at one instant; None leaves a keyword out."""
    meta = {key: value for key, value in (META | changed).items() if value is not None}
    lines = [
        "CCSDS_TDM_VERS = 2.0", "CREATION_DATE = 2026-05-01T00:00:00", "ORIGINATOR = TEST", "META_START",
        *(f"{key} = {value}" for key, value in meta.items()), "META_STOP", "DATA_START", *notes.splitlines(),
        *(f"{key} = 2026-05-01T12:00:00.5 {value}" for key, value in rows), "DATA_STOP",
    ]  # fmt: skip
    return "\n".join(lines)


def to_xml(text):
    """Return the same message in XML, with a leaf of each row in an observation of its own."""
    out, inside = [], ""
    for line in text.splitlines()[1:]:
        key, _, value = line.partition(" = ")
        if line == "META_START":
            out.append("<segment><metadata>")
        elif line == "META_STOP":
            out.append("</metadata><data>")
            inside = "data"
        elif line == "DATA_STOP":
            out.append("</data></segment>")
        elif line.startswith("COMMENT "):
            out.append(f"<COMMENT>{line.removeprefix('COMMENT ')}</COMMENT>")
        elif value and inside == "data" and len(value.split()) == 2:
            epoch, number = value.split()
            out.append(f"<observation><EPOCH>{epoch}</EPOCH><{key}>{number}</{key}></observation>")
        elif value:
            out.append(f"<{key}>{value}</{key}>")
    return f'<tdm version="2.0"><body>{"".join(out)}</body></tdm>'


@pytest.mark.parametrize("write", [str, to_xml])
def test_the_standards_radar_is_read(write):
    message = TrackingDataMessage.from_text(write(RADAR))
    (segment,) = message.segments
    assert (segment.observer, segment.target, segment.is_two_way) == ("CAMRA", "CRYOSAT", True)
    assert message.start_utc == datetime.datetime(2011, 5, 11, 10, 26, 33, tzinfo=datetime.UTC)
    time_s, range_km = segment.records["RANGE"]
    assert time_s.tolist() == [0.2613, 0.7008] and range_km.tolist() == [2808.2696, 2803.1731]
    assert segment.records["RCS"][1].tolist() == [2.984, 2.992, 2.986]
    assert segment.correction_range_m == pytest.approx(-1480.0) and segment.correction_rad == (0.0, 0.0)
    with pytest.raises(ScenarioError, match="ANGLE_TYPE AZEL; only RADEC"):
        message.find_positions()


@pytest.mark.parametrize("write", [str, to_xml])
def test_the_standards_telescope_is_read(write):
    message = TrackingDataMessage.from_text(write(TELESCOPE))
    assert message.targets == ["TRACK NUMBER 001", "TRACK NUMBER 003"]
    assert message.segments[0].observer == "TFRM" and not message.segments[0].is_two_way
    with pytest.raises(ScenarioError, match="has several targets"):
        message.select_target()
    with pytest.raises(ScenarioError, match="no target 'TRACK NUMBER 002'; did you mean 'TRACK NUMBER 003'"):
        message.select_target("TRACK NUMBER 002")
    with pytest.raises(ScenarioError, match="no instant has RANGE, ANGLE_1 and ANGLE_2"):
        message.find_positions("track number 003")


def test_what_is_written_is_read_again(tmp_path):
    rng = np.random.default_rng(7)
    line_m = rng.normal(size=(20, 3)) * 1e3
    line_m[0], line_m[1] = (0.0, 0.0, 55.0), (-70.0, -1e-9, 0.0)  # at the pole, and at 360 degrees
    epochs = Epochs(START, np.arange(20) / 3.0)
    path = write_tdm(
        tmp_path / "a.tdm", "eye", "it", epochs, line_m, sigma_range_m=0.05, sigma_angle_rad=1e-4, sigma_offset_m=(0.5, 0.0),
        correction_range_m=1.25, comments=["of a test"], created_utc=START,
    )  # fmt: skip
    message = TrackingDataMessage.from_file(path)
    (segment,) = message.segments
    assert (segment.observer, segment.target, message.originator) == ("eye", "it", "RSO_LIDAR")
    assert (segment.sigma_range_m, segment.sigma_offset_m) == (0.05, (0.5, 0.0))
    assert segment.sigma_angle_rad == pytest.approx(1e-4, rel=1e-6)
    time_s, found_m = message.find_positions("IT")
    np.testing.assert_allclose(time_s, epochs.time_s, atol=1e-12)
    range_m = np.linalg.norm(line_m, axis=1)
    np.testing.assert_allclose(np.linalg.norm(found_m, axis=1), range_m + 1.25, atol=1e-6)  # 1e-6 m in the file
    turned_rad = np.linalg.norm(found_m / (range_m + 1.25)[:, None] - line_m / range_m[:, None], axis=1)
    assert turned_rad.max() < 1e-8  # the range of 1e-6 m, of 55 m
    write_tdm(path, "eye", "it", epochs, line_m, correction_range_m=1.25, corrections_applied=True, overwrite=True)
    applied = TrackingDataMessage.from_file(path)
    assert applied.segments[0].sigma_range_m is None
    np.testing.assert_allclose(np.linalg.norm(applied.find_positions()[1], axis=1), range_m, atol=1e-6)


def test_units_corrections_and_frames_of_others(tmp_path):
    """Each case is one measurement at 2 km, right ascension 90 and declination 30 degrees, stated in another way."""
    wanted_m = 2000.0 * np.array([0.0, np.cos(np.pi / 6.0), 0.5])
    angles = ROWS[1:]
    for options, reader in (
        ({}, {}),
        ({"rows": (("RANGE", 4.0), *angles)}, {"round_trip": True}),
        ({"rows": (("RANGE", 2e3 / 299_792_458.0), *angles), "RANGE_UNITS": "s"}, {}),
        ({"rows": (("RANGE", 4e3 / 299_792_458.0), *angles), "RANGE_UNITS": "s"}, {"round_trip": True}),
        ({"PATH": "2,1"}, {"round_trip": True}),  # of one way there is no half
        ({"CORRECTION_RANGE": 9.0, "CORRECTION_ANGLE_1": 9.0, "CORRECTIONS_APPLIED": "YES"}, {}),
        (
            {
                "rows": (("RANGE", 1.5), ("ANGLE_1", -275.0), ("ANGLE_2", 28.0)),
                "CORRECTION_RANGE": 0.5, "CORRECTION_ANGLE_1": 5.0, "CORRECTION_ANGLE_2": 2.0,
                "CORRECTIONS_APPLIED": "NO",
            },
            {},
        ),
        (  # a correction is that of the range as the message states it
            {"rows": (("RANGE", 3.0), *angles), "CORRECTION_RANGE": 1.0, "CORRECTIONS_APPLIED": "NO"},
            {"round_trip": True},
        ),
    ):  # fmt: skip
        time_s, line_m = TrackingDataMessage.from_text(message_text(**options)).find_positions(**reader)
        assert time_s.tolist() == [0.5]
        np.testing.assert_allclose(line_m[0], wanted_m, atol=1e-9)
    for name, axes in (("EME2000", "eme2000"), ("TOD_EARTH", "tod")):
        line_m = TrackingDataMessage.from_text(message_text(REFERENCE_FRAME=name)).find_positions()[1][0]
        turned = gcrs_from_axes(axes, Epochs(START, np.array([0.5])))[0] @ wanted_m
        np.testing.assert_allclose(line_m, turned, atol=1e-9)


def test_ranges_and_angles_of_two_segments_are_joined():
    first, second = message_text(ROWS[:1]), message_text((*ROWS[1:], ("MAG", 3.0)))
    text = first + "\n" + second[second.index("META_START") :]
    assert TrackingDataMessage.from_text(text).find_positions()[1] == pytest.approx(
        np.array([[0.0, 2e3 * np.cos(np.pi / 6.0), 1e3]]), abs=1e-9
    )
    other = second.replace("PARTICIPANT_1 = A", "PARTICIPANT_1 = C")
    with pytest.raises(ScenarioError, match="A, C measure the target; give the segments of one"):
        TrackingDataMessage.from_text(first + "\n" + other[other.index("META_START") :]).find_positions()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"MODE": "SINGLE_DIFF"}, "line 11: MODE SINGLE_DIFF; only SEQUENTIAL"),
        ({"PATH": "1,2,3,1"}, "line 8: PATH 1,2,3,1; only a,b and a,b,a"),
        ({"PATH": "1,3,1"}, "line 4: the metadata lack PARTICIPANT_3"),
        ({"PATH": None}, "line 4: the metadata lack PATH"),
        ({"TIME_SYSTEM": "SCLK"}, "line 5: TIME_SYSTEM SCLK is not supported"),
        ({"RANGE_UNITS": "RU"}, "line 11: RANGE_UNITS RU; write ranges in km or s"),
        ({"RANGE_MODULUS": "32768.0"}, "line 11: ambiguous ranges are not supported; resolve them"),
        ({"CORRECTION_RANGE": "1.0"}, "line 11: a segment with corrections states CORRECTIONS_APPLIED = YES or NO"),
        ({"CORRECTION_RANGE": "x", "CORRECTIONS_APPLIED": "NO"}, "line 11: CORRECTION_RANGE 'x' is not a number"),
        ({"REFERENCE_FRAME": "MARS"}, "line 10: reference frame MARS is not supported"),
        ({"rows": ()}, "has no range and no angle; give lines such as RANGE = epoch"),
        ({"rows": (("RANGE", ""),)}, "line 13: a measurement is KEYWORD = epoch value"),
        ({"rows": (("RANGE", "far"),)}, "line 13: RANGE 'far' is not a number"),
        ({"rows": (("ANGLE_1", 9999.0),)}, "line 13: ANGLE_1 is 9999 deg, more than a turn; correct it, or leave"),
        ({"START_TIME": "soon"}, "line 11: epoch 'soon'"),
        ({"rows": (("RANGE", 1.0), ("RANGE", 2.0))}, "line 14: its epoch occurs twice"),
        ({"notes": "COMMENT SIGMA_RANGE = -1 [m]"}, "line 13: SIGMA_RANGE is -1; give a number above 0"),
    ],
)
def test_a_wrong_line_is_named(options, says):
    with pytest.raises(ScenarioError, match=says) as error:
        TrackingDataMessage.from_text(message_text(**options), "a.tdm")
    assert str(error.value).startswith("a.tdm: ") and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"REFERENCE_FRAME": None}, "RADEC needs an inertial REFERENCE_FRAME"),
        ({"REFERENCE_FRAME": "ITRF"}, "RADEC needs an inertial REFERENCE_FRAME"),
        ({"ANGLE_TYPE": None}, "ANGLE_TYPE is missing; only RADEC"),
        ({"rows": (("RANGE", -1.0), *ROWS[1:])}, "a range is not above 0; correct it"),
    ],
)
def test_what_is_no_position_is_said(options, says):
    with pytest.raises(ScenarioError, match=says):
        TrackingDataMessage.from_text(message_text(**options)).find_positions()


@pytest.mark.parametrize(
    ("place", "old", "new", "says"),
    [
        ("a", "CCSDS_TDM_VERS", "CCSDS_OEM_VERS", "begins with 'CCSDS_OEM_VERS = 2.0'; a TDM begins with"),
        ("a", "DATA_START\n", "", "keyword RANGE among the rows; put it between .* or measurements after DATA_START"),
        ("a", "DATA_STOP", "", "DATA_START is never closed; add DATA_STOP"),
        ("a", "META_START\n", "", "META_STOP while no block is open"),
    ],
)
def test_blocks_that_do_not_pair_are_named(place, old, new, says):
    with pytest.raises(ScenarioError, match=says):
        TrackingDataMessage.from_text(message_text().replace(old, new, 1))


def test_rows_outside_the_stated_span_are_warned_of():
    with pytest.warns(RsoLidarWarning, match="line 11: 3 of 3 rows are before START_TIME .*; correct one of them"):
        TrackingDataMessage.from_text(message_text(START_TIME="2036-01-01T00:00:00"), "a.tdm")


def test_a_comment_in_another_unit_states_no_noise():
    notes = "COMMENT SIGMA_RANGE = 3 [km]\nCOMMENT SIGMA_ANGLE = 3 [m]\nCOMMENT SIGMA_OFFSET_ALONG = 0.5 [m]"
    for write in (str, to_xml):
        (segment,) = TrackingDataMessage.from_text(write(message_text(notes=notes))).segments
        assert (segment.sigma_range_m, segment.sigma_angle_rad, segment.sigma_offset_m) == (None, None, (0.5, 0.0))


@pytest.mark.parametrize(
    ("time_s", "line_m", "options", "says"),
    [
        ([], np.zeros((0, 3)), {}, "needs finite positions"),
        ([0.0], [[1.0, 2.0, np.nan]], {}, "needs finite positions"),
        ([0.0], [[0.0, 0.0, 0.0]], {}, "needs finite positions"),
        ([1.0, 0.0], np.ones((2, 3)), {}, "epochs grow by 1 ns or more; sort them"),
        ([0.0], np.ones((1, 3)), {"comments": ["é"]}, "the format allows up to 200 printable ASCII"),
        ([0.0], np.ones((1, 3)), {"originator": " "}, "ORIGINATOR"),
    ],
)
def test_what_cannot_be_written_is_refused(tmp_path, time_s, line_m, options, says):
    with pytest.raises(RecordingError, match=says):
        write_tdm(tmp_path / "a.tdm", "A", "B", Epochs(START, np.array(time_s)), np.array(line_m), **options)
    assert not list(tmp_path.iterdir())
