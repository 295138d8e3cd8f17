"""Ephemerides: read, interpolated, written, refused."""

import datetime
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from rso_lidar.errors import PropagationError, RecordingError, RsoLidarWarning, ScenarioError, suppress_warnings
from rso_lidar.orbit import (
    EarthOrientation,
    Ephemeris,
    Epochs,
    Kepler,
    find_ground_track,
    gcrs_from_axes,
    gcrs_from_teme,
    write_ephemeris_csv,
    write_oem,
)
from rso_lidar.orbit.ccsds.ephemeris_arc import read_arcs
from rso_lidar.orbit.ccsds.interpolation import interpolate_hermite, interpolate_lagrange
from rso_lidar.orbit.ccsds.reader import find_table
from rso_lidar.orbit.earth.axes import gcrs_from_eme2000
from rso_lidar.records import BodyState
from tests.orbit.earth.earth_for_tests import finals

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
LOW = Kepler(
    epoch_utc=START,
    semi_major_axis_km=6778.0,
    eccentricity=0.001,
    inclination_deg=51.6,
    raan_deg=30.0,
    argument_of_perigee_deg=10.0,
    true_anomaly_deg=0.0,
)
HEAD = "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2024-01-01T00:00:00\nORIGINATOR = TEST\n"


def segment(rows, frame="GCRF", name="SAT", number="2024-001A", extra="", center="EARTH", system="UTC"):
    return (
        f"META_START\nOBJECT_NAME = {name}\nOBJECT_ID = {number}\nCENTER_NAME = {center}\nREF_FRAME = {frame}\n"
        f"TIME_SYSTEM = {system}\n{extra}META_STOP\n" + "\n".join(rows) + "\n"
    )


def straight(minutes, speed=1.0, day="2024-09-17T12"):
    """Return rows of x = 7000 km + speed t [km/s]."""
    return [f"{day}:{m:02d}:00 {7000 + speed * 60 * m} 10 20 {speed} 0 0" for m in minutes]


def saved(tmp_path, text, name="some.oem"):
    path = tmp_path / name
    path.write_text(text)
    return str(path)


def written(tmp_path, step_s, last_s=7200.0, orbit=LOW):
    nodes = Epochs(START, np.arange(0.0, last_s + 1.0, step_s))
    path = tmp_path / f"{step_s:g}.oem"
    write_oem(path, "SAT (A)", "2024-001A", nodes, orbit.states(nodes))
    return str(path)


# ------------------------------------------------------------------------------------------------- interpolation


def test_polynomials_of_their_degree_are_met_exactly():
    # A polynomial of degree n is its own interpolant; what is left is rounding of the largest value.
    nodes = np.array([0.0, 1.0, 2.5, 3.0, 4.5, 5.0, 7.0])
    time = np.linspace(0.0, 7.0, 50)
    for degree in (1, 2, 3, 6):
        poly = np.polynomial.Polynomial(np.arange(1.0, degree + 2.0))
        value, rate = interpolate_lagrange(time, nodes, poly(nodes)[:, None], degree)
        np.testing.assert_allclose(value[:, 0], poly(time), atol=1e-12 * poly(7.0))
        np.testing.assert_allclose(rate[:, 0], poly.deriv()(time), atol=1e-11 * poly.deriv()(7.0))
    for degree in (3, 5, 7):
        poly = np.polynomial.Polynomial(np.arange(1.0, degree + 2.0))
        value, rate = interpolate_hermite(time, nodes, poly(nodes)[:, None], poly.deriv()(nodes)[:, None], degree)
        np.testing.assert_allclose(value[:, 0], poly(time), atol=1e-12 * poly(7.0))
        np.testing.assert_allclose(rate[:, 0], poly.deriv()(time), atol=1e-11 * poly.deriv()(7.0))


