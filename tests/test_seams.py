"""What a user brings as a Python object: the examples fly, and what does not fit is told in one line."""

import runpy
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from tests.settings_for_tests import limit_pixels

FOLDER = Path(__file__).resolve().parents[1] / "examples" / "seams"
EXAMPLES = sorted(path.name for path in FOLDER.glob("*.py"))


def load(name):
    return runpy.run_path(str(FOLDER / name), run_name="example")


@pytest.mark.parametrize("name", EXAMPLES)
def test_every_example_flies_and_prints_what_it_flew(name, capsys):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        runpy.run_path(str(FOLDER / name), run_name="__main__")
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) >= 3
    times = [float(line.split()[0]) for line in lines]
    assert np.all(np.diff(times) > 0.0)


# ----------------------------------------------------------------------------------------------------------- motions


def truth_of(scenario, frames):
    return rl.motion.truth(scenario.bodies, scenario.epochs(np.array(frames)), local=scenario.is_local)


def test_a_users_motion_has_rtn_axes_and_carries_a_relative_motion():
    scenario = load("own_motion.py")["scenario"]
    truth = truth_of(scenario, [0, 100, 500])
    descent = scenario.target[0].motion
    radius = np.linalg.norm(truth.states["stage"].position_m, axis=1)
    np.testing.assert_allclose(radius, descent.radius_m - descent.rate_m_s * truth.time_s, rtol=1e-14)
    # The follower, by Clohessy-Wiltshire about it, begins where its motion says in the stage's rtn axes.
    start = truth.poses.pose("stage.rtn", "follower").translation[0]
    np.testing.assert_allclose(start, scenario.follower.motion.position_m, atol=1e-8)
    first = scenario.time.replace(duration_s=1.0 / scenario.time.frame_rate_hz)
    text = scenario.replace(time=first).describe()
    assert "own_motion" not in text  # a script that is run has no module name
    assert "Descent(radius_m=6900000.0, rate_m_s=2.0)" in text


@dataclass(frozen=True)
class Line:
    """Uniform motion in root axes."""

    position_m: tuple[float, float, float]
    velocity_m_s: tuple[float, float, float]
    orbits = False

    def states(self, epochs):
        velocity = np.tile(np.array(self.velocity_m_s), (len(epochs), 1))
        return rl.records.BodyState(np.array(self.position_m) + epochs.time_s[:, None] * velocity, velocity)


def test_a_motion_without_an_orbit_flies_in_a_local_world():
    bench = rl.Scenario.load(FOLDER.parent / "bench_plate.toml")
    plate = bench.target[0].replace(motion=Line((20.0, 0.0, 0.0), (0.0, 0.5, 0.0)))
    moved = bench.replace(target=(plate, *bench.target[1:]))
    truth = truth_of(moved, [0, 1])
    np.testing.assert_array_equal(truth.states[plate.name].velocity_m_s, [[0.0, 0.5, 0.0]] * 2)
    np.testing.assert_allclose(truth.poses[f"{plate.name}.origin"].translation_m[:, 1], 0.5 * truth.time_s)


def test_a_motion_that_answers_something_else_is_told():
    class Wrong:
        def states(self, epochs):
            return np.zeros((len(epochs), 3))

    scenario = load("own_motion.py")["scenario"]
    stage = scenario.target[0].replace(motion=Wrong())
    with pytest.raises(
        ScenarioError, match=r"stage\.motion: .*Wrong.*: states\(\) returned a ndarray .*; return BodyState"
    ):
        truth_of(scenario.replace(target=(stage,)), [0])


@pytest.mark.parametrize(
    ("motion", "message"),
    [
        (Line, r"motion: is the class Line; give an instance, such as Line\(\)"),
        (object(), r"motion: needs a table with a 'type', a part, or an object with states \(the protocol Motion\)"),
    ],
)
def test_what_is_no_motion_is_refused(motion, message):
    with pytest.raises(ScenarioError, match=message):
        rl.Target(name="x", model="tdrs", motion=motion)


# --------------------------------------------------------------------------------------------------------- attitudes


def test_a_users_attitude_has_the_rates_of_its_orientation():
    scenario = load("own_attitude.py")["scenario"]
    step_s = 1e-3
    epochs = rl.orbit.Epochs(scenario.time.start_utc, 37.0 + step_s * np.array([-1.0, 0.0, 1.0]))
    link = rl.motion.truth(scenario.bodies, epochs).poses.link("inertial", "follower")
    turn = Rotation.from_matrix(link.matrix)
    differenced = (turn[0].inv() * turn[2]).as_rotvec() / (2.0 * step_s)
    np.testing.assert_allclose(link.angular_velocity_rad_s[1], differenced, atol=1e-8)
    assert np.linalg.norm(differenced) > 1e-4


