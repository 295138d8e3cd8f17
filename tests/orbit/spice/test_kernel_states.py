"""SPICE kernels: those that the toolkit writes are flown, and those of this package are read by the toolkit."""

import datetime
import pathlib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar.errors import PropagationError, RecordingError, ScenarioError
from rso_lidar.motion import Body, SpiceAttitude, truth
from rso_lidar.orbit import Epochs, Kepler, SpiceMotion, read_spice_attitude, write_ck, write_spk
from rso_lidar.orbit.spice.kernel_pool import find_ephemeris_times
from rso_lidar.records import BodyState

spiceypy = pytest.importorskip("spiceypy", reason="the extra `spice` is not installed")
EXAMPLES = pathlib.Path(__file__).parents[3] / "examples"
START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
ORBIT = Kepler(
    epoch_utc=START,
    semi_major_axis_km=6928.137,
    eccentricity=0.001,
    inclination_deg=51.6,
    raan_deg=40.0,
    argument_of_perigee_deg=15.0,
    true_anomaly_deg=70.0,
)
BODY = -900_123
EPOCHS = Epochs(START, np.arange(0.0, 1801.0, 60.0) + 0.123_456_7)
RATE = np.array([1e-3, -5e-4, 2e-3])


def exact_state(epochs):
    """Return states at the ephemeris times, which are the epochs rounded to 0.1 us."""
    times_s, rest_s = find_ephemeris_times(epochs)
    states = ORBIT.states(epochs)
    return times_s, states.position_m - states.velocity_m_s * rest_s[:, None], states.velocity_m_s


@pytest.fixture
def pool():
    """Return the toolkit, and empty its pool of kernels afterwards."""
    yield spiceypy
    spiceypy.kclear()


def test_ephemeris_time_is_that_of_the_toolkit(pool, tmp_path):
    """The formula of NAIF's leap-second kernels, whose constants and last two leap seconds a kernel of the test states."""
    leap = tmp_path / "naif.tls"
    leap.write_text(
        "KPL/LSK\n\\begindata\nDELTET/DELTA_T_A = 32.184\nDELTET/K = 1.657D-3\nDELTET/EB = 1.671D-2\n"
        "DELTET/M = ( 6.239996D0 1.99096871D-7 )\nDELTET/DELTA_AT = ( 36, @2015-JUL-1, 37, @2017-JAN-1 )\n\\begintext\n"
    )
    pool.furnsh(str(leap))
    for text in ("2024-09-17T12:00:00", "2016-12-31T23:59:59.5", "2030-03-03T03:03:03.25"):
        at = datetime.datetime.fromisoformat(f"{text}+00:00")
        times_s, rest_s = find_ephemeris_times(Epochs(at, np.zeros(1)))
        assert times_s[0] == pytest.approx(pool.str2et(text), abs=3e-7) and abs(rest_s[0]) < 1.3e-7


@pytest.mark.parametrize("kind", [9, 13])
def test_an_orbit_that_is_written_is_what_the_toolkit_reads(pool, tmp_path, kind):
    path = write_spk(tmp_path / "a.bsp", "craft", BODY, EPOCHS, ORBIT.states(EPOCHS), kind=kind)
    times_s, position_m, velocity_m_s = exact_state(EPOCHS)
    pool.furnsh(str(path))
    rows = 1e3 * np.array([pool.spkez(BODY, time_s, "J2000", "NONE", 399)[0] for time_s in times_s])
    assert np.abs(rows[:, :3] - position_m).max() < 1e-6  # a micrometre
    # 0.1 us of 9 m/s2, and the rate of TDB, of 3.3e-10
    assert np.abs(rows[:, 3:] - velocity_m_s).max() < 1e-6 + 3.3e-10 * 7600.0
    handle = pool.spklef(str(path))
    pool.dafbfs(handle)
    assert pool.daffna() and pool.dafus(pool.dafgs(5), 2, 6)[1][3] == kind
    between = Epochs(START, np.arange(100.0, 1700.0, 37.0))
    motion = SpiceMotion(kernels=(str(path),), body=str(BODY))
    # Hermite's of degree 7 over a minute in low orbit is good to 0.1 um, Lagrange's to 45 um (docs/orbits.md)
    off_m = motion.states(between).position_m - ORBIT.states(between).position_m
    assert np.abs(off_m).max() < (1e-6 if kind == 13 else 1e-3)
    assert motion.breaks_s(between) == pytest.approx(EPOCHS.time_s[[0, -1]], abs=1e-6)


