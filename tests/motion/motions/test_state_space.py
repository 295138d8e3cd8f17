import datetime
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar import motion, orbit, units
from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.motion import Ptu, SecondOrder, StateSpace, StateSpaceAttitude, StateSpaceDrive, start, step
from rso_lidar.motion.dynamics.flight import Flight
from rso_lidar.rpo import clohessy_wiltshire
from rso_lidar.rpo.relative.hill import find_mean_motion_rad_s

START = datetime.datetime(2026, 5, 7, tzinfo=datetime.UTC)
GM = units.EARTH_GM_M3_S2
TIMES = np.linspace(0.0, 5800.0, 30)
CHIEF = rl.Kepler(
    epoch_utc=START,
    semi_major_axis_km=7000.0,
    eccentricity=0.0,
    inclination_deg=51.6,
    raan_deg=10.0,
    argument_of_perigee_deg=0.0,
    true_anomaly_deg=0.0,
)
INERTIA = np.array([3.0, 5.0, 6.5])


def two_body(_t, x, _u):
    return np.concatenate([x[3:6], -GM * x[:3] / np.linalg.norm(x[:3]) ** 3])


def hill(_t, x, u):
    """Clohessy and Wiltshire's equations about a circle of 7000 km, with an acceleration u."""
    n = np.sqrt(GM / 7e6**3)
    return np.array([*x[3:6], 3 * n**2 * x[0] + 2 * n * x[4] + u[0], -2 * n * x[3] + u[1], -(n**2) * x[2] + u[2]])


def euler(_t, x, _u):
    """A rigid body without torque: quaternion x, y, z, w and body rates."""
    (qx, qy, qz, qw), w = x[:4], x[4:7]
    half = 0.5 * np.array(
        [
            qw * w[0] + qy * w[2] - qz * w[1],
            qw * w[1] + qz * w[0] - qx * w[2],
            qw * w[2] + qx * w[1] - qy * w[0],
            -qx * w[0] - qy * w[1] - qz * w[2],
        ]
    )
    return np.concatenate([half, -np.cross(w, INERTIA * w) / INERTIA])


def flat(_t, x, u):
    return np.concatenate([x[3:6], u])


def drive(_t, x, u):
    natural, damping = 2 * np.pi * 4.0, 0.7
    return np.concatenate([x[2:4], natural**2 * (u - x[:2]) - 2 * damping * natural * x[2:4]])


def epochs(times=TIMES):
    return orbit.Epochs(START, times)


def test_two_bodies_in_a_users_words_are_kepler():
    state = CHIEF.states(epochs(np.zeros(1)))
    mine = StateSpace(
        dynamics=two_body,
        initial_state=(*state.position_m[0], *state.velocity_m_s[0]),
        relative_tolerance=1e-12,
        absolute_tolerance=1e-7,
    )
    bodies = [motion.Body(name="chief", motion=CHIEF), motion.Body(name="mine", motion=mine)]
    course = motion.truth(bodies, epochs())
    assert np.abs(course.pose("chief.rtn", "mine.rtn").translation).max() < 1e-3


def test_hills_equations_about_a_chief_are_the_closed_form():
    model = StateSpace(
        dynamics=hill,
        initial_state=(30.0, -200.0, 15.0, 0.01, -0.05, 0.02),
        inputs=(1e-5, 0.0, -2e-5),
        axes="rtn",
        relative_to="chief",
    )
    bodies = [motion.Body(name="chief", motion=CHIEF), motion.Body(name="mine", motion=model)]
    flown = motion.truth(bodies, epochs()).pose("chief.rtn", "mine.rtn").translation
    expected, _ = clohessy_wiltshire(
        np.array([30.0, -200.0, 15.0]),
        np.array([0.01, -0.05, 0.02]),
        TIMES,
        find_mean_motion_rad_s(CHIEF, START),
        (1e-5, 0.0, -2e-5),
    )
    np.testing.assert_allclose(flown, expected, atol=1e-5)