def test_a_slew_leads_between_attitudes_of_the_users_own():
    scenario = load("own_attitude.py")["scenario"]
    nodding = scenario.follower.attitude
    slew = rl.motion.Slew(first=nodding, then=rl.Rtn(), at_s=30.0, max_rate_deg_s=5.0, max_acceleration_deg_s2=5.0)
    slewing = scenario.replace(follower=scenario.follower.replace(attitude=slew))
    matrices = [truth_of(one, [2]).poses["follower"].matrix for one in (scenario, slewing)]
    np.testing.assert_allclose(matrices[1], matrices[0], atol=1e-12)


def test_an_attitude_that_looks_at_nobody_is_told():
    scenario = load("own_attitude.py")["scenario"]
    lost = type(scenario.follower.attitude)(at="stag", amplitude_rad=0.1, period_s=60.0)
    with pytest.raises(ScenarioError, match=r"attitude\.at: unknown name 'stag'; did you mean 'stage'"):
        scenario.replace(follower=scenario.follower.replace(attitude=lost))


def test_an_attitude_that_answers_something_else_is_told():
    class Wrong:
        def orient(self, situation):
            return Rotation.identity()

    scenario = load("own_attitude.py")["scenario"]
    wrong = scenario.replace(follower=scenario.follower.replace(attitude=Wrong()))
    with pytest.raises(
        ScenarioError, match=r"follower\.attitude: .*Wrong.*: orient\(\) returned a Rotation; return an Orientation"
    ):
        truth_of(wrong, [0])


@pytest.mark.parametrize(("rate", "message"), [((1, 3), r"return one rotation or 2"), ((2, 3), r"not finite numbers")])
def test_an_attitude_of_another_number_of_epochs_is_told(rate, message):
    class Short:
        def orient(self, situation):
            return rl.motion.Orientation(Rotation.identity(), np.full(rate, np.nan))

    scenario = load("own_attitude.py")["scenario"]
    short = scenario.replace(follower=scenario.follower.replace(attitude=Short()))
    with pytest.raises(ScenarioError, match=rf"follower\.attitude: .*Short.*: orient\(\) .*{message}"):
        truth_of(short, [0, 1])


def test_a_motion_that_is_not_finite_is_told():
    class Lost:
        orbits = False

        def states(self, epochs):
            return rl.records.BodyState(np.full((len(epochs), 3), np.nan), np.zeros((len(epochs), 3)))

    bench = rl.Scenario.load(FOLDER.parent / "bench_plate.toml")
    lost = bench.replace(target=(bench.target[0].replace(motion=Lost()), *bench.target[1:]))
    with pytest.raises(ScenarioError, match=r"motion: .*Lost.*: states\(\) returned numbers that are not finite"):
        truth_of(lost, [0, 1])


# ------------------------------------------------------------------------------------------------- optional members


class Still:
    """At rest in root axes."""

    orbits = False

    def states(self, epochs):
        shape = (len(epochs), 3)
        return rl.records.BodyState(np.broadcast_to([20.0, 0.0, 0.0], shape), np.zeros(shape))


@pytest.mark.parametrize(
    ("members", "message"),
    [
        ({"relative_to": 3}, r"relative_to is 3; name a body, or leave it out"),
        ({"relative_to": lambda self: "plate"}, r"relative_to is a method; name a body"),
        ({"orbits": lambda self: False}, r"orbits is a method; make it True or False"),
        ({"orbits": "no"}, r"orbits is 'no'; make it True or False"),
        ({"validity": lambda self, epochs: None}, r"validity\(\) returned None; return a list of texts"),
        ({"validity": lambda self, epochs: "too far"}, r"validity\(\) returned 'too far'; return a list of texts"),
        ({"summarize": lambda self, start: None}, r"summarize\(\) returned None; return a text"),
        ({"summarize": "a motion"}, r"summarize is 'a motion'; make it a method, or rename it"),
        ({"states": lambda self, epochs: 3}, r"states\(\) returned a int that is not a BodyState"),
    ],
)
def test_what_a_member_of_a_motion_must_not_be(members, message):
    bench = rl.Scenario.load(FOLDER.parent / "bench_plate.toml")
    own = type("Own", (Still,), members)()
    with pytest.raises(ScenarioError, match=rf"Own\(.*\): {message}") as error:
        scenario = bench.replace(target=(bench.target[0].replace(motion=own), *bench.target[1:]))
        truth_of(scenario, [0, 1])
        scenario.describe()
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("values", [["a", "b", "c"], [1.0 + 2.0j, 0.0, 0.0]])
def test_states_that_are_no_real_numbers_are_told_in_one_line(values):
    class Own(Still):
        def states(self, epochs):
            return rl.records.BodyState(np.tile(values, (len(epochs), 1)), np.zeros((len(epochs), 3)))

    bench = rl.Scenario.load(FOLDER.parent / "bench_plate.toml")
    with pytest.raises(ValueError, match=r"BodyState\.position_m: needs an array of float64, not array") as error:
        truth_of(bench.replace(target=(bench.target[0].replace(motion=Own()),)), [0, 1])
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("position_m", "velocity_m_s"),
    [([7e6, 0, 0], [0, 0, 0]), ([7e6, 0, 0], [5e3, 0, 0]), ([7e6, 1, 0], [-7e3, -1e-3, 0]), ([0, 0, 0], [0, 7e3, 0])],
)
def test_an_orbit_without_a_plane_is_told(position_m, velocity_m_s):
    class Falling:
        def states(self, epochs):
            return rl.records.BodyState(
                *(np.tile(np.array(row, float), (len(epochs), 1)) for row in (position_m, velocity_m_s))
            )

    scenario = load("own_motion.py")["scenario"]
    falling = scenario.replace(target=(scenario.target[0].replace(motion=Falling()),))
    with pytest.raises(ScenarioError, match=r"stage\.motion: .*Falling.*velocity that is zero or along the position"):
        truth_of(falling, [0, 1])