@pytest.mark.parametrize("kind", [2, 5, 8])
def test_kernels_of_any_type_are_flown(pool, tmp_path, kind):
    """Chebyshev polynomials (2), two-body arcs (5) and even Lagrange (8), all written by the toolkit itself."""
    path = str(tmp_path / "b.bsp")
    times_s, position_m, velocity_m_s = exact_state(EPOCHS)
    rows = np.concatenate([position_m, velocity_m_s], axis=1) / 1e3
    handle = pool.spkopn(path, "B", 0)
    if kind == 2:
        half_s = 30.0
        nodes = np.cos(np.pi * (np.arange(12) + 0.5) / 12)
        fits = []
        for time_s in EPOCHS.time_s[:-1]:
            inside = ORBIT.states(Epochs(START, time_s + half_s * (1.0 + nodes))).position_m / 1e3
            fits.append(np.polynomial.chebyshev.chebfit(nodes, inside, 11).T.ravel())
        n = len(fits)
        pool.spkw02(
            handle, BODY, 399, "J2000", times_s[0], times_s[-1], "b", 60.0, n, 11, np.array(fits).ravel(), times_s[0]
        )
    elif kind == 5:
        pool.spkw05(handle, BODY, 399, "J2000", times_s[0], times_s[-1], "b", 398600.4418, len(rows), rows, times_s)
    else:
        pool.spkw08(handle, BODY, 399, "J2000", times_s[0], times_s[-1], "b", 7, len(rows), rows, times_s[0], 60.0)
    pool.spkcls(handle)
    between = Epochs(START, np.arange(100.0, 1700.0, 37.0))
    found = SpiceMotion(kernels=(path,), body=str(BODY)).states(between)
    wanted = ORBIT.states(between)
    assert np.abs(found.position_m - wanted.position_m).max() < 1e-3
    assert np.abs(found.velocity_m_s - wanted.velocity_m_s).max() < 1e-5


def test_a_segment_begins_at_each_break(pool, tmp_path):
    time_s = np.array([0.0, 60.0, 119.0, 120.0, 180.0, 240.0])
    epochs = Epochs(START, time_s)
    path = write_spk(tmp_path / "a.bsp", "craft", BODY, epochs, ORBIT.states(epochs), breaks_s=(120.0,))
    motion = SpiceMotion(kernels=(str(path),), body=str(BODY))
    assert motion.breaks_s(epochs) == pytest.approx([0.0, 119.0, 120.0, 240.0], abs=1e-6)
    with pytest.raises(PropagationError, match="the kernels do not cover 2 of 3 epochs, first at time_s = -1") as error:
        motion.states(Epochs(START, np.array([-1.0, 10.0, 119.5])))
    assert error.value.bad.tolist() == [True, False, True]


@pytest.mark.parametrize("before_s", [1e-5, 1e-3])
def test_segments_meet_at_a_break_whose_states_are_just_before_it(pool, tmp_path, before_s):
    """An ephemeris ends just before an impulse: the instants up to it are answered by the earlier segment."""
    time_s = np.array([0.0, 60.0, 120.0 - before_s, 120.0, 180.0, 240.0])
    epochs = Epochs(START, time_s)
    states = ORBIT.states(epochs)
    jump_m_s = np.where(time_s[:, None] >= 120.0, 1.0, 0.0)
    path = write_spk(
        tmp_path / "a.bsp", "craft", BODY, epochs, BodyState(states.position_m, states.velocity_m_s + jump_m_s),
        breaks_s=(120.0,),
    )  # fmt: skip
    motion = SpiceMotion(kernels=(str(path),), body=str(BODY))
    assert motion.breaks_s(epochs) == pytest.approx([0.0, 120.0, 240.0], abs=1e-6)
    between = Epochs(START, np.array([119.9, 119.9989, 119.9991, 119.9999, 119.999997, 120.0]))
    states, exact = motion.states(between), ORBIT.states(between)
    # Hermite's of degree 5 over these minutes is good to 10 um; the orbit is two-body, as the step to the break is
    assert np.abs(states.position_m - exact.position_m).max() < 1e-5
    jump_m_s = (states.velocity_m_s - exact.velocity_m_s).mean(axis=1)
    assert jump_m_s == pytest.approx([0.0] * 5 + [1.0], abs=1e-5)