def test_a_rigid_body_tumbles_as_jacobi_says():
    tumble = rl.Tumble(inertia_kg_m2=tuple(INERTIA), body_rate_deg_s=(3.0, 10.0, -2.0))
    rate = np.array([3.0, 10.0, -2.0]) * units.DEG
    turning = StateSpaceAttitude(dynamics=euler, initial_state=(0.0, 0.0, 0.0, 1.0, *rate), relative_tolerance=1e-12)
    here = rl.Fixed(position_m=(0.0, 0.0, 0.0))
    bodies = [motion.Body(name=n, motion=here, attitude=a) for n, a in (("one", tumble), ("two", turning))]
    course = motion.truth(bodies, epochs(np.linspace(0.0, 120.0, 25)), local=True)
    assert course.pose("one", "two").rotation.magnitude().max() < 1e-7
    assert np.abs(course.rates("one", "two")[1]).max() < 1e-8


def test_a_rigid_body_in_rtn_axes_turns_with_the_orbit():
    """At rest in the chief's rtn axes its inertial rate is the orbit's, about rtn +z: turned into axes askew to it."""

    def still(_t, x, _u):
        return np.zeros(13)

    rtn_from_mine = Rotation.from_euler("ZYX", [90.0, 25.0, -40.0], degrees=True)
    model = StateSpace(
        dynamics=still,
        initial_state=(0.0, -50.0, 0.0, 0.0, 0.0, 0.0, *rtn_from_mine.as_quat(), 0.0, 0.0, 0.0),
        axes="rtn",
        relative_to="chief",
        layout="rigid_body",
    )
    bodies = [motion.Body(name="chief", motion=CHIEF), motion.Body(name="mine", motion=model)]
    course = motion.truth(bodies, epochs())
    turning = rtn_from_mine.inv().apply([0.0, 0.0, np.sqrt(GM / 7e6**3)])
    np.testing.assert_allclose(course.rates("inertial", "mine")[1], np.tile(turning, (len(TIMES), 1)), rtol=1e-9)
    apart = course.pose("chief.rtn", "mine").rotation * rtn_from_mine.inv()
    np.testing.assert_allclose(apart.magnitude(), 0.0, atol=1e-12)


def test_held_inputs_are_what_a_cart_feels():
    flight = Flight(StateSpace(dynamics=flat, initial_state=(0.0,) * 6, inputs=(1.0, 0.0, 0.0), axes="local"))
    assert flight(np.array([2.0]))[0, 0] == pytest.approx(2.0)
    flight.hold(2.0, np.zeros(3))
    flight.hold(4.0, np.array([-1.0, 0.0, 0.0]))
    np.testing.assert_allclose(flight(np.array([1.0, 2.0, 4.0, 6.0]))[:, 0], [0.5, 2.0, 6.0, 8.0], atol=1e-9)
    with pytest.raises(ScenarioError, match="give 3 finite numbers"):
        flight.check_inputs([1.0, 2.0])


def cart_scenario(**changes):
    """A lidar on a cart that a controller pushes, a plate, and a PTU that tracks it."""
    fields = {
        "version": 1,
        "name": "a cart",
        "world": rl.World(axes="local"),
        "time": rl.Time(start_utc=START, duration_s=3.0, frame_rate_hz=2.0),
        "target": (
            rl.Target(
                name="plate",
                model="plate",
                motion=rl.Fixed(position_m=(200.0, 5.0, 0.0)),
                attitude=rl.LookAt(at="follower"),
            ),
        ),
        "follower": rl.Follower(
            motion=StateSpace(dynamics=flat, initial_state=(0.0,) * 6, inputs=(0.0,) * 3, axes="local")
        ),
        "ptu": rl.Ptu(point=rl.TrackPoint(at="plate"), response=rl.SecondOrder(natural_hz=4, damping=0.7)),
        "lidar": rl.Lidar(
            receiver=rl.Receiver(fov_deg=2.5, f_number=2.8, n_rows=16, n_cols=16), detector=rl.Empirical()
        ),
    }
    return rl.Scenario(**{**fields, **changes})