@pytest.mark.parametrize(
    # Position errors [m] that the truth of two bodies allows. Hermite: |f^(2m)| / (2m)! * prod (t - t_k)^2 with
    # f^(n) = a n^n; at h = 300 s, m = 4: 6.8e6 (1.13e-3 * 300)^8 / 8! * 0.32 = 0.01 m inside, more at the ends.
    ("step_s", "method", "degree", "within_m", "within_m_s"),
    [
        (60.0, None, None, 1e-6, 1e-7),  # the file's 1e-6 m
        (300.0, None, None, 0.05, 1e-3),
        (300.0, "hermite", 11, 5e-5, 1e-6),
        (60.0, "lagrange", 7, 1e-4, 1e-6),
        (60.0, "hermite", 3, 0.5, 0.03),
    ],
)
def test_interpolation_error_against_two_body_truth(tmp_path, step_s, method, degree, within_m, within_m_s):
    motion = Ephemeris(file=written(tmp_path, step_s), interpolation=method, degree=degree)
    epochs = Epochs(START, np.linspace(0.0, 7200.0, 997))
    with pytest.warns(RsoLidarWarning, match="0.38 m") if within_m > 0.05 else nullcontext():
        states = motion.states(epochs)
    truth = LOW.states(epochs)
    assert np.abs(states.position_m - truth.position_m).max() < within_m
    assert np.abs(states.velocity_m_s - truth.velocity_m_s).max() < within_m_s


def test_every_use_of_rows_far_apart_warns_and_of_no_orbit_is_refused(tmp_path):
    epochs = Epochs(START, np.linspace(0.0, 7200.0, 97))
    sparse = Ephemeris(file=written(tmp_path, 600.0))
    says = (
        r"interpolation is off by some 7 m between the row of .* and the next, 600 s later; take a finer table, or 'num"
    )
    with (
        suppress_warnings(),
        pytest.warns(RsoLidarWarning, match=says),
    ):  # the first time even in auxiliary calculations
        sparse.breaks_s(epochs)
    with suppress_warnings():
        sparse.states(epochs)
    with pytest.warns(RsoLidarWarning, match=says) as caught:
        find_ground_track(sparse, epochs)
    assert len(caught) == 1
    hourly = Ephemeris(file=written(tmp_path, 3600.0, 36_000.0))
    for use in (hourly.states, lambda epochs: find_ground_track(hourly, epochs), hourly.breaks_s):
        with pytest.raises(ScenarioError, match=r"3600 s later; take a finer table, or 'numerical'"):
            use(epochs)


def test_a_degree_of_one_with_velocities_is_the_cubic_through_two_rows(tmp_path):
    path = written(tmp_path, 60.0)
    text = Path(path).read_text().replace("INTERPOLATION_DEGREE = 7", "INTERPOLATION_DEGREE = 1")
    epochs = Epochs(START, np.linspace(0.0, 7200.0, 997))
    motion = Ephemeris(file=saved(tmp_path, text, "one.oem"))
    says = r"off by some 0\.38 m .*; set `degree` to 7, for an error of"
    with pytest.warns(RsoLidarWarning, match=says):
        off_m = np.linalg.norm(motion.states(epochs).position_m - LOW.states(epochs).position_m, axis=1)
    assert off_m.max() == pytest.approx(0.38, abs=0.005)  # r n^4 h^4 / 384: 6.77e6 m (1.131e-3 60)^4 / 384
    seven = motion.replace(degree=7).states(epochs)
    assert np.array_equal(seven.position_m, Ephemeris(file=path).states(epochs).position_m)


def test_an_epoch_has_the_same_bits_alone(tmp_path):
    path = written(tmp_path, 60.0)
    for method in ("hermite", "lagrange"):
        motion = Ephemeris(file=path, interpolation=method)
        epochs = Epochs(START, np.linspace(0.0, 7200.0, 101))
        whole = motion.states(epochs)
        for k in (0, 1, 50, 99, 100):
            one = motion.states(epochs.at(k))
            assert np.array_equal(one.position_m[0], whole.position_m[k])
            assert np.array_equal(one.velocity_m_s[0], whole.velocity_m_s[k])