def test_an_attitude_that_is_written_is_what_the_toolkit_reads(pool, tmp_path):
    turns = Rotation.from_rotvec(EPOCHS.time_s[:, None] * RATE)  # constant in body axes
    path = write_ck(tmp_path / "a.bc", "craft", BODY, EPOCHS, turns, np.tile(RATE, (len(EPOCHS), 1)))
    kernels = [str(path), str(path.with_suffix(".tf")), str(path.with_suffix(".tsc"))]
    times_s, rest_s = find_ephemeris_times(EPOCHS)
    pool.furnsh(kernels)
    for k, time_s in enumerate(times_s.tolist()):
        exact = turns[k] * Rotation.from_rotvec(-RATE * rest_s[k])
        found = Rotation.from_matrix(pool.pxform("CRAFT_BODY", "J2000", time_s))
        assert (exact.inv() * found).magnitude() < 1e-12
        assert np.abs(pool.xf2rav(pool.sxform("J2000", "CRAFT_BODY", time_s))[1] - exact.apply(RATE)).max() < 1e-12
    assert pool.bodn2c("CRAFT") == BODY
    pool.kclear()
    between = Epochs(START, np.arange(100.0, 1700.0, 37.0))
    turned, rate = read_spice_attitude(kernels, "CRAFT_BODY", between)
    wanted = Rotation.from_rotvec(between.time_s[:, None] * RATE)
    assert (wanted.inv() * Rotation.from_matrix(turned)).magnitude().max() < 1e-11
    np.testing.assert_allclose(rate, np.tile(RATE, (len(between), 1)), atol=1e-12)


def test_a_body_flies_by_kernels(tmp_path):
    spk = write_spk(tmp_path / "a.bsp", "craft", BODY, EPOCHS, ORBIT.states(EPOCHS))
    turns = Rotation.from_rotvec(EPOCHS.time_s[:, None] * RATE)
    write_ck(tmp_path / "a.bc", "craft", BODY, EPOCHS, turns, np.tile(RATE, (len(EPOCHS), 1)))
    kernels = [str(tmp_path / f"a{suffix}") for suffix in (".bsp", ".bc", ".tf", ".tsc")]
    body = Body(
        name="craft",
        motion=SpiceMotion(kernels=(str(spk), kernels[2]), body="craft"),
        attitude=SpiceAttitude(kernels=tuple(kernels[1:]), frame="CRAFT_BODY"),
    )
    found = truth([body], Epochs(START, np.array([300.0])))
    np.testing.assert_allclose(
        found.states["craft"].position_m, ORBIT.states(Epochs(START, np.array([300.0]))).position_m, atol=1e-6
    )
    assert np.abs(found.rates("inertial", "craft")[1] - RATE).max() < 1e-12


