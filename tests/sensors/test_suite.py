"""Sensors of a scenario: what they sample is what the follower does, whatever the steps, and it reaches the observation."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.sensors import suite
from tests.settings_for_tests import limit_pixels

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
PERFECT = (
    '{type="gyro", name="gyro", rate_hz=20}',
    '{type="accelerometer", name="accelerometer", rate_hz=50, latency_s=0.05}',
    '{type="star_tracker", name="tracker", rate_hz=4, phase_s=0.1, latency_s=0.2}',
    '{type="gnss", name="receiver", rate_hz=1}',
    '{type="thrusters", name="valves", rate_hz=10, dynamics="motion", force_entries=[0, 1, 2], newtons_per_input=100}',
)
SMALL = (
    *limit_pixels(8, 1),
    "time.duration_s=3",
)


def load(*sensors, settings=()):
    return rl.Scenario.load(
        EXAMPLES / "thrusters.toml", settings=(*SMALL, f"sensor=[{', '.join(sensors)}]", *settings), trust_code=True
    )


@pytest.fixture(scope="module")
def scenario():
    noisy = [line.replace("}", ", angle_random_walk_deg_sqrt_h=0.1}") if "gyro" in line else line for line in PERFECT]
    return load(*noisy)


def fly(scenario, dt_s=None):
    """Return the frames of a run with a push of 0.01 m/s2 along the way during the second second."""
    frames = []
    with rl.Simulation(scenario) as simulation:
        frames.append(simulation.step())
        while not simulation.is_over:
            push = 0.01 if 1.0 <= simulation.time_s < 2.0 else 0.0
            command = rl.Command(inputs={"follower": (0.0, push, 0.0)})
            frame = simulation.step(command) if dt_s is None else simulation.step(command, dt_s=dt_s)
            frames += [frame] if frame is not None else []
    return frames


def test_samples_arrive_with_the_next_flash_and_do_not_depend_on_the_steps(scenario):
    whole, fine = fly(scenario), fly(scenario, 0.05)
    counts = {
        name: [len(frame.observation.sensors[name].time_s) for frame in whole] for name in whole[0].observation.sensors
    }
    assert counts == {
        "gyro": [1, 20, 20],
        "accelerometer": [0, 48, 50],
        "tracker": [0, 3, 4],
        "receiver": [1, 1, 1],
        "valves": [1, 10, 10],
    }
    for one, other in zip(whole, fine, strict=True):
        for name, samples in one.observation.sensors.items():
            np.testing.assert_array_less(samples.available_s, one.time_s + 1e-9)
            for field in vars(samples):
                np.testing.assert_array_equal(getattr(samples, field), getattr(other.observation.sensors[name], field))


def test_samples_do_not_depend_on_other_sensors_and_their_rates():
    alone = fly(load(PERFECT[0].replace("}", ", angle_random_walk_deg_sqrt_h=0.1}")))
    beside = fly(
        load(
            '{type="gyro", name="other", rate_hz=33, angle_random_walk_deg_sqrt_h=0.1}',
            PERFECT[0].replace("}", ", angle_random_walk_deg_sqrt_h=0.1}"),
            PERFECT[3],
        )
    )
    for one, other in zip(alone, beside, strict=True):
        rates = [frame.observation.sensors["gyro"].angular_velocity_rad_s for frame in (one, other)]
        np.testing.assert_array_equal(*rates)
        assert len(other.observation.sensors["other"].time_s) != len(rates[0]) or one.index == 0


def test_frames_alone_have_the_samples_of_a_run(scenario):
    whole = list(rl.simulate(scenario))
    (alone,) = rl.simulate(scenario, frames=[2])
    (worker,) = rl.simulate(scenario, frames=[2], workers=1)
    for frame in (alone, worker):
        for name, samples in whole[2].observation.sensors.items():
            for field in vars(samples):
                np.testing.assert_array_equal(getattr(samples, field), getattr(frame.observation.sensors[name], field))


def test_single_frames_include_the_blinding_before_them():
    """The tracker is in an outage from 0.6 to 0.9 s, and searches for 1 s: the samples of the frame at 2 s begin with it."""
    scenario = load(
        '{type="star_tracker", name="tracker", rate_hz=10, boresight_arcsec=10, acquisition_s=1, '
        "outages=[{from_s=0.6, to_s=0.9}]}"
    )
    whole = [frame.observation.sensors["tracker"] for frame in rl.simulate(scenario)]
    assert np.flatnonzero(np.concatenate([~samples.valid for samples in whole])).tolist() == list(range(6, 19))
    for numbers in ([2], [0, 2], [1, 2]):
        found = [frame.observation.sensors["tracker"] for frame in rl.simulate(scenario, frames=numbers)]
        for samples, number in zip(found, numbers, strict=True):
            for field in vars(samples):
                np.testing.assert_array_equal(getattr(samples, field), getattr(whole[number], field))


def test_perfect_sensors_measure_the_truth():
    """The push shows as 0.01 m/s2 along body +x (along-track) and as 1 N of 100 kg; the body turns with its orbit.

    The thrust is along the stage's axes, and 120 m along the orbit the follower's own are turned by 1.7e-5 rad.
    """
    frames = fly(load(*PERFECT), 0.1)
    first, second = frames[1].observation.sensors, frames[2].observation.sensors
    truth = frames[2].truth
    rate = truth.rates("inertial", "follower")[1]
    np.testing.assert_allclose(second["gyro"].angular_velocity_rad_s, np.tile(rate, (20, 1)), atol=1e-8)
    assert np.linalg.norm(rate) == pytest.approx(1.0948e-3, rel=1e-3)  # of an orbit 550 km up
    np.testing.assert_allclose(first["accelerometer"].specific_force_m_s2, 0.0, atol=1e-12)
    pushed = second["accelerometer"].specific_force_m_s2[second["accelerometer"].time_s > 1.0]
    np.testing.assert_allclose(pushed, np.tile([0.01, 0.0, 0.0], (len(pushed), 1)), atol=2e-7)
    np.testing.assert_allclose(second["valves"].force_n[1:], np.tile([0.0, 1.0, 0.0], (9, 1)), atol=1e-12)
    np.testing.assert_allclose(second["receiver"].position_m[-1], truth.states["follower"].position_m, atol=1e-6)
    np.testing.assert_allclose(second["receiver"].velocity_m_s[-1], truth.states["follower"].velocity_m_s, atol=1e-9)
    exact = truth.poses.link("inertial", "follower").rotation
    turned = Rotation.from_quat(second["tracker"].quaternion_xyzw).inv() * exact
    late_s = frames[2].time_s - second["tracker"].time_s
    np.testing.assert_allclose(turned.as_rotvec(), late_s[:, None] * rate, atol=1e-8)


def drag(_t, x, u):
    """Free flight in rtn axes with thrust u, drag along -y and a push along x that stands for gravitation."""
    return np.concatenate([x[3:], u + np.array([1e-3, -2e-4, 0.0])])


def state_specific_force(_t, _x, u):
    return np.array([0.0, -2e-4, 0.0]) + u


def test_dynamics_may_state_their_specific_force(monkeypatch):
    """The body's x axis is along the track: y in rtn axes. Without a statement only the push by the inputs is measured."""
    scenario = load('{type="accelerometer", name="accelerometer", rate_hz=10}')
    motion = scenario.follower.motion.replace(dynamics=drag)
    scenario = scenario.replace(follower=scenario.follower.replace(motion=motion))

    def measure(specific_force):
        monkeypatch.setattr(drag, "specific_force", specific_force, raising=False)
        return fly(scenario)[-1].observation.sensors["accelerometer"].specific_force_m_s2[-5]

    np.testing.assert_allclose(measure(None), [0.01, 0.0, 0.0], atol=2e-7)
    np.testing.assert_allclose(measure(state_specific_force), [0.0098, 0.0, 0.0], atol=2e-7)
    for wrong, error in (
        (lambda t, x, u: u[:2], r"specific_force: returned the shape \(2,\).*; return three accelerations"),
        (lambda t, x, u: t / 0, r"specific_force: failed at t = .* with ZeroDivisionError"),
        (lambda t, x, u: u * np.nan, r"specific_force: returned \[nan"),
        (3.0, r"specific_force: failed at t = .* TypeError"),
    ):
        with pytest.raises(ScenarioError, match=error):
            measure(wrong)