def test_a_table_without_velocities(tmp_path):
    rows = "".join(f"{t},{7000 + t},{2 * t},{t * t}\n" for t in range(10))
    motion = Ephemeris(file=saved(tmp_path, "time_s,x_km,y_km,z_km\n" + rows, "t.csv"))
    state = motion.states(Epochs(START, np.array([4.5])))
    np.testing.assert_allclose(state.position_m[0], [7004.5e3, 9e3, 20.25e3], rtol=1e-12)
    np.testing.assert_allclose(state.velocity_m_s[0], [1e3, 2e3, 9e3], rtol=1e-10)
    with pytest.raises(ScenarioError, match="'hermite' needs velocities"):
        motion.replace(interpolation="hermite").states(Epochs(START, np.array([4.5])))


# -------------------------------------------------------------------------------------------------------- reading


def test_frames_are_turned_to_gcrs(tmp_path):
    # ERFA bp00's frame bias; the printed offsets (USNO Circular 179, eq. 3.3) have five digits: 7e-13
    bias = [
        [9.9999999999999423e-01, -7.0782797441991980e-08, 8.0562171469761338e-08],
        [7.0782794778573375e-08, 9.9999999999999689e-01, 3.3060414542221364e-08],
        [-8.0562173809869717e-08, -3.3060408839805517e-08, 9.9999999999999623e-01],
    ]
    np.testing.assert_allclose(gcrs_from_eme2000().T, bias, rtol=0, atol=1e-12)
    epochs = Epochs(START, np.array([60.0]))
    raw = np.array([7060e3, 10e3, 20e3])
    for frame in ("EME2000", "J2000"):
        path = saved(tmp_path, HEAD + segment(straight(range(5)), frame), frame)
        got = Ephemeris(file=path).states(epochs).position_m[0]
        np.testing.assert_allclose(got, np.array(bias).T @ raw, atol=1e-8)
    path = saved(tmp_path, HEAD + segment(straight(range(5)), "TEME"), "teme")
    np.testing.assert_allclose(
        Ephemeris(file=path).states(epochs).position_m[0], gcrs_from_teme(epochs)[0] @ raw, atol=1e-7
    )
    for frame in ("GCRF", "ICRF", "ICRF-3"):
        path = saved(tmp_path, HEAD + segment(straight(range(5)), frame), frame)
        assert np.array_equal(Ephemeris(file=path).states(epochs).position_m[0], raw)


def test_axes_of_a_fixed_epoch_do_not_turn(tmp_path):
    # TOD of 2000: from then to 2024 the equinox moves by 50.3"/year x 24.7 years, which is 42 km at this distance
    extra = "REF_FRAME_EPOCH = 2000-01-01T12:00:00\n"
    epochs = Epochs(START, np.array([60.0]))
    raw_m = np.array([7060e3, 10e3, 20e3])
    for frame, axes in (("TOD", "tod"), ("MOD", "mod"), ("TEME", "teme")):
        motion = Ephemeris(file=saved(tmp_path, HEAD + segment(straight(range(5)), frame, extra=extra), axes))
        then = Epochs(datetime.datetime(2000, 1, 1, 12, tzinfo=datetime.UTC), np.zeros(1))
        expected_m = gcrs_from_axes(axes, then)[0] @ raw_m
        np.testing.assert_allclose(motion.states(epochs).position_m[0], expected_m, atol=1e-7)
        off_m = np.linalg.norm(gcrs_from_axes(axes, epochs)[0] @ raw_m - expected_m)
        assert off_m == pytest.approx(7060e3 * 50.29 * 24.71 * np.pi / 648_000, rel=0.01)


def test_time_systems(tmp_path):
    # 37 s of TAI are 37 km of this row's flight
    path = saved(tmp_path, HEAD + segment(straight(range(5)), system="TAI"))
    state = Ephemeris(file=path).states(Epochs(START, np.array([60.0 - 37.0])))
    np.testing.assert_allclose(state.position_m[0, 0], 7060e3, atol=1e-6)


def test_segments_are_not_mixed(tmp_path):
    # An impulse at 12:05: before it 1 km/s, after it 2 km/s.
    after = [f"2024-09-17T12:{m:02d}:00 {7300 + 120 * (m - 5)} 10 20 2 0 0" for m in range(5, 10)]
    path = saved(tmp_path, HEAD + segment(straight(range(6))) + segment(after))
    motion = Ephemeris(file=path)
    epochs = Epochs(START, np.array([299.9, 300.0, 300.1]))
    states = motion.states(epochs)
    np.testing.assert_allclose(states.velocity_m_s[:, 0], [1e3, 2e3, 2e3], rtol=1e-12)  # at the edge, what is after it
    np.testing.assert_allclose(states.position_m[:, 0], [7299.9e3, 7300e3, 7300.2e3], rtol=1e-12)