def test_truth_of_a_scenario_is_written_as_kernels(pool, tmp_path):
    scenario = rl.Scenario.load(EXAMPLES / "closed_loop.toml", ("time.duration_s=300",))
    name = scenario.target[0].name
    spk = rl.mission_analysis.save_truth(scenario, tmp_path / "a.bsp", body=name)
    ck = rl.mission_analysis.save_truth(scenario, tmp_path / "a.bc", body=name)
    epochs = Epochs(scenario.time.start_utc, np.array([0.0]))
    known = truth(scenario.bodies, epochs)
    pool.furnsh([str(spk), str(ck), str(ck.with_suffix(".tf")), str(ck.with_suffix(".tsc"))])
    times_s, rest_s = find_ephemeris_times(epochs)
    row = 1e3 * pool.spkezr(name, times_s[0], "J2000", "NONE", "EARTH")[0]
    states = known.states[name]
    assert np.abs(row[:3] - (states.position_m - rest_s[:, None] * states.velocity_m_s)[0]).max() < 1e-6
    found = Rotation.from_matrix(pool.pxform(f"{name.upper()}_BODY", "J2000", times_s[0]))
    rate = np.broadcast_to(known.rates("inertial", name)[1], (1, 3))[0]
    exact = known.pose("inertial", name).rotation * Rotation.from_rotvec(-rate * rest_s[0])
    assert np.max((exact.inv() * found).magnitude()) < 1e-12


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"kernels": ("none.bsp",)}, r"none\.bsp"),
        ({"body": "nobody"}, "spice nobody: no kernel knows that name; give the body's number, or add a kernel"),
        ({"body": "-5"}, "the kernels do not cover 1 of 1 epochs"),
        ({"body": "399"}, "spice 399: is at the Earth's centre; name the body of a craft"),
        ({"body": "99999999999"}, "spice 99999999999: is no number of NAIF's"),
    ],
)
def test_what_kernels_lack_is_one_line(tmp_path, change, says):
    path = write_spk(tmp_path / "a.bsp", "craft", BODY, EPOCHS, ORBIT.states(EPOCHS))
    given = {"kernels": (str(path),), "body": str(BODY)} | change
    with pytest.raises((ScenarioError, PropagationError), match=says) as error:
        SpiceMotion(**given).states(Epochs(START, np.array([300.0])))
    assert "\n" not in str(error.value)


def test_files_that_are_no_kernels_and_unknown_frames_are_one_line(tmp_path):
    bad = tmp_path / "bad.bsp"
    bad.write_bytes(b"DAF/SPK " + bytes(2000))
    for part in (SpiceMotion(kernels=(str(bad),), body="-5"), SpiceMotion(kernels=(str(__file__),), body="-5")):
        with pytest.raises((ScenarioError, PropagationError)) as error:
            part.states(EPOCHS)
        assert "\n" not in str(error.value) and str(error.value).startswith("spice -5: ")
    path = write_spk(tmp_path / "a.bsp", "craft", BODY, EPOCHS, ORBIT.states(EPOCHS))
    with pytest.raises(ScenarioError, match="spice X_BODY: no kernel knows that frame; add a kernel"):
        read_spice_attitude([str(path)], "X_BODY", EPOCHS)


def test_what_makes_no_kernel_is_refused(tmp_path):
    states = ORBIT.states(EPOCHS)
    hole = BodyState(np.where(EPOCHS.time_s[:, None] < 100.0, np.nan, states.position_m), states.velocity_m_s)
    for epochs, given, options, says in (
        (EPOCHS, hole, {}, "needs finite states at two or more epochs"),
        (EPOCHS.at(slice(None, None, -1)), states, {}, "needs finite states at two or more epochs"),
        (EPOCHS.at(slice(0, 3)), states, {}, "3 epochs need positions and velocities"),
        (EPOCHS, states, {"breaks_s": (1.0,)}, "only one epoch is between two breaks"),
    ):
        with pytest.raises(RecordingError, match=says):
            write_spk(tmp_path / "a.bsp", "craft", BODY, epochs, given, **options)
    turns, rates = Rotation.identity(len(EPOCHS)), np.zeros((len(EPOCHS), 3))
    for name, number, rate, says in (
        ("a b", BODY, rates, "needs a number below 0, and up to 20 letters"),
        ("a", 5, rates, "needs a number below 0"),
        ("a", BODY, rates[:2], "epochs need as many attitudes"),
    ):
        with pytest.raises(RecordingError, match=says):
            write_ck(tmp_path / "a.bc", name, number, EPOCHS, turns, rate)
    assert not list(tmp_path.iterdir())


def test_a_kernel_that_fails_keeps_what_the_user_has_loaded(pool, tmp_path):
    turns = Rotation.from_rotvec(EPOCHS.time_s[:, None] * RATE)
    write_ck(tmp_path / "a.bc", "craft", BODY, EPOCHS, turns, np.tile(RATE, (len(EPOCHS), 1)))
    pool.furnsh(str(tmp_path / "a.tf"))
    with pytest.raises(RecordingError, match=r"a\.bsp: .*BODYANDCENTERSAME"):
        write_spk(tmp_path / "a.bsp", "earth", 399, EPOCHS, ORBIT.states(EPOCHS))
    assert pool.ktotal("ALL") == 1 and not (tmp_path / "a.bsp").exists()