def tumble(_t, x, u):
    """Free flight in rtn axes with thrust u, and a body of equal moments of inertia, which keeps its rate."""
    qx, qy, qz, qw, wx, wy, wz = x[6:]
    turned = (qw * wx - qz * wy + qy * wz, qz * wx + qw * wy - qx * wz, -qy * wx + qx * wy + qw * wz)
    return np.array([*x[3:6], *u, *(0.5 * rate for rate in turned), -0.5 * (qx * wx + qy * wy + qz * wz), 0, 0, 0])


def test_a_lever_arm_on_a_rigid_body_in_rtn_axes_includes_the_turn_of_the_axes():
    """The angular acceleration is that of the gyro's rate, which includes the 1.1e-3 rad/s of the orbit."""
    scenario = load(
        '{type="gyro", name="gyro", rate_hz=100}',
        '{type="accelerometer", name="origin", rate_hz=100}',
        '{type="accelerometer", name="arm", rate_hz=100, mount={position_m=[0.4, -0.3, 0.5]}}',
    )
    scenario = scenario.replace(follower=scenario.follower.replace(motion=make_tumbling_body(), attitude=None))
    with rl.Simulation(scenario) as simulation:
        simulation.step()
        samples = simulation.step().observation.sensors
    rate, step_s = samples["gyro"].angular_velocity_rad_s, 0.01
    change = (rate[2:] - rate[:-2]) / (2.0 * step_s)
    arm = np.array([0.4, -0.3, 0.5])
    felt = np.cross(change, arm) + np.cross(rate[1:-1], np.cross(rate[1:-1], arm))
    measured = samples["arm"].specific_force_m_s2 - samples["origin"].specific_force_m_s2
    np.testing.assert_allclose(measured[1:-1], felt, atol=1e-8)
    assert np.abs(np.cross(change, arm)).max() > 1e-5  # the body's own rate is constant relative to the axes