def test_useable_spans_hold(tmp_path):
    extra = "START_TIME = 2024-09-17T12:00:00\nUSEABLE_START_TIME = 2024-09-17T12:02:00\n"
    extra += "USEABLE_STOP_TIME = 2024-09-17T12:08:00\n"
    motion = Ephemeris(file=saved(tmp_path, HEAD + segment(straight(range(11)), extra=extra)))
    motion.states(Epochs(START, np.array([120.0, 480.0])))
    epochs = Epochs(START, np.array([119.0, 300.0, 481.0, 600.0]))
    with pytest.raises(PropagationError, match=r"3 of 4 epochs, first at time_s = 119 .*12:02:00.*12:08:00") as error:
        motion.states(epochs)
    assert error.value.bad.tolist() == [True, False, True, True]


def test_a_gap_between_segments_has_no_states(tmp_path):
    later = straight(range(20, 25))
    motion = Ephemeris(file=saved(tmp_path, HEAD + segment(straight(range(5))) + segment(later)))
    with pytest.raises(PropagationError, match="in 2 segments") as error:
        motion.states(Epochs(START, np.array([0.0, 600.0, 1200.0])))
    assert error.value.bad.tolist() == [False, True, False]


def test_one_of_several_objects(tmp_path):
    other = straight(range(5), 2.0)
    path = saved(tmp_path, HEAD + segment(straight(range(5))) + segment(other, name="OTHER", number="2024-002B"))
    epochs = Epochs(START, np.array([30.0]))
    for name in ("other", "2024-002B"):
        assert Ephemeris(file=path, object=name).states(epochs).velocity_m_s[0, 0] == pytest.approx(2000.0, rel=1e-12)
    with pytest.raises(ScenarioError, match=r"several objects \(SAT \(2024-001A\), OTHER \(2024-002B\)\)"):
        Ephemeris(file=path).states(epochs)
    with pytest.raises(ScenarioError, match="unknown object 'OTHRE'; did you mean 'OTHER'"):
        Ephemeris(file=path, object="OTHRE").states(epochs)


def test_what_the_file_says_about_interpolation_holds(tmp_path):
    rows = [f"2024-09-17T12:{m:02d}:00 {7000 + m**2} 0 0 0 0 0" for m in range(5)]
    epochs = Epochs(START, np.array([90.0]))
    linear = Ephemeris(file=saved(tmp_path, HEAD + segment(rows, extra="INTERPOLATION = LINEAR\n")))
    assert linear.states(epochs).position_m[0, 0] == 7002.5e3
    extra = "INTERPOLATION = LAGRANGE\nINTERPOLATION_DEGREE = 2\n"
    square = Ephemeris(file=saved(tmp_path, HEAD + segment(rows, extra=extra), "b"))
    np.testing.assert_allclose(square.states(epochs).position_m[0, 0], 7002.25e3, rtol=1e-14)
    odd = Ephemeris(file=saved(tmp_path, HEAD + segment(rows, extra="INTERPOLATION = CHEBYSHEV\n"), "c"))
    with pytest.raises(ScenarioError, match="INTERPOLATION chebyshev is not supported"):
        odd.states(epochs)
    with pytest.warns(RsoLidarWarning, match="off by some 3.1 km"):  # the velocities are 0 where the rows move
        assert odd.replace(interpolation="hermite").states(epochs)