def test_a_controller_pushes_the_follower_and_the_ptu_keeps_on_target():
    pushed = []

    def controller(observation):
        pushed.append(observation.time_s)
        return rl.Command(inputs={"follower": (0.0, 2.0 if observation.time_s < 0.9 else 0.0, 0.0)})

    frames = list(rl.simulate(cart_scenario(), controller))
    along = [frame.truth.states["follower"].position_m[1] for frame in frames]
    # pushed with 2 m/s2 from 0 to 1 s (the command given at 0.5 s holds until 1 s), then it coasts
    np.testing.assert_allclose(along, [0.0, 0.25, 1.0, 2.0, 3.0, 4.0], atol=1e-9)
    for frame in frames:
        seen = frame.truth.pose("lidar", "plate").translation
        assert (
            np.hypot(*seen[:2]) / seen[2] < 2e-3
        )  # the drive lags by 2 zeta / w = 56 ms, at 2 m/s and 200 m: 0.6 mrad
    assert len(pushed) == 6


def test_without_a_controller_the_inputs_of_the_scenario_hold():
    frames = list(rl.simulate(cart_scenario()))
    assert frames[-1].truth.states["follower"].position_m.tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("inputs", "words"),
    [
        ({"follwer": (0.0, 0.0, 0.0)}, "no state-space model or FMU with inputs; did you mean 'follower'?"),
        ({"follower": (0.0,)}, "give 3 finite numbers"),
        ({"follower": "left"}, "give a row of numbers"),
        ({"follower": (np.nan, 0.0, 0.0)}, "give 3 finite numbers"),
    ],
)
def test_bad_inputs_of_a_command(inputs, words):
    with pytest.raises(ScenarioError, match=re.escape(words)):
        list(rl.simulate(cart_scenario(), lambda _: rl.Command(inputs=inputs)))


def test_a_drive_in_a_users_words_is_the_second_order_one():
    def asked(time_s):
        return np.stack([0.3 * np.sin(np.asarray(time_s)), 0.1 * np.cos(np.asarray(time_s))], axis=-1)

    ends = []
    for response in (StateSpaceDrive(dynamics=drive), SecondOrder(natural_hz=4.0, damping=0.7)):
        ptu = Ptu(response=response)
        state = start(ptu, asked)
        for time_s in (0.5, 1.0, 1.0005):
            state = step(ptu, state, asked, time_s)
        ends.append((*state.angle_rad, *state.rate_rad_s))
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-6)


