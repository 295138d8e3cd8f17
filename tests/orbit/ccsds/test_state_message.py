"""Orbit parameter messages: the state of both notations, frames, and what a wrong file is told."""

import datetime

import numpy as np
import pytest

from rso_lidar.errors import RsoLidarWarning, ScenarioError
from rso_lidar.orbit import Epochs, gcrs_from_axes, read_opm

# 502.0-B-3, figure G-1, with the centre and frame of an orbit about the Earth
HEAD = """CCSDS_OPM_VERS = 3.0
CREATION_DATE = 2022-11-06T09:23:57
ORIGINATOR = JAXA
COMMENT GEOCENTRIC, CARTESIAN, EARTH FIXED
OBJECT_NAME = OSPREY 5
OBJECT_ID = 2022-999A
CENTER_NAME = EARTH
REF_FRAME = GCRF
TIME_SYSTEM = UTC
"""
STATE = """EPOCH = 2022-12-18T14:28:15.1172
X = 6503.514000
Y = 1239.647000 [km]
Z = -717.490000
X_DOT = -0.873160 [km/s]
Y_DOT = 8.740420
Z_DOT = -4.191076
"""
REST = """MASS = NaN [kg]
SOLAR_RAD_AREA = many
COV_REF_FRAME = NOWHERE
CX_X = 1e99
"""
START = datetime.datetime(2022, 12, 18, 14, 28, 15, 117_200, tzinfo=datetime.UTC)


def saved(tmp_path, text):
    path = tmp_path / "craft.opm"
    path.write_text(text)
    return path


def to_xml(text):
    leaves = [line.partition("[")[0].split(" = ") for line in text.splitlines() if not line.startswith("COMMENT")]
    body = "".join(f"<{key.strip()}>{value.strip()}</{key.strip()}>" for key, value in leaves[1:])
    return f"<ndm xmlns:n='urn:x'><oem version='2.0'><X>1</X></oem><n:opm version='3.0'>{body}</n:opm></ndm>"


@pytest.mark.parametrize("write", [str, to_xml])
def test_the_state_of_the_standards_example_is_read(tmp_path, write):
    motion = read_opm(saved(tmp_path, write(HEAD + STATE + REST)))
    assert motion.epoch_utc == START
    assert motion.position_m == (6_503_514.0, 1_239_647.0, -717_490.0)
    assert motion.velocity_m_s == pytest.approx((-873.16, 8740.42, -4191.076), rel=1e-15)
    flown = motion.states(Epochs(START, np.array([0.0, 1.0])))
    assert flown.position_m[0] == pytest.approx(motion.position_m, rel=1e-15)
    speed_m_s = np.linalg.norm(motion.velocity_m_s)
    assert np.linalg.norm(flown.position_m[1] - flown.position_m[0]) == pytest.approx(speed_m_s, rel=1e-3)


def test_digits_below_a_microsecond_move_the_state_along_its_velocity(tmp_path):
    motion = read_opm(saved(tmp_path, HEAD + STATE.replace("15.1172", "15.1172009")))
    assert motion.epoch_utc == START
    moved_m = np.array([6_503_514.0, 1_239_647.0, -717_490.0]) - motion.position_m
    np.testing.assert_allclose(moved_m, 0.9e-6 * np.array(motion.velocity_m_s), rtol=1e-6)


def test_frames_are_turned_to_gcrs(tmp_path):
    raw_m = np.array([6_503_514.0, 1_239_647.0, -717_490.0])
    then = Epochs(datetime.datetime(2000, 1, 1, 12, tzinfo=datetime.UTC), np.zeros(1))
    for lines, epochs in (("TOD", Epochs(START, np.zeros(1))), ("TOD\nREF_FRAME_EPOCH = 2000-01-01T12:00:00", then)):
        motion = read_opm(saved(tmp_path, HEAD.replace("GCRF", lines) + STATE))
        np.testing.assert_allclose(motion.position_m, gcrs_from_axes("tod", epochs)[0] @ raw_m, atol=1e-6)
    with pytest.warns(
        RsoLidarWarning, match="craft.opm: is in ITRF, and without polar motion and UT1 it is off by up to 29 m"
    ):
        fixed = read_opm(saved(tmp_path, HEAD.replace("GCRF", "ITRF-97") + STATE))
    assert np.linalg.norm(fixed.position_m) == pytest.approx(np.linalg.norm(raw_m), rel=1e-14)


def test_maneuvers_are_named_as_not_flown(tmp_path):
    burn = "MAN_EPOCH_IGNITION = 2022-12-19T00:00:00\nMAN_DURATION = 132.6\n"
    with pytest.warns(RsoLidarWarning, match="has maneuvers from 2022-12-19T00:00:00 on, which are not flown"):
        motion = read_opm(saved(tmp_path, HEAD + STATE + burn + burn))
    assert motion.epoch_utc == START


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("CCSDS_OPM_VERS = 3.0", "CCSDS_OEM_VERS = 2.0", "line 1: begins with 'CCSDS_OEM_VERS = 2.0'; an OPM begins"),
        (
            "CCSDS_OPM_VERS = 3.0",
            "CCSDS_OPM_VERS = 9.0",
            "CCSDS_OPM_VERS 9.0 is not supported; write 1.0 or 2.0 or 3.0",
        ),
        ("CENTER_NAME = EARTH", "CENTER_NAME = MOON", "line 7: CENTER_NAME MOON; only EARTH"),
        ("REF_FRAME = GCRF", "REF_FRAME = MOON_ME", "line 8: reference frame MOON_ME is not supported"),
        ("TIME_SYSTEM = UTC", "TIME_SYSTEM = TDB", "line 9: TIME_SYSTEM TDB is not supported"),
        ("EPOCH = 2022-12-18", "EPOCH = 2022-13-18", "line 10: epoch '2022-13-18"),
        ("X = 6503.514000", "X = 6503514 [m]", "line 11: X in m; write it in km"),
        ("X = 6503.514000", "X = NaN", "line 11: X is NaN; give a finite number"),
        ("X = 6503.514000", "X = 6503\nX = 6504", "line 12: X is given twice; remove one"),
        ("X = 6503.514000", "X = 1.0", "its state is no orbit: .*inside"),
        ("Z_DOT = -4.191076", "", "the message lacks Z_DOT, which the standard requires; add it"),
        ("ORIGINATOR = JAXA", "from JAXA", "line 3: 'from JAXA' is not KEYWORD = value"),
    ],
)
def test_a_wrong_line_is_named(tmp_path, old, new, says):
    text = HEAD + STATE
    assert old in text
    path = saved(tmp_path, text.replace(old, new, 1))
    with pytest.raises(ScenarioError, match=says) as error:
        read_opm(path)
    assert str(error.value).startswith(str(path)) and "\n" not in str(error.value)