def test_xml_is_read_as_the_other_notation(tmp_path):
    meta = "<OBJECT_NAME>SAT</OBJECT_NAME><OBJECT_ID>1</OBJECT_ID><CENTER_NAME>EARTH</CENTER_NAME>"
    meta += "<REF_FRAME>GCRF</REF_FRAME><TIME_SYSTEM>UTC</TIME_SYSTEM>"
    vectors = ""
    for m in range(3):
        values = zip(("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT"), (7000 + 60 * m, 10, 20, 1, 0, 0), strict=True)
        vectors += f"<stateVector><EPOCH>2024-09-17T12:0{m}:00</EPOCH>"
        vectors += "".join(f"<{name}>{value}</{name}>" for name, value in values) + "</stateVector>\n"
    text = (
        '<?xml version="1.0"?>\n<oem id="CCSDS_OEM_VERS" version="2.0"><header><ORIGINATOR>T</ORIGINATOR></header><body>'
        f"<segment><metadata>{meta}</metadata><data><COMMENT>X</COMMENT>{vectors}<covarianceMatrix><EPOCH>z</EPOCH>"
        "</covarianceMatrix></data></segment></body></oem>\n"
    )
    state = Ephemeris(file=saved(tmp_path, text, "a.xml")).states(Epochs(START, np.array([90.0])))
    np.testing.assert_allclose(state.position_m[0], [7090e3, 10e3, 20e3], rtol=1e-14)
    with pytest.raises(ScenarioError, match="line 3: Y 'ten' is not a number"):
        broken = text.replace("<Y>10</Y>", "<Y>ten</Y>").replace("<Y>ten</Y>", "<Y>10</Y>", 1)
        Ephemeris(file=saved(tmp_path, broken, "b.xml")).states(Epochs(START, np.array([90.0])))


def in_xml(*rows):
    meta = "<OBJECT_NAME>SAT</OBJECT_NAME><OBJECT_ID>1</OBJECT_ID><CENTER_NAME>EARTH</CENTER_NAME>"
    meta += "<REF_FRAME>GCRF</REF_FRAME><TIME_SYSTEM>UTC</TIME_SYSTEM>"
    vectors = "".join(
        "<stateVector>" + "".join(f"<{name}>{value}</{name}>" for name, value in row) + "</stateVector>\n"
        for row in rows
    )
    return (
        f'<oem id="CCSDS_OEM_VERS" version="2.0"><header/><body><segment><metadata>{meta}</metadata>\n<data>{vectors}</data>'
        "</segment></body></oem>\n"
    )


def test_xml_rows_are_read_by_name(tmp_path):
    place, speed, push = (("X", "Y", "Z"), ("X_DOT", "Y_DOT", "Z_DOT"), ("X_DDOT", "Y_DDOT", "Z_DDOT"))
    values = {**dict.fromkeys(speed, 1), **dict.fromkeys(push, 0.009)}

    def row(minute, *names):
        here = dict.fromkeys(place, 7000 + 60 * minute) | values
        return [("EPOCH", f"2024-09-17T12:0{minute}:00"), *((name, here[name]) for name in names)]

    epochs = Epochs(START, np.array([0.0]))
    whole = [row(minute, *push, *speed, *place) for minute in range(3)]  # in any order
    state = Ephemeris(file=saved(tmp_path, in_xml(*whole), "whole.xml")).states(epochs)
    np.testing.assert_array_equal(state.velocity_m_s, [[1e3, 1e3, 1e3]])
    for k, (rows, says) in enumerate(
        [
            (
                [row(minute, *place, *push) for minute in range(3)],
                "line 2: the stateVector lacks X_DOT, Y_DOT, Z_DOT; give",
            ),
            ([row(minute, *speed) for minute in range(3)], "the stateVector lacks X, Y, Z; give all"),
            ([whole[0], [*row(1, *place, *speed), ("X", 7100)], whole[2]], "line 3: X is given twice; remove one"),
        ]
    ):
        with pytest.raises(ScenarioError, match=says):
            Ephemeris(file=saved(tmp_path, in_xml(*rows), f"{k}.xml")).states(epochs)
    twice = in_xml(*whole).replace("<REF_FRAME>", "<REF_FRAME>TEME</REF_FRAME><REF_FRAME>")
    with pytest.raises(ScenarioError, match="line 1: REF_FRAME is given twice"):
        Ephemeris(file=saved(tmp_path, twice, "twice.xml")).states(epochs)