DYNAMICS = """
def push(t, x, u):
    return [x[3], x[4], x[5], 0.0, 0.1, 0.0]

wide = lambda t, x, u: [0.0] * 7
broken = lambda t, x, u: 1 / 0
lost = lambda t, x, u: [float("nan")] * 6
number = 3
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "cart.py"
    path.write_text(DYNAMICS)
    return path


def fly(dynamics):
    model = StateSpace(dynamics=dynamics, initial_state=(0.0,) * 6, axes="local")
    return motion.truth([motion.Body(name="cart", motion=model)], epochs(np.array([0.0, 2.0])), local=True)


def test_dynamics_in_a_file(file):
    course = fly(f"{file}:push")
    assert course.states["cart"].position_m[1, 1] == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("pull", "nothing is named 'pull' there; did you mean 'push'?"),
        ("number", "no function is named 'number' there"),
        ("wide", "returned the shape (7,) at t = 0 s; return one derivative for each of the 6 entries"),
        ("broken", "failed at t = 0 s with ZeroDivisionError"),
        ("lost", "return finite numbers for this state"),
    ],
)
def test_bad_dynamics_say_where(file, name, words):
    with pytest.raises((ScenarioError, PropagationError), match=re.escape(words)):
        fly(f"{file}:{name}")


def test_a_file_that_is_no_python(tmp_path):
    path = tmp_path / "cart.py"
    path.write_text("def push(:\n")
    with pytest.raises(ScenarioError, match=r"cart.py: line 1: cannot be imported \(SyntaxError"):
        fly(f"{path}:push")
    with pytest.raises(ScenarioError, match="no such file"):
        fly(f"{tmp_path / 'none.py'}:push")
    with pytest.raises(ScenarioError, match="cannot be imported"):
        fly("rso_lidar_has_no_such_module:push")


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"dynamics": "cart"}, "names no function"),
        ({"dynamics": 3}, "needs 'file.py:name'"),
        ({"initial_state": (0.0,) * 5}, "needs at least 6"),
        ({"layout": "rigid_body"}, "needs at least 13"),
        ({"layout": "rigid_body", "initial_state": (0.0,) * 13}, "has the norm 0"),
        ({"axes": "rtn"}, "belong together"),
        ({"relative_to": "chief"}, "belong together"),
    ],
)
def test_bad_models(fields, words):
    with pytest.raises(ScenarioError, match=re.escape(words)):
        StateSpace(**{"dynamics": flat, "initial_state": (0.0,) * 6, **fields})


def test_a_scenario_with_dynamics_in_a_file_is_written_and_read_again(file, tmp_path):
    text = cart_scenario().replace(
        follower=rl.Follower(motion=StateSpace(dynamics="cart.py:push", initial_state=(0.0,) * 6, axes="local"))
    )
    scenario = rl.Scenario.loads(_toml(text), folder=file.parent, trust_code=True)
    assert "SHA-256" in scenario.dumps()
    assert 'dynamics = "cart.py:push"' in scenario.dumps()
    again = rl.Scenario.loads(scenario.dumps(), folder=file.parent, trust_code=True)
    first, second = (list(rl.simulate(one))[-1] for one in (scenario, again))
    assert np.array_equal(first.range_m, second.range_m, equal_nan=True)


def _toml(scenario):
    import tomli_w

    return tomli_w.dumps(scenario.model_dump(exclude_none=True))


def test_in_an_inertial_world_local_axes_are_refused_and_the_other_way_round():
    for axes, local, words in (("local", False, "without an Earth"), ("inertial", True, "needs an Earth")):
        body = motion.Body(name="cart", motion=StateSpace(dynamics=flat, initial_state=(7e6,) + (0.0,) * 5, axes=axes))
        with pytest.raises(ScenarioError, match=words):
            motion.truth([body], epochs(), local=local)


def test_an_edited_file_is_read_again(file):
    assert fly(f"{file}:push").states["cart"].position_m[1, 1] == pytest.approx(0.2)
    file.write_text(DYNAMICS.replace("0.1", "0.30"))
    assert fly(f"{file}:push").states["cart"].position_m[1, 1] == pytest.approx(0.6)


def test_dynamics_that_end_can_be_flown_to_their_end():
    def ends(t, x, _u):
        if t > 12.0:
            raise ValueError("the table ends at 12 s")
        return np.concatenate([x[3:6], [1.0, 0.0, 0.0]])

    model = StateSpace(dynamics=ends, initial_state=(0.0,) * 6, axes="local")
    course = motion.truth([motion.Body(name="cart", motion=model)], epochs(np.array([0.0, 12.0])), local=True)
    assert course.states["cart"].position_m[1, 0] == pytest.approx(72.0)


def test_what_cannot_be_hashed_or_found_again_is_told():
    class Plain:
        __hash__ = None

        def __call__(self, t, x, u):
            return np.zeros(6)

    with pytest.raises(ScenarioError, match="cannot be hashed"):
        StateSpace(dynamics=Plain(), initial_state=(0.0,) * 6, axes="local")
    nameless = StateSpace(dynamics=lambda t, x, u: np.zeros(6), initial_state=(0.0,) * 6, axes="local")
    with pytest.warns(rl.RsoLidarWarning, match="has no name by which a recording could find it again"):
        _ = cart_scenario(follower=rl.Follower(motion=nameless)).source


def test_inputs_without_a_model_are_an_error():
    still = cart_scenario(follower=rl.Follower(motion=rl.Fixed(position_m=(0.0, 0.0, 0.0))))
    with pytest.raises(
        ScenarioError, match=re.escape("which has no state-space model or FMU with inputs (known: none)")
    ):
        list(rl.simulate(still, lambda _: rl.Command(inputs={"follower": (1.0,)})))


def test_what_a_long_flight_has_forgotten_is_an_error():
    flight = Flight(StateSpace(dynamics=flat, initial_state=(0.0,) * 6, inputs=(0.0,) * 3, axes="local"))
    for k in range(1100):
        flight.hold(0.1 * k, np.array([0.01 * (k % 7), 0.0, 0.0]))
    flight(np.array([0.05, 109.0]))
    with pytest.raises(PropagationError, match="no longer kept"):
        flight(np.array([5.0, 109.0]))


def test_a_slew_toward_what_a_controller_moves_is_refused():
    plate = rl.Target(
        name="plate",
        model="plate",
        motion=rl.Fixed(position_m=(200.0, 5.0, 0.0)),
        attitude=rl.motion.Slew(
            first=rl.FixedAttitude(),
            then=rl.LookAt(at="follower"),
            at_s=1.0,
            max_rate_deg_s=5.0,
            max_acceleration_deg_s2=5.0,
        ),
    )
    scenario = cart_scenario(target=(plate,))
    assert len(list(rl.simulate(scenario))) == 6  # nobody moves anything
    with pytest.raises(
        ScenarioError, match=r"plate.attitude: a slew is planned ahead, and a controller moves 'follower'"
    ):
        list(rl.simulate(scenario, lambda _: None))


def test_a_stretched_model_is_told_once_in_a_loop():
    """However many flashes there are, and in whichever thread a frame is made."""
    import warnings

    chief = rl.Target(name="plate", model="plate", motion=CHIEF)
    far = StateSpace(
        dynamics=hill,
        initial_state=(0.0, -200.0, 0.0, 0.0, 0.0, 0.0),
        inputs=(0.0,) * 3,
        axes="rtn",
        relative_to="plate",
    )
    other = rl.Target(
        name="other",
        model="plate",
        motion=rl.Hill(relative_to="plate", position_m=(0.0, 20e3, 0.0), velocity_m_s=(0.0, 0.0, 0.0)),
    )
    scenario = cart_scenario(
        world=rl.World(),
        target=(chief, other),
        follower=rl.Follower(motion=far, attitude=rl.LookAt(at="plate")),
        ptu=None,
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        list(rl.simulate(scenario, lambda _: None))
    assert len([one for one in caught if "hill: the separation" in str(one.message)]) == 1


# ---------------------------------------------------------------------------------------------------- Euler angles

RATES = (0.02, -0.03, 0.05)
BEGIN = {"zyx": (0.4, -0.3, 1.1), "xyz": (0.4, -0.3, 1.1), "zxz": (0.4, 0.9, 1.1), "yzx": (2.0, 0.7, -2.5)}
_AXES = {"x": np.array([1.0, 0.0, 0.0]), "y": np.array([0.0, 1.0, 0.0]), "z": np.array([0.0, 0.0, 1.0])}


def by_angles(order, unit):
    """Return `euler` with intrinsic angles in place of the quaternion.

    The body rate is the sum of each angle's rate along its axis, seen from the body: that axis turned back by all that
    follows (Wertz, Spacecraft Attitude Determination and Control, sec. 16.1).
    """
    scale = units.DEG if unit == "deg" else 1.0

    def turning(_t, x, _u):
        a, w = x[:3] * scale, x[3:6]
        last = Rotation.from_euler(order[2].upper(), a[2])
        last_two = Rotation.from_euler(order[1:].upper(), a[1:])
        seen = np.stack(
            [last_two.inv().apply(_AXES[order[0]]), last.inv().apply(_AXES[order[1]]), _AXES[order[2]]], axis=1
        )
        return np.concatenate([np.linalg.solve(seen, w) / scale, -np.cross(w, INERTIA * w) / INERTIA])

    return turning


def turned_by(attitude, times):
    body = motion.Body(name="b", motion=rl.Fixed(position_m=(0.0, 0.0, 0.0)), attitude=attitude)
    return motion.truth([body], epochs(times), local=True)


@pytest.mark.parametrize("unit", ["rad", "deg"])
@pytest.mark.parametrize("order", BEGIN)
def test_euler_angles_and_quaternion_are_the_same_attitude(order, unit):
    begin = Rotation.from_euler(order.upper(), BEGIN[order])
    times = np.linspace(0.0, 25.0, 11)
    tight = {"relative_tolerance": 1e-12, "absolute_tolerance": 1e-12}
    given = begin.as_euler(order.upper(), degrees=unit == "deg")
    angles = StateSpaceAttitude(
        dynamics=by_angles(order, unit), attitude_state=f"euler_{order}_{unit}", initial_state=(*given, *RATES), **tight
    )
    quaternion = StateSpaceAttitude(dynamics=euler, initial_state=(*begin.as_quat(), *RATES), **tight)
    one, other = turned_by(angles, times), turned_by(quaternion, times)
    apart = one.pose("inertial", "b").rotation.inv() * other.pose("inertial", "b").rotation
    assert apart.magnitude().max() < 1e-9
    assert other.pose("inertial", "b").rotation.magnitude().max() > 0.5
    np.testing.assert_allclose(one.rates("inertial", "b")[1], other.rates("inertial", "b")[1], rtol=0, atol=1e-11)
    np.testing.assert_allclose(one.rates("inertial", "b")[1][0], RATES, rtol=0, atol=1e-15)


def test_a_rigid_body_by_euler_angles_has_twelve_entries():
    def flying(t, x, u):
        return np.concatenate([x[3:6], np.zeros(3), by_angles("zyx", "rad")(t, x[6:], u)])

    start = (1.0, 2.0, 3.0, 0.1, 0.0, 0.0, *BEGIN["zyx"], *RATES)
    model = StateSpace(
        dynamics=flying, axes="local", layout="rigid_body", attitude_state="euler_zyx_rad", initial_state=start
    )
    truth = motion.truth([motion.Body(name="b", motion=model)], epochs([0.0, 5.0]), local=True)
    first = truth.pose("inertial", "b")[0]
    np.testing.assert_allclose(
        first.rotation.as_matrix(), Rotation.from_euler("ZYX", BEGIN["zyx"]).as_matrix(), atol=1e-15
    )
    np.testing.assert_allclose(truth.pose("inertial", "b").translation[1], [1.5, 2.0, 3.0], rtol=0, atol=1e-12)
    with pytest.raises(ScenarioError, match="has 11 entries, a rigid_body needs at least 12"):
        model.replace(initial_state=start[:11])
    with pytest.raises(ScenarioError, match="a translation has no attitude"):
        model.replace(layout="translation")


def _pitching(_t, x, _u):
    return np.array([0.0, x[4], 0.0, 0.0, 0.0, 0.0])


def test_euler_angles_near_their_singularity_are_told_and_at_it_refused():
    part = StateSpaceAttitude(
        dynamics=_pitching, attitude_state="euler_zyx_deg", initial_state=(0.0, 80.0, 0.0, 0.0, 1.0, 0.0)
    )
    turned_by(part, np.array([0.0, 8.9]))  # no warning, which would be an error here
    with pytest.warns(UserWarning, match=r"come within 0.5 deg of their singularity \(zyx: .*90 deg\) at time_s = 9.5"):
        turned_by(part, np.array([0.0, 9.5]))
    with pytest.raises(PropagationError, match=r"angles are singular \(zyx: .*\) at time_s = 10;") as caught:
        turned_by(part, np.array([0.0, 10.0]))
    assert caught.value.bad.tolist() == [False, True]
    for order, middle in (("zyx", 90.0), ("xyz", -90.0), ("zxz", 0.0), ("yxy", 180.0)):
        with pytest.raises(ScenarioError, match="begin where they are singular"):
            part.replace(attitude_state=f"euler_{order}_deg", initial_state=(0.0, middle, 0.0, 0.0, 1.0, 0.0))


@pytest.mark.parametrize(
    "name", ["euler", "euler_zyx", "euler_zzx_rad", "euler_ZYX_rad", "euler_zyx_grad", "quaternion"]
)
def test_an_attitude_that_nobody_has_named(name):
    with pytest.raises(ScenarioError, match=r"names no attitude; write quaternion_xyzw, or Euler angles"):
        StateSpaceAttitude(dynamics=_pitching, attitude_state=name, initial_state=(0.0,) * 7)