@pytest.mark.parametrize("breaks", ["soon", [np.nan], None, 3.0, [[1.0]]])
def test_breaks_that_are_no_instants_are_told(breaks):
    descent = load("own_motion.py")["scenario"].target[0].motion

    class Own(type(descent)):
        def breaks_s(self, epochs):
            return breaks

    scenario = load("own_motion.py")["scenario"]
    own = Own(descent.radius_m, descent.rate_m_s)
    with pytest.raises(ScenarioError, match=r"Own\(.*\): breaks_s\(\) returned .*; return a list of numbers"):
        truth_of(scenario.replace(target=(scenario.target[0].replace(motion=own),)), [0, 1])


class Level:
    """Axes of the root."""

    def orient(self, situation):
        return rl.motion.Orientation(Rotation.identity(), np.zeros(3))


@pytest.mark.parametrize(
    ("members", "message"),
    [
        ({"looks_at": lambda self: ("stage",)}, r"looks_at is a method; make it a tuple of names"),
        ({"looks_at": "stage"}, r"looks_at is 'stage'; make it a tuple of names"),
        ({"looks_at": 3}, r"looks_at is 3; make it a tuple of names"),
        ({"looks_at": (3,)}, r"looks_at is \(3,\); make it a tuple of names"),
        ({"needs_orbit": lambda self: False}, r"needs_orbit is a method; make it True or False"),
    ],
)
def test_what_a_member_of_an_attitude_must_not_be(members, message):
    scenario = load("own_attitude.py")["scenario"]
    own = type("Own", (Level,), members)()
    with pytest.raises(ScenarioError, match=rf"Own\(.*\): {message}"):
        truth_of(scenario.replace(follower=scenario.follower.replace(attitude=own)), [0])


def test_what_an_attitude_is_given_is_read_only():
    found = {}

    class Curious(Level):
        looks_at = ("stage",)

        def orient(self, situation):
            named = ("position_m", "velocity_m_s", "origin_rate_rad_s", "sun_m", "upward")
            found.update({name: getattr(situation, name) for name in named}, time_s=situation.epochs.time_s)
            found["line"], found["line_rate"] = situation.line("stage")
            return super().orient(situation)

    scenario = load("own_attitude.py")["scenario"]
    truth_of(scenario.replace(follower=scenario.follower.replace(attitude=Curious())), [0, 1])
    assert [name for name, values in found.items() if values.flags.writeable] == []


def test_an_object_whose_repr_raises_flies_under_the_name_of_its_class():
    class Shy(Still):
        def __repr__(self):
            raise RuntimeError("no")

    bench = rl.Scenario.load(FOLDER.parent / "bench_plate.toml", (*limit_pixels(8), "time.duration_s=0.1"))
    shy = bench.replace(target=(bench.target[0].replace(motion=Shy()),))
    assert "Shy(...)" in shy.source.scenario and "Shy(...)" in shy.describe()


# ---------------------------------------------------------------------------------------------------------- trackers


def test_a_users_tracker_holds_the_stage_that_an_open_loop_loses():
    example = load("own_tracker.py")
    scenario, tracker = example["scenario"], example["MeanDirection"](gate_m=20.0)
    assert isinstance(tracker, rl.track.Controller)
    half_field_rad = 0.5 * scenario.lidar.receiver.fov_rad

    def off_rad(frames):
        ends = [frame.truth.pose("lidar", "stage").translation for frame in frames]
        return np.array([np.arctan2(np.hypot(x, y), z) for x, y, z in ends])

    closed, opened = off_rad(rl.simulate(scenario, tracker)), off_rad(rl.simulate(scenario, frames=[19]))
    assert closed.max() < 0.2 * half_field_rad
    assert opened[0] > 0.9 * half_field_rad


# ------------------------------------------------------------------------------------------------- what can be written


@pytest.mark.parametrize("name", ["own_motion.py", "own_attitude.py"])
def test_a_scenario_with_an_object_is_not_written_as_toml_and_its_recording_names_the_object(name):
    scenario = load(name)["scenario"]
    with pytest.raises(ScenarioError, match=r"holds the Python object .*, which TOML cannot"):
        scenario.dumps()
    assert 'type = "python"' in scenario.source.scenario
    assert scenario == scenario.replace()