@pytest.mark.parametrize("word", ["²", "٣", "7_0", "-1", "9" * 5000])
def test_a_degree_is_written_in_ascii_digits(tmp_path, word):
    text = HEAD + segment(straight(range(5)), extra=f"INTERPOLATION = LAGRANGE\nINTERPOLATION_DEGREE = {word}\n")
    with pytest.raises(ScenarioError, match=r"INTERPOLATION_DEGREE .*; write 1 to 31"):
        Ephemeris(file=saved(tmp_path, text)).states(Epochs(START, np.array([0.0])))


@pytest.mark.parametrize("word", ["7_000", "٧٠٠٠", "７０００"])
def test_a_number_is_written_in_ascii_digits(tmp_path, word):
    rows = [f"2024-09-17T12:0{m}:00 {word} 0 0 0 0 0" for m in range(5)]
    with pytest.raises(ScenarioError, match=r"line 11: X '.*' is not a number; correct it"):
        Ephemeris(file=saved(tmp_path, HEAD + segment(rows))).states(Epochs(START, np.array([0.0])))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (HEAD + segment(straight(range(5)), "TDR"), "line 8: reference frame TDR is not supported"),
        (HEAD + segment(straight(range(5)), "MOON_ME"), "line 8: reference frame MOON_ME is not supported"),
        (
            HEAD + segment(straight(range(5)), center="MARS BARYCENTER"),
            "line 7: CENTER_NAME MARS BARYCENTER; only EARTH",
        ),
        (HEAD + segment(straight(range(5)), system="TDB"), "line 9: TIME_SYSTEM TDB is not supported"),
        (HEAD + segment(straight(range(5))).replace("REF_FRAME = GCRF\n", ""), "line 4: the metadata lack REF_FRAME"),
        (HEAD + segment(straight(range(1))), "line 4: the segment has 1 rows"),
        (HEAD + segment(["2024-09-17T12:00:00 1 2 3 4 5", *straight(range(1, 3))]), "line 11: has 6 words"),
        (HEAD + segment(["2024-09-17T12:00:00 1 2 3 4 5 x", *straight(range(1, 3))]), "line 11: Z_DOT 'x'"),
        (HEAD + segment(["2024-09-17T12:00:00 nan 2 3 4 5 6", *straight(range(1, 3))]), "line 11: X is nan"),
        (HEAD + segment(["2024-09-17T12:00:00 1e99 2 3 4 5 6", *straight(range(1, 3))]), "line 11: X is 1e99"),
        (
            HEAD + segment(["2024-13-17T12:00:00 1 2 3 4 5 6", *straight(range(1, 3))]),
            "line 11: epoch .*day does not exist",
        ),
        (HEAD + segment(straight([0, 2, 1])), "line 13: its epoch is before that of the row before; sort the rows"),
        (
            HEAD + segment([*straight([0, 1]), straight([1], 1.001)[0], *straight([2])]),
            "line 13: its epoch occurs twice, in the row before, too; .* begin a new segment there",
        ),
        (
            HEAD + segment(straight(range(6))) + segment(straight(range(4, 9))),
            "line 17: overlaps the segment of .*line 4",
        ),
        (
            HEAD + segment(straight(range(5)), extra="INTERPOLATION_DEGREE = many\n"),
            "line 10: INTERPOLATION_DEGREE many",
        ),
        (HEAD + segment(straight(range(5)), extra="STOP_TIME = 2024-09-16T00:00:00\n"), "line 4: no useable time"),
        ("hello world\n", "line 1: begins with 'hello world'"),
        ("", "is empty"),
        ("time_s,x_m,y_m\n0,1,2\n1,2,3\n", "line 1: column z_m is missing"),
        ("time_s,x_m,y_m,z_m,vx_m_s\n", "column vy_m_s, vz_m_s is missing"),
        ("x_m,y_m,z_m\n1,2,3\n1,2,3\n", "needs one column of time"),
        ("time_s,x_m,y_m,z_m,x_km,y_km,z_km\n", "one set of them"),
        ("time_s,x_m,y_m,z_n\n0,1,2,3\n", "unknown column 'z_n'; did you mean 'z_m'"),
        ("time_s,x_m,y_m,z_m\n0,1,2,3\n", "has 1 rows"),
        ("time_s,x_m,y_m,z_m\n0,1,2,3\n1,2,3\n", "line 3: has 3 cells"),
        ("utc,x_m,y_m,z_m\n2024-09-17T12:00:00Z,1,2,3\nnoon,1,2,3\n", "line 3: epoch 'noon'"),
    ],
)
def test_broken_files_are_refused_with_their_line(tmp_path, text, says):
    path = saved(tmp_path, text)
    with pytest.raises(ScenarioError, match=says) as error:
        Ephemeris(file=path).states(Epochs(START, np.array([30.0])))
    assert str(error.value).startswith(path) and "\n" not in str(error.value)


