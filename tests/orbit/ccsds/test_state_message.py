"""Orbit parameter messages: states, covariances and maneuvers of both notations, read and written, and wrong files."""

import datetime
from contextlib import nullcontext

import numpy as np
import pytest

from rso_lidar.errors import RecordingError, RsoLidarWarning, ScenarioError
from rso_lidar.orbit import (
    Epochs,
    OrbitParameterMessage,
    State,
    StatedManeuver,
    convert_states,
    gcrs_from_axes,
    read_opm,
    write_opm,
)
from rso_lidar.records import BodyState

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


# 502.0-B-3, figure G-3: the covariance of the standard's example, as its frame ITRF1997 states it
LOWER = """3.331349476038534e-04
4.618927349220216e-04 6.782421679971363e-04
-3.070007847730449e-04 -4.221234189514228e-04 3.231931992380369e-04
-3.349365033922630e-07 -4.686084221046758e-07 2.484949578400095e-07 4.296022805587290e-10
-2.211832501084875e-07 -2.864186892102733e-07 1.798098699846038e-07 2.608899201686016e-10 1.767514756338532e-10
-3.041346050686871e-07 -4.989496988610662e-07 3.540310904497689e-07 1.869263192954590e-10 1.008862586240695e-10 6.22e-10
"""
AXES = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
ROWS = [line.split() for line in LOWER.splitlines()]
COVARIANCE = "".join(f"C{AXES[k]}_{AXES[j]} = {cell}\n" for k, cells in enumerate(ROWS) for j, cell in enumerate(cells))
# 502.0-B-3, figure G-2: a burn in EME2000 and an impulse in RTN
MANEUVERS = """MASS = 1913.000 [kg]
DRAG_AREA = 10.000 [m**2]
DRAG_COEFF = 2.300
MAN_EPOCH_IGNITION = 2022-12-19T09:00:34.1
MAN_DURATION = 132.60 [s]
MAN_DELTA_MASS = -18.418 [kg]
MAN_REF_FRAME = EME2000
MAN_DV_1 = -0.02325700 [km/s]
MAN_DV_2 = 0.01683160 [km/s]
MAN_DV_3 = -0.00893444 [km/s]
MAN_EPOCH_IGNITION = 2022-12-20T18:59:21.0
MAN_DURATION = 0.00 [s]
MAN_REF_FRAME = TNW
MAN_DV_1 = 0.00101500 [km/s]
MAN_DV_2 = -0.00187300 [km/s]
MAN_DV_3 = 0.00300000 [km/s]
"""


def stated_matrix():
    """Return the matrix of the standard's example in m and m/s."""
    matrix = np.zeros((6, 6))
    for k, cells in enumerate(ROWS):
        matrix[k, : k + 1] = matrix[: k + 1, k] = [1e6 * float(cell) for cell in cells]
    return matrix


@pytest.mark.parametrize("write", [str, to_xml])
def test_covariance_and_spacecraft_are_read(tmp_path, write):
    message = OrbitParameterMessage.from_file(saved(tmp_path, write(HEAD + STATE + "MASS = 3000 [kg]\n" + COVARIANCE)))
    assert (message.object_name, message.object_id, message.originator) == ("OSPREY 5", "2022-999A", "JAXA")
    assert (message.mass_kg, message.drag_area_m2, message.covariance_frame) == (3000.0, None, "GCRF")
    np.testing.assert_allclose(message.covariance, stated_matrix(), rtol=1e-12)
    assert OrbitParameterMessage.from_text(HEAD + STATE).covariance_rtn is None


def test_a_covariance_is_turned_as_the_spread_of_states_is(tmp_path):
    """States drawn in the frame of the message, and each converted, have the covariance that is read."""
    root = np.diag([20.0, 30.0, 10.0, 0.02, 0.01, 0.03]) @ (np.eye(6) + 0.3 * np.tri(6, k=-1))
    given = root @ root.T
    lines = "".join(f"C{AXES[k]}_{AXES[j]} = {given[k, j] / 1e6:.17e}\n" for k in range(6) for j in range(k + 1))
    at = Epochs(START, np.zeros(13))
    middle = np.array([6503514.0, 1239647.0, -717490.0, -873.160, 8740.420, -4191.076])
    points = middle + np.sqrt(6.0) * np.concatenate([np.zeros((1, 6)), root.T, -root.T])  # sigma points
    for name, axes in (("ITRF", "itrs"), ("TOD", "tod")):
        with pytest.warns(RsoLidarWarning) if axes == "itrs" else nullcontext():
            message = OrbitParameterMessage.from_text(HEAD.replace("GCRF", name) + STATE + lines)
        there = convert_states(BodyState(points[:, :3], points[:, 3:]), at, from_axes=axes)
        rows = np.concatenate([there.position_m, there.velocity_m_s], axis=1)[1:]
        off = rows - rows.mean(axis=0)
        # states are rounded to 1 nm and 1e-12 m/s beside standard deviations of 20 m and 0.02 m/s
        np.testing.assert_allclose(message.covariance, off.T @ off / 12.0, rtol=1e-6, atol=1e-9)


