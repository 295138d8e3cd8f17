"""Attitudes from tables: read, interpolated, written, refused."""

import datetime

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.errors import PropagationError, RecordingError, ScenarioError
from rso_lidar.motion import AttitudeTable, Body, Fixed, LvlhCcsds, Tumble, truth, write_aem, write_attitude_csv
from rso_lidar.orbit import Epochs, Kepler
from rso_lidar.orbit.earth.axes import gcrs_from_eme2000

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
ORBIT = Kepler(
    epoch_utc=START,
    semi_major_axis_km=7000.0,
    eccentricity=0.01,
    inclination_deg=51.6,
    raan_deg=30.0,
    argument_of_perigee_deg=10.0,
    true_anomaly_deg=0.0,
)
HEAD = "CCSDS_AEM_VERS = 1.0\nCREATION_DATE = 2024-01-01T00:00:00\nORIGINATOR = TEST\n"
# a turn by 0 and by 90 degrees about z, one minute apart: x, y, z, w
QUARTER = [(0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.5**0.5, 0.5**0.5)]


def flown(law, time_s, motion=ORBIT, local=False):
    """Return inertial_from_body and its rate in body axes."""
    made = truth([Body(name="a", motion=motion, attitude=law)], Epochs(START, np.asarray(time_s, float)), local=local)
    link = made.poses.link("inertial", "a")
    return link.pose.rotation, link.angular_velocity_rad_s


def segment(rows, version=1, **meta):
    keys = {
        "OBJECT_NAME": "SAT",
        "OBJECT_ID": "2024-001A",
        "CENTER_NAME": "EARTH",
        "REF_FRAME_A": "GCRF",
        "REF_FRAME_B": "SC_BODY_1",
        "ATTITUDE_DIR": "A2B",
        "TIME_SYSTEM": "UTC",
        "ATTITUDE_TYPE": "QUATERNION",
        "QUATERNION_TYPE": "LAST",
        **meta,
    }
    lines = [f"{key} = {value}" for key, value in keys.items() if value is not None]
    return "\n".join(["META_START", *lines, "META_STOP", "DATA_START", *rows, "DATA_STOP", ""])


def rows(quaternions, minute=0):
    return [f"2024-09-17T12:{minute + m:02d}:00 " + " ".join(map(str, q)) for m, q in enumerate(quaternions)]


def saved(tmp_path, text, name="some.aem"):
    path = tmp_path / name
    path.write_text(text)
    return str(path)


def test_a_quaternion_is_read_in_the_order_and_direction_that_the_file_says(tmp_path):
    # 504.0-B: q rotates from A to B, v_B = M(q) v_A with M = [[1 - 2 (q2^2 + q3^2), 2 (q1 q2 + q3 qc), ...], ...]. For q of
    # 90 degrees about z, M = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]: inertial +y is body +x.
    first = [(w, x, y, z) for x, y, z, w in QUARTER]
    back = [(-x, -y, -z, w) for x, y, z, w in QUARTER]
    body_first = {"REF_FRAME_A": "SC_BODY_1", "REF_FRAME_B": "GCRF"}
    texts = [
        HEAD + segment(rows(QUARTER)),
        HEAD + segment(rows(first), QUATERNION_TYPE="FIRST"),
        HEAD + segment(rows(back), ATTITUDE_DIR="B2A"),
        HEAD + segment(rows(back), **body_first),
        HEAD + segment(rows(QUARTER), ATTITUDE_DIR="B2A", **body_first),
        HEAD.replace("1.0", "2.0") + segment(rows(QUARTER), QUATERNION_TYPE=None, ATTITUDE_DIR=None),
        HEAD + segment(rows([(-x, -y, -z, -w) for x, y, z, w in QUARTER])),
    ]
    for k, text in enumerate(texts):
        rotation, rate = flown(AttitudeTable(file=saved(tmp_path, text, str(k))), [60.0, 30.0])
        np.testing.assert_allclose(rotation[0].apply([1, 0, 0]), [0, 1, 0], atol=1e-15)
        np.testing.assert_allclose(rate, [[0, 0, np.pi / 120.0]] * 2, atol=1e-15)  # a quarter turn in a minute