def test_files_that_are_not_there_or_not_text(tmp_path):
    with pytest.raises(ScenarioError, match="no such file"):
        Ephemeris(file="not/there.oem").states(Epochs(START, np.zeros(1)))
    (tmp_path / "b").write_bytes(b"\xff\x00\xfe")
    for path, says in ((tmp_path / "b", "not UTF-8"), (tmp_path, "is a folder")):
        with pytest.raises(ScenarioError, match=says):
            Ephemeris(file=str(path)).states(Epochs(START, np.zeros(1)))
    for degree in (0, 32):
        with pytest.raises(ScenarioError, match="degree"):
            Ephemeris(file="a", degree=degree)


# -------------------------------------------------------------------------------------------------------- writing


def test_writing_and_reading_agree_to_the_printed_digits(tmp_path):
    # Over the leap second at the end of 2016, and at times that are no decimals.
    start = datetime.datetime(2016, 12, 31, 23, 59, 30, 123456, tzinfo=datetime.UTC)
    epochs = Epochs(start, np.arange(90) / 1.5)
    states = LOW.replace(epoch_utc=start).states(epochs)
    oem = write_oem(tmp_path / "a.oem", "SAT", "1", epochs, states, version="3.0", created_utc=start)
    table = write_ephemeris_csv(tmp_path / "a.csv", epochs, states)
    assert ":60." in oem.read_text() and "CREATION_DATE = 2016-12-31T23:59:30\n" in oem.read_text()
    for path in (oem, table):
        back = Ephemeris(file=str(path)).states(epochs)
        np.testing.assert_allclose(back.position_m, states.position_m, atol=6e-7)  # half a digit, and 1 ps of flight
        np.testing.assert_allclose(back.velocity_m_s, states.velocity_m_s, atol=6e-10)
    assert Ephemeris(file=str(oem)).span_utc(start) == ("2016-12-31T23:59:30.123Z", "2017-01-01T00:00:28.457Z")


def test_what_cannot_be_written_is_refused(tmp_path):
    epochs = Epochs(START, np.array([0.0, 60.0]))
    states = LOW.states(epochs)
    hole = BodyState(np.where([[True], [False]], np.nan, states.position_m), states.velocity_m_s)
    with pytest.raises(RecordingError, match="finite"):
        write_oem(tmp_path / "a", "A", "1", epochs, hole)
    with pytest.raises(RecordingError, match="two or more that grow"):
        write_oem(tmp_path / "a", "A", "1", epochs.at(slice(None, None, -1)), states)
    assert not (tmp_path / "a").exists()