def test_orbital_axes_of_covariances_are_those_of_the_standard(tmp_path):
    """RTN and TNW of a circular orbit: T of TNW is along the velocity, which is T of RTN, and N is inward."""
    state = State(epoch_utc=START, position_m=(7e6, 0.0, 0.0), velocity_m_s=(0.0, 7546.05, 0.0))
    matrix = np.diag([1.0, 4.0, 9.0, 1e-6, 4e-6, 9e-6])
    matrix[0, 1] = matrix[1, 0] = 0.5
    for frame, terms in (("rtn", ("1.0", "4.0", "0.5")), ("tnw", ("4.0", "1.0", "-0.5"))):
        path = write_opm(tmp_path / f"{frame}.opm", "A", "1", state, covariance=matrix, covariance_axes=frame)
        words = dict(line.split(" = ") for line in path.read_text().splitlines() if " = " in line)
        assert words["COV_REF_FRAME"] == frame.upper()
        found = [float(words[key].split()[0]) * 1e6 for key in ("CX_X", "CY_Y", "CY_X")]
        assert found == pytest.approx([float(term) for term in terms], rel=1e-12)
        message = OrbitParameterMessage.from_file(path)
        np.testing.assert_allclose(message.covariance, matrix, rtol=1e-12, atol=1e-18)
        np.testing.assert_allclose(message.covariance_rtn, matrix, rtol=1e-12, atol=1e-18)


def test_maneuvers_are_read_in_axes_of_impulses(tmp_path):
    burn, impulse = OrbitParameterMessage.from_file(saved(tmp_path, HEAD + STATE + MANEUVERS)).maneuvers
    assert (burn.duration_s, burn.delta_mass_kg, burn.axes) == (132.6, -18.418, "inertial")
    assert burn.ignition_s == pytest.approx(66_738.9828, abs=1e-9)  # 18:32:18.9828 after the epoch
    np.testing.assert_allclose(burn.delta_v_m_s, (-23.257, 16.8316, -8.93444), atol=3e-6)  # a frame bias of 23 mas
    # T along the velocity, N inward, W along the momentum: vnc has y along the momentum and z outward
    assert (impulse.axes, impulse.duration_s, impulse.delta_mass_kg) == ("vnc", 0.0, 0.0)
    assert impulse.delta_v_m_s == pytest.approx((1.015, 3.0, 1.873), rel=1e-14)