def test_the_first_version_must_say_its_direction(tmp_path):
    # 504.0-B-1 makes ATTITUDE_DIR obligatory; 504.0-B-2 has none, and always goes from A to B
    path = saved(tmp_path, HEAD + segment(rows(QUARTER), ATTITUDE_DIR=None))
    with pytest.raises(
        ScenarioError, match="line 4: the metadata lack ATTITUDE_DIR, which the standard requires; add it"
    ) as error:
        flown(AttitudeTable(file=path), [0.0])
    assert "\n" not in str(error.value)


def test_the_frame_bias_is_applied(tmp_path):
    path = saved(tmp_path, HEAD + segment(rows(QUARTER), REF_FRAME_A="EME2000"))
    rotation, _ = flown(AttitudeTable(file=path), [0.0])
    np.testing.assert_allclose(rotation.as_matrix()[0], gcrs_from_eme2000(), atol=1e-15)


def test_orbital_axes(tmp_path):
    time = [0.0, 60.0]
    still = "time_s,qx,qy,qz,qw\n0,0,0,0,1\n60,0,0,0,1\n"
    path = saved(tmp_path, still, "a.csv")
    expected, expected_rate = flown(LvlhCcsds(), time)
    rotation, rate = flown(AttitudeTable(file=path, axes="lvlh_ccsds"), time)
    np.testing.assert_allclose((rotation.inv() * expected).magnitude(), 0.0, atol=1e-15)
    np.testing.assert_allclose(rate, expected_rate, atol=1e-15)
    message = saved(tmp_path, HEAD + segment(rows([QUARTER[0]] * 2), REF_FRAME_A="RTN"))
    for law in (AttitudeTable(file=path, axes="rtn"), AttitudeTable(file=message)):
        rotation, rate = flown(law, time)
        made = truth([Body(name="a", motion=ORBIT)], Epochs(START, np.array(time))).poses.link("inertial", "a.rtn")
        np.testing.assert_allclose((rotation.inv() * made.pose.rotation).magnitude(), 0.0, atol=1e-15)
        with pytest.raises(ScenarioError, match="does not orbit"):
            flown(law, time, Fixed(position_m=(0, 0, 0)), local=True)
    with pytest.raises(ScenarioError, match="leave out axes"):
        flown(AttitudeTable(file=message, axes="rtn"), time)


def test_a_turned_table_in_orbital_axes_is_the_law_turned_alike(tmp_path):
    """Turns about all three axes, which do not commute with that from LVLH to RTN axes."""
    x, y, z, w = Rotation.from_euler("ZYX", [20, -35, 50], degrees=True).as_quat()
    still = "time_s,qx,qy,qz,qw\n" + "".join(f"{t},{x:.17g},{y:.17g},{z:.17g},{w:.17g}\n" for t in (0, 60))
    table = AttitudeTable(file=saved(tmp_path, still, "a.csv"), axes="lvlh_ccsds")
    rotation, rate = flown(table, [0.0, 60.0])
    expected, expected_rate = flown(LvlhCcsds(euler_zyx_deg=(20, -35, 50)), [0.0, 60.0])
    np.testing.assert_allclose((rotation.inv() * expected).magnitude(), 0.0, atol=1e-14)
    np.testing.assert_allclose(rate, expected_rate, atol=1e-15)


def tumbling(tmp_path, step_s):
    law = Tumble(inertia_kg_m2=(10.0, 20.0, 25.0), body_rate_deg_s=(0.5, 3.0, 0.2))
    nodes = Epochs(START, np.arange(0.0, 200.0 + step_s, step_s))
    path = write_aem(tmp_path / f"{step_s:g}.aem", "SAT", "1", nodes, law.orientation(nodes.time_s)[0])
    return law, str(path)