@pytest.mark.parametrize("axes", ["gcrs", "eme2000", "mod", "tod", "teme", "itrs"])
def test_states_written_in_any_axes_are_read_again(axes, tmp_path):
    epochs = Epochs(START, np.arange(0.0, 3600.0, 60.0))
    late_s = float(epochs.skyfield_time().dut1[0])
    (tmp_path / "finals.all").write_text(finals(range(60568, 60574), 0.21, 0.45, late_s), encoding="utf-8")
    known = EarthOrientation.from_file(tmp_path / "finals.all")
    path = write_oem(tmp_path / "a.oem", "A", "1", epochs, LOW.states(epochs), axes=axes, orientation=known)
    named = {"earth_orientation_file": str(tmp_path / "finals.all")} if axes == "itrs" else {}
    flown = Ephemeris(file=str(path), **named)
    between = Epochs(START, np.arange(10.0, 3500.0, 37.0))
    states, expected = flown.states(between), LOW.states(between)
    # axes of date are taken not to turn, though precession and nutation turn them by up to 1e-11 rad/s: 7e-5 m/s here
    of_date = axes in ("mod", "tod", "teme")
    np.testing.assert_allclose(states.position_m, expected.position_m, rtol=0, atol=1e-3 if of_date else 2e-5)
    # axes of date are taken not to turn, though precession and nutation turn them by up to 1e-11 rad/s
    np.testing.assert_allclose(
        states.velocity_m_s, expected.velocity_m_s, rtol=0, atol=2e-4 if axes != "itrs" else 1e-7
    )
    if axes == "itrs":
        plain = Ephemeris(file=str(path))
        with pytest.warns(
            RsoLidarWarning, match="is in ITRF, and without polar motion and UT1 it is off by up to 30 m: na"
        ):
            states = plain.states(between)
        off_m = np.linalg.norm(states.position_m - expected.position_m, axis=1)
        assert 5.0 < off_m.max() < 30.0


@pytest.mark.parametrize(
    ("factor", "says"),
    [(1000.0, "are 7,000,000 to 7,240,000 km from"), (0.001, "are 7 to 7 km from the Earth's centre")],
)
def test_positions_of_another_unit_are_refused(tmp_path, factor, says):
    rows = [f"2024-09-17T12:{m:02d}:00 {factor * (7000 + 60 * m)} 0 0 {factor} 0 0" for m in range(5)]
    with pytest.raises(ScenarioError, match=says) as refused:
        read_arcs(*find_table(saved(tmp_path, HEAD + segment(rows))), None)
    assert str(refused.value).endswith(", where nothing orbits it; correct their unit")


@pytest.mark.filterwarnings("ignore:.*interpolation")
def test_rows_inside_the_earth_are_warned_of(tmp_path):
    """At 6355 km; rows at 6356 km, as at the poles, may be a place on the ground."""
    rows = [f"2024-09-17T12:{m:02d}:00 {6357 - m} 0 0 0 0 0" for m in range(5)]
    path = saved(tmp_path, HEAD + segment(rows))
    says = r"3 of 5 rows are inside the Earth, first at 2024-09-17T12:02:00.*, 6,355 km from its centre; correct them"
    with pytest.warns(RsoLidarWarning, match=says):
        Ephemeris(file=path).states(Epochs(START, np.zeros(1)))
    table = "time_s,x_km,y_km,z_km\n" + "".join(f"{60 * k},{6357 - k},0,0\n" for k in range(9))
    with pytest.warns(RsoLidarWarning, match="7 of 9 rows are inside the Earth, first at time_s = 120, 6,355 km"):
        Ephemeris(file=saved(tmp_path, table, "some.csv")).states(Epochs(START, np.zeros(1)))


@pytest.mark.parametrize("axes", ["mod", "tod", "teme"])
def test_axes_of_date_of_one_epoch_do_not_turn(axes, tmp_path):
    """So interpolation is as good as in GCRS axes, where axes of each row's date are off by up to 0.1 mm/s."""
    epochs = Epochs(START, np.arange(0.0, 3600.0, 60.0))
    fixed = START + datetime.timedelta(days=-40, seconds=1.5)
    path = write_oem(tmp_path / "a.oem", "A", "1", epochs, LOW.states(epochs), axes=axes, frame_epoch_utc=fixed)
    assert "REF_FRAME_EPOCH = 2024-08-08T12:00:01.500" in path.read_text()
    between = Epochs(START, np.arange(10.0, 3500.0, 37.0))
    states, expected = Ephemeris(file=str(path)).states(between), LOW.states(between)
    np.testing.assert_allclose(states.position_m, expected.position_m, rtol=0, atol=2e-5)
    np.testing.assert_allclose(states.velocity_m_s, expected.velocity_m_s, rtol=0, atol=1e-7)
    with pytest.raises(ScenarioError, match="frame_epoch_utc: 'itrs' are no axes of date; use 'mod'"):
        write_oem(tmp_path / "b.oem", "A", "1", epochs, LOW.states(epochs), axes="itrs", frame_epoch_utc=fixed)