@pytest.mark.parametrize("axes", ["gcrs", "eme2000", "mod", "tod", "teme", "itrs"])
def test_what_is_written_is_read_again(tmp_path, axes):
    state = State(
        epoch_utc=START, position_m=(6503514.123456, 1239647.0, -717490.0), velocity_m_s=(-873.2, 8740.4, -4191.1)
    )
    maneuvers = (
        StatedManeuver(10.5, (0.1, -0.2, 0.3)),
        StatedManeuver(20.000_001, (0.4, 0.5, 0.6), "vnc", 12.0, -1.5),
        StatedManeuver(90_000.25, (0.7, 0.8, 0.9), "inertial"),
    )
    path = tmp_path / "a.opm"
    extra = (
        {}
        if axes not in ("tod", "mod")
        else {"frame_epoch_utc": datetime.datetime(2000, 1, 1, 12, tzinfo=datetime.UTC)}
    )
    write_opm(
        path, "CRAFT", "2026-001A", state, covariance=stated_matrix(), mass_kg=500.0, maneuvers=maneuvers, axes=axes,
        version="3.0", created_utc=START, **extra,
    )  # fmt: skip
    assert ("REF_FRAME_EPOCH = 2000-01-01T12:00:00.000" in path.read_text()) == bool(extra)
    with pytest.warns(RsoLidarWarning) if axes == "itrs" else nullcontext():
        message = OrbitParameterMessage.from_file(path)
    assert (message.object_name, message.object_id, message.mass_kg) == ("CRAFT", "2026-001A", 500.0)
    assert message.state.epoch_utc == START and len(message.maneuvers) == 3
    np.testing.assert_allclose(message.state.position_m, state.position_m, atol=2e-6)  # 1e-6 m in the file
    np.testing.assert_allclose(message.state.velocity_m_s, state.velocity_m_s, atol=2e-9)
    scale = np.sqrt(np.diag(stated_matrix()))
    off = (message.covariance - stated_matrix()) / np.outer(scale, scale)
    assert np.abs(off).max() < 1e-9  # in ITRF velocities contain the rate of the Earth times the position
    for found, given in zip(message.maneuvers, maneuvers, strict=True):
        assert (found.axes, found.duration_s, found.delta_mass_kg) == (
            given.axes,
            given.duration_s,
            given.delta_mass_kg,
        )
        assert found.ignition_s == pytest.approx(given.ignition_s, abs=1e-9)
        np.testing.assert_allclose(found.delta_v_m_s, given.delta_v_m_s, atol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("MAN_EPOCH_IGNITION = 2022-12-19T09:00:34.1\n", "", "MAN_DURATION before MAN_EPOCH_IGNITION, which begins"),
        ("2022-12-19T09:00:34.1", "2022-12-17T09:00:34.1", "maneuver 1 ignites before EPOCH.* remove it"),
        ("2022-12-19T09:00:34.1", "soon", "epoch 'soon'; write"),
        ("MAN_DURATION = 132.60", "MAN_DURATION = -1", "MAN_DURATION is below 0; correct it"),
        ("MAN_DURATION = 132.60 [s]", "MAN_DURATION = 2 [min]", "MAN_DURATION in min; write it in s"),
        ("MAN_DELTA_MASS = -18.418", "MAN_DELTA_MASS = 18.418", "MAN_DELTA_MASS is 18.418; the standard sets"),
        ("MAN_REF_FRAME = EME2000", "MAN_REF_FRAME = ITRF", "MAN_REF_FRAME ITRF turns with the Earth; write RTN"),
        ("MAN_REF_FRAME = EME2000", "MAN_REF_FRAME = LVLH", "frame LVLH means two things; write LVLH_INERTIAL"),
        ("MAN_DV_2 = 0.01683160 [km/s]\n", "", "maneuver 1 lacks MAN_DV_2, which the standard requires; add it"),
        ("MAN_DV_2 = 0.01683160", "MAN_DV_1 = 0.01683160", "MAN_DV_1 is given twice; remove one"),
        ("MASS = 1913.000", "MASS = -1", "MASS is -1; give 0 to inf"),
        ("CY_X = 4.618927349220216e-04\n", "", "the message lacks CY_X, which the standard requires; add it"),
        ("CX_X = 3.331349476038534e-04", "CX_X = -3e-4", "a variance below 0; correct it, or remove"),
        ("CX_X = 3.331349476038534e-04", "COV_REF_FRAME = XYZ\nCX_X = 3e-4", "frame XYZ is not supported; write RTN"),
        ("CX_X = 3.331349476038534e-04", "CX_X = 3e-4 [m**2]", "CX_X in m..2; write it in km..2"),
    ],
)
def test_a_wrong_covariance_or_maneuver_is_named(old, new, says):
    text = HEAD + STATE + COVARIANCE + MANEUVERS
    assert old in text
    with pytest.raises(ScenarioError, match=says) as error:
        OrbitParameterMessage.from_text(text.replace(old, new, 1), "craft.opm")
    assert str(error.value).startswith("craft.opm: ") and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("options", "error", "says"),
    [
        ({"covariance": np.eye(3)}, RecordingError, "covariance: needs 6 x 6 finite numbers"),
        ({"covariance": -np.eye(6)}, RecordingError, "covariance: needs 6 x 6 finite numbers"),
        ({"mass_kg": 0.0}, RecordingError, "mass_kg: 0 kg; give a mass above 0"),
        ({"maneuvers": [StatedManeuver(1.0, (1.0, 0.0, 0.0))]}, RecordingError, "mass_kg: a message with maneuvers"),
        ({"axes": "lvlh"}, ScenarioError, "'lvlh' means two things"),
        ({"frame_epoch_utc": START}, ScenarioError, "frame_epoch_utc: 'gcrs' are no axes of date"),
        ({"originator": "\n"}, RecordingError, "ORIGINATOR .*the format allows"),
    ],
)
def test_what_cannot_be_written_is_refused(tmp_path, options, error, says):
    state = State(epoch_utc=START, position_m=(7e6, 0.0, 0.0), velocity_m_s=(0.0, 7500.0, 0.0))
    with pytest.raises(error, match=says):
        write_opm(tmp_path / "a.opm", "A", "1", state, **options)
    assert not list(tmp_path.iterdir())