def test_a_spline_follows_a_tumble(tmp_path):
    # The cubic's error falls with the fourth power of the step, its rate's with the third: 0.5 s steps at 3 deg/s.
    time = np.linspace(20.0, 180.0, 333)
    errors = []
    for step_s in (1.0, 0.5):
        law, path = tumbling(tmp_path, step_s)
        rotation, rate = flown(AttitudeTable(file=path), time)
        truly, its_rate = law.orientation(time)
        errors.append([(rotation.inv() * truly).magnitude().max(), np.abs(rate - its_rate).max()])
    ratio = np.array(errors[0]) / errors[1]
    assert 13.0 < ratio[0] < 19.0 and 6.5 < ratio[1] < 9.5
    assert errors[1][0] < 1e-7 and errors[1][1] < 1e-6


@pytest.mark.parametrize("interpolation", ["spline", "slerp"])
def test_rates_are_the_derivative_of_the_turn_and_bits_do_not_depend(tmp_path, interpolation):
    _, path = tumbling(tmp_path, 5.0)
    law = AttitudeTable(file=path, interpolation=interpolation)
    time = np.linspace(1.3, 199.0, 51)  # none within 10 ms of a row
    rotation, rate = flown(law, time)
    after, before = flown(law, time + 0.01)[0], flown(law, time - 0.01)[0]
    np.testing.assert_allclose((before.inv() * after).as_rotvec() / 0.02, rate, atol=1e-7)
    for k in (0, 20, 50):
        one, its_rate = flown(law, time[k : k + 1])
        assert np.array_equal(one.as_quat()[0], rotation.as_quat()[k]) and np.array_equal(its_rate[0], rate[k])


def test_segments_and_objects(tmp_path):
    other = [(0.0, 1.0, 0.0, 0.0)] * 3
    text = HEAD + segment(rows(QUARTER)) + segment(rows(QUARTER, 5)) + segment(rows(other), OBJECT_NAME="OTHER")
    path = saved(tmp_path, text)
    rotation, _ = flown(AttitudeTable(file=path, object="SAT"), [60.0, 300.0])
    np.testing.assert_allclose(np.degrees(rotation.magnitude()), [90.0, 0.0], atol=1e-12)
    with pytest.raises(
        PropagationError, match=r"2 of 3 epochs, first at time_s = 100; it spans .*12:00:00.*12:06:00"
    ) as error:
        flown(AttitudeTable(file=path, object="SAT"), [0.0, 100.0, 400.0])
    assert error.value.bad.tolist() == [False, True, True]
    with pytest.raises(ScenarioError, match="several objects"):
        flown(AttitudeTable(file=path), [0.0])
    with pytest.raises(ScenarioError, match="unknown object 'OTTER'; did you mean 'OTHER'"):
        flown(AttitudeTable(file=path, object="OTTER"), [0.0])