def make_tumbling_body():
    """Return the motion of a rigid body that tumbles in the rtn axes of the stage."""
    return rl.motion.StateSpace(
        dynamics=tumble,
        axes="rtn",
        relative_to="stage",
        layout="rigid_body",
        initial_state=(3, -120, -2, 0.02, -0.15, 0.01, 0.5, 0.5, 0.5, 0.5, 0.01, 0.02, -0.03),
        inputs=(0, 0, 0),
    )


def test_sensors_of_a_rigid_body_measure_the_truth():
    """They read its state; the truth goes through the tree of axes. The two agree, also where another sensor samples."""
    scenario = load(*PERFECT[:4], settings=("time.frame_rate_hz=2",))
    scenario = scenario.replace(follower=scenario.follower.replace(motion=make_tumbling_body(), attitude=None))
    push = rl.Command(inputs={"follower": (0.0, 0.01, 0.0)})
    with rl.Simulation(scenario) as simulation:
        simulation.step()
        while not simulation.is_over:
            frame = simulation.step(push, dt_s=0.05)
            samples, truth = simulation.samples, simulation.truth
            link, axes = (truth.poses.link("inertial", name) for name in ("follower", "stage.rtn"))
            for rate in samples["gyro"].angular_velocity_rad_s:
                np.testing.assert_allclose(rate, link.angular_velocity_rad_s, atol=1e-12)
    assert frame.index == 5
    at = frame.observation.sensors["accelerometer"]
    assert len(at.time_s) == 25
    late_s = frame.time_s - at.time_s[-1]  # since then both have turned on: the body, and the axes of the thrust
    back = late_s * axes.angular_velocity_rad_s[2]
    thrust = axes.matrix @ [0.01 * np.sin(back), 0.01 * np.cos(back), 0.0]
    turn = Rotation.from_rotvec(late_s * link.angular_velocity_rad_s)
    felt = turn.apply(link.rotation.inv().apply(thrust))
    np.testing.assert_allclose(at.specific_force_m_s2[-1], felt, atol=1e-8)


def test_a_saved_simulation_goes_on_with_the_same_samples(scenario):
    with rl.Simulation(scenario) as simulation:
        simulation.step()
        simulation.step(dt_s=0.32)
        state = simulation.save()
        one = simulation.step().observation.sensors
        simulation.restore(state)
        other = simulation.step().observation.sensors
        assert simulation.samples.keys() == one.keys()
    for name, samples in one.items():
        for field in vars(samples):
            np.testing.assert_array_equal(getattr(samples, field), getattr(other[name], field))


def test_another_seed_draws_other_samples(scenario):
    one, two = (next(rl.simulate(scenario.replace(seed=seed))).observation.sensors["gyro"] for seed in (1, 2))
    assert np.all(one.angular_velocity_rad_s != two.angular_velocity_rad_s)


@pytest.mark.parametrize(
    ("sensor", "told"),
    [
        ('{type="gyro", name="a", rate_hz=0}', "rate_hz"),
        ('{type="gyro", name="a", rate_hz=1}, {type="gyro", name="a", rate_hz=2}', "two have the name 'a'"),
        ('{type="gyro", name="a", rate_hz=1e5}', "200,000 samples from 0 s to 2 s are more than the 150,000"),
        ('{type="sextant", name="a", rate_hz=1}', "sextant"),
        ('{type="wheels", name="a", rate_hz=1, dynamics="attitude", speed_entries=[0]}', "not of type state_space"),
        ('{type="thrusters", name="a", rate_hz=1, dynamics="motion", force_entries=[5]}', "entry 5"),
        ('{type="relative_gnss", name="a", rate_hz=1, target="stagee", axes="inertial"}', "stagee"),
    ],
)
def test_what_cannot_be_sampled(sensor, told, monkeypatch):
    monkeypatch.setattr(suite, "_MOST_SAMPLES", 150_000)
    with pytest.raises(ScenarioError, match=told):
        list(rl.simulate(load(sensor, settings=("time.frame_rate_hz=0.5",))))


def test_a_scenario_whose_sensors_cannot_be_flown_does_not_load(scenario):
    """The names of users' objects become groups of a recording."""
    with pytest.raises(ScenarioError, match=r"sensor 'a': no target 'stagee'; did you mean 'stage'\?"):
        load('{type="relative_gnss", name="a", rate_hz=1, target="stagee", axes="inertial"}')
    own = SimpleNamespace(name="a/b", rate_hz=1.0, measure=lambda *given: None)
    with pytest.raises(ScenarioError, match="the name 'a/b' needs a letter"):
        scenario.replace(sensor=(own,))
    own.name, own.rate_hz = "a", np.int64(0)
    with pytest.raises(ScenarioError, match=r"sensor 'a': .*rate_hz is 0.*; give a positive rate"):
        scenario.replace(sensor=(own,))