def test_xml(tmp_path):
    meta = "".join(
        f"<{key}>{value}</{key}>"
        for key, value in {
            "OBJECT_NAME": "SAT",
            "OBJECT_ID": "1",
            "REF_FRAME_A": "GCRF",
            "REF_FRAME_B": "SC_BODY_1",
            "TIME_SYSTEM": "UTC",
            "ATTITUDE_TYPE": "QUATERNION",
        }.items()
    )
    states = "".join(
        f"<attitudeState><quaternionEphemeris><EPOCH>2024-09-17T12:0{m}:00</EPOCH><quaternion><QC>{w}</QC><Q1>{x}</Q1>"
        f"<Q2>{y}</Q2><Q3>{z}</Q3></quaternion></quaternionEphemeris></attitudeState>"
        for m, (x, y, z, w) in enumerate(QUARTER)
    )
    text = (
        f'<aem id="CCSDS_AEM_VERS" version="2.0"><body><segment><metadata>{meta}</metadata><data>{states}</data></segment>'
        "</body></aem>"
    )
    rotation, _ = flown(AttitudeTable(file=saved(tmp_path, text)), [60.0])
    np.testing.assert_allclose(rotation.apply([1, 0, 0])[0], [0, 1, 0], atol=1e-15)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (HEAD + segment(rows(QUARTER), ATTITUDE_TYPE="SPIN"), "line 12: ATTITUDE_TYPE SPIN is not supported"),
        (HEAD + segment(rows(QUARTER), QUATERNION_TYPE=None), "line 4: the metadata lack QUATERNION_TYPE"),
        (
            HEAD + segment(rows(QUARTER), QUATERNION_TYPE="MIDDLE"),
            "line 13: QUATERNION_TYPE MIDDLE; write FIRST or LAST",
        ),
        (HEAD + segment(rows(QUARTER), ATTITUDE_DIR="AB"), "line 10: ATTITUDE_DIR AB; write A2B or B2A"),
        (HEAD + segment(rows(QUARTER), REF_FRAME_B="STAR_TRACKER_1"), "one of them must be SC_BODY"),
        (HEAD + segment(rows(QUARTER), REF_FRAME_A="ITRF-97"), "line 8: an attitude in ITRF-97 is not supported"),
        (HEAD + segment(rows(QUARTER), REF_FRAME_A="TEME"), "line 8: an attitude in TEME"),
        (HEAD + segment(rows(QUARTER)[:1]), "line 4: the segment has 1 rows"),
        (HEAD + segment(["2024-09-17T12:00:00 0 0 1", *rows(QUARTER, 1)]), "line 16: has 4 words"),
        (HEAD + segment(["2024-09-17T12:00:00 0 0 0 1 0", *rows(QUARTER, 1)]), "line 16: has 6 words"),
        (HEAD + segment(rows([(0, 0, 0, 1), (0, 0, 1, 1)])), "line 17: the quaternion's norm is 1.41421, not 1"),
        (HEAD + segment(rows([(0, 0, 0, 1), (0, 0, "one", 1)])), "line 17: the quaternion 'one' is not a number"),
        (HEAD + segment(rows(QUARTER)[::-1]), "line 17: its epoch is before that of the row before; sort"),
        (HEAD + segment(rows(QUARTER)) + segment(rows(QUARTER)), "overlaps the segment of"),
        ("CCSDS_OEM_VERS = 2.0\n", "begins with 'CCSDS_OEM_VERS = 2.0'"),
        ("time_s,qx,qy,qz\n0,0,0,0\n1,0,0,0\n", "column qw is missing"),
        ("time_s,qx,qy,qz,qw\n0,0,0,0,2\n1,0,0,0,1\n", "line 2: the quaternion's norm is 2"),
    ],
)
def test_broken_files_are_refused_with_their_line(tmp_path, text, says):
    path = saved(tmp_path, text)
    with pytest.raises(ScenarioError, match=says) as error:
        flown(AttitudeTable(file=path), [30.0])
    assert path in str(error.value) and "\n" not in str(error.value)


def test_writing_and_reading_agree_to_the_printed_digits(tmp_path):
    epochs = Epochs(START, np.arange(20) / 1.5)
    rotation = Rotation.random(20, rng=np.random.default_rng(4))
    for version in ("1.0", "2.0"):
        path = write_aem(tmp_path / version, "SAT", "1", epochs, rotation, version=version, created_utc=START)
        back, _ = flown(AttitudeTable(file=str(path)), epochs.time_s)
        np.testing.assert_allclose((back.inv() * rotation).magnitude(), 0.0, atol=1e-11)  # 1 ps of turns by 2 rad/s
    path = write_attitude_csv(tmp_path / "a.csv", epochs, rotation)
    back, _ = flown(AttitudeTable(file=str(path)), epochs.time_s)
    np.testing.assert_allclose((back.inv() * rotation).magnitude(), 0.0, atol=1e-11)
    with pytest.raises(RecordingError, match="two or more, at least 1 ns apart"):
        write_aem(tmp_path / "c", "SAT", "1", epochs.at(slice(0, 1)), rotation[:1])
