"""A scenario flown step by step: the same bits as in one go, and commands between the flashes."""

import dataclasses
import itertools
import pickle
from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from tests.settings_for_tests import limit_pixels

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SMALL = (
    *limit_pixels(16, 1),
    "time.duration_s=4",
)
ACCELERATION_M_S2 = 0.01


@pytest.fixture(scope="module")
def thrusters():
    return rl.Scenario.load(EXAMPLES / "thrusters.toml", settings=SMALL, trust_code=True)


@pytest.fixture(scope="module")
def pointed():
    """A PTU with every error, on a bench, with a pulse train that an exposure follows."""
    settings = (
        *SMALL,
        'ptu={point={type="track", at="plate"}, response={type="second_order", natural_hz=2, damping=0.7}}',
        "ptu.errors={jitter_deg=0.01, misalignment_deg=[0.1, -0.2], encoder_noise_deg=0.01, command_latency_s=0.03}",
        "target.0.motion.position_m=[100, 3, 0]",
        'target.0.attitude={type="spin", axis=[0, 0, 1], rate_deg_s=40}',
        "lidar.laser.pulse_rate_hz=100",
        'lidar.detector={type="gsfl", gate={delay_ns=620, width_ns=96, pulses=4}}',
        "time.frame_rate_hz=2",
    )
    return rl.Scenario.load(EXAMPLES / "bench_plate.toml", settings=settings)


def same(a, b):
    """Assert that two frames have the same bits."""
    assert a.index == b.index
    assert a.source.seed == b.source.seed
    np.testing.assert_array_equal(a.range_m, b.range_m)
    np.testing.assert_array_equal(a.intensity_counts, b.intensity_counts)
    np.testing.assert_array_equal(a.labels.photons, b.labels.photons)
    for one in a.truth.poses:
        np.testing.assert_array_equal(
            a.truth.pose("inertial", one).as_matrix(), b.truth.pose("inertial", one).as_matrix()
        )
    if a.observation.pan_tilt_rad is not None:
        np.testing.assert_array_equal(a.observation.pan_tilt_rad, b.observation.pan_tilt_rad)


def steer(observation):
    """Command angles and, at odd frames, a thrust, both worked out from what is seen."""
    seen = int(np.isfinite(observation.reading.range_m).sum())
    return rl.Command(pan_rad=0.01 * np.sin(observation.time_s) + 1e-5 * seen)


def push(observation):
    """Command a thrust that depends on what is seen."""
    seen = int(np.isfinite(observation.reading.range_m).sum())
    return rl.Command(inputs={"follower": (0.0, 1e-3 * (observation.time_s % 3), 1e-5 * seen)})


@pytest.mark.parametrize(("name", "controller"), [("thrusters", push), ("pointed", steer)])
def test_steps_make_the_frames_of_a_run(name, controller, request):
    """Bit for bit: in one go, step by step, with steps of 10 ms in between, and from a state saved half-way."""
    scenario = request.getfixturevalue(name)
    frames = list(rl.simulate(scenario, controller))
    assert len(frames) >= 4
    with rl.Simulation(scenario) as simulation:
        stepped = [simulation.step()]
        while not simulation.is_over:
            stepped.append(simulation.step(controller(simulation.observation)))
        simulation.reset()
        fine, state = [simulation.step()], b""
        command = controller(fine[0].observation)
        while not simulation.is_over:
            if (frame := simulation.step(command, dt_s=0.01)) is not None:
                fine.append(frame)
                command = controller(frame.observation)
                if frame.index == 1:
                    state = pickle.dumps(simulation.save())
        assert len(stepped) == len(fine) == len(frames)
        for one, two in zip(frames, stepped, strict=True):
            same(one, two)
    for one, two in zip(frames, fine, strict=True):
        same(one, two)
    with rl.Simulation(scenario) as other:
        other.restore(pickle.loads(state))
        assert other.observation.time_s == fine[1].time_s
        command = controller(other.observation)
        again = []
        while not other.is_over:
            if (frame := other.step(command, dt_s=0.01)) is not None:
                again.append(frame)
                command = controller(frame.observation)
        for one, two in zip(fine[2:], again, strict=True):
            same(one, two)


class Fast:
    """A controller that keeps the instants of its calls, and commands a ramp of 0.1 rad/s."""

    def __init__(self):
        self.flashes, self.between = [], []

    def __call__(self, observation):
        self.flashes.append(observation.time_s)
        return rl.Command(pan_rad=0.1 * observation.time_s)

    def command_at(self, time_s, samples):
        self.between.append(time_s)
        assert 0 < len(samples["imu"].time_s) <= 4
        return rl.Command(pan_rad=0.1 * time_s)


def test_a_fast_controller_commands_between_the_flashes(pointed):
    scenario = pointed.replace(sensor=[{"name": "imu", "type": "gyro", "rate_hz": 40.0}])
    controller = Fast()
    frames = list(itertools.islice(rl.simulate(scenario, controller, threads=1, command_rate_hz=10), 3))
    assert controller.flashes == [frame.time_s for frame in frames[:2]]  # the third has not been answered yet
    grid_s = 0.1 * np.arange(1, round(10 * frames[-1].time_s) + 1)
    flashes_s = np.array([frame.time_s for frame in frames])
    assert controller.between == pytest.approx(grid_s[np.abs(grid_s[:, None] - flashes_s).min(axis=1) > 1e-6], abs=1e-9)
    simulation, pan_rad = rl.Simulation(scenario, threads=1), None
    for frame in frames:  # a command acts from its instant until the next
        for time_s in [t for t in controller.between if simulation.time_s < t < frame.time_s]:
            simulation.step(rl.Command(pan_rad=pan_rad), dt_s=time_s - simulation.time_s)
            pan_rad = 0.1 * time_s
        same(frame, simulation.step(rl.Command(pan_rad=pan_rad)))
        pan_rad = 0.1 * frame.time_s
    for rate_hz, by, error in (
        (0.0, controller, "give Hz from 1e-6 to 1e6"),
        (10, steer, r"has no method command_at\(time_s, samples\); add it"),
        (10, None, "has no method command_at"),
    ):
        with pytest.raises(ScenarioError, match=error):
            rl.simulate(pointed, by, command_rate_hz=rate_hz)


def test_reset_flies_again_with_another_seed(pointed):
    with rl.Simulation(pointed) as simulation:
        first = simulation.step()
        simulation.step(rl.Command(pan_rad=0.3))
        simulation.reset()
        assert simulation.time_s == 0.0
        assert simulation.observation is None
        same(simulation.step(), first)
        simulation.reset(seed=99)
        same(simulation.step(), next(rl.simulate(pointed.replace(seed=99))))


def test_thrust_between_flashes_moves_the_follower_as_newton_says(thrusters):
    """In half a second of thrust, then as long against it: a^2 t^2 along the way, and no velocity left.

    Gravity in rtn axes moves it by less than 2 n v t^2 = 2 * 0.0011 * 0.005 m: a tenth of a millimetre in 1 s.
    """
    with rl.Simulation(thrusters) as simulation:
        simulation.step(dt_s=1e-6)
        coasting = list(rl.simulate(thrusters))
        for thrust in (ACCELERATION_M_S2, -ACCELERATION_M_S2):
            for _ in range(50):
                frame = simulation.step(rl.Command(inputs={"follower": (0.0, thrust, 0.0)}), dt_s=0.01)
                moved = simulation.truth.rates("stage.rtn", "follower")[0]
        assert simulation.time_s == pytest.approx(1.000001, abs=1e-9)
        assert frame is not None
        place = frame.truth.pose("stage.rtn", "follower").translation
        free = coasting[1].truth.pose("stage.rtn", "follower").translation
        free_m_s = coasting[1].truth.rates("stage.rtn", "follower")[0]
    np.testing.assert_allclose(place - free, [0.0, ACCELERATION_M_S2 * 0.5**2, 0.0], atol=2e-5)
    np.testing.assert_allclose(moved - free_m_s, 0.0, atol=2e-5)


def test_the_truth_between_flashes_is_that_of_the_instant(pointed):
    """The plate turns by 40 deg/s, and the PTU stands where its drive is, with misalignment but without jitter."""
    with rl.Simulation(pointed) as simulation:
        before = simulation.step()
        assert simulation.time_s == before.time_s and simulation.truth is before.truth
        start_s = simulation.time_s
        simulation.step(dt_s=0.1)
        turned = (
            simulation.truth.pose("inertial", "plate").rotation * before.truth.pose("inertial", "plate").rotation.inv()
        )
        assert simulation.time_s == pytest.approx(start_s + 0.1, abs=1e-9)
        assert turned.magnitude() == pytest.approx(np.radians(4.0), abs=1e-9)
        assert simulation.next_flash_s == pytest.approx(0.5 + before.time_s)


@pytest.mark.parametrize("dt_s", [0.0, -1.0, np.nan, np.inf, True, "1", 2.5])
def test_a_step_of_an_impossible_length(thrusters, dt_s):
    with rl.Simulation(thrusters) as simulation:
        with pytest.raises(ScenarioError, match=r"^dt_s: "):
            simulation.step(dt_s=dt_s)
        assert simulation.time_s == 0.0


def test_what_cannot_be_done_changes_nothing(thrusters):
    with rl.Simulation(thrusters) as simulation:
        simulation.step()
        state = simulation.save()
        for command, told in (
            ("left", "is not a command"),
            (rl.Command(pan_rad=0.1), "the scenario has none"),
            (rl.Command(inputs=(1.0, 0.0, 0.0)), "give a dictionary"),
            (rl.Command(inputs={3: (1.0,)}), "'3', which has no state-space model"),
            (rl.Command(inputs={"stage": (1.0,)}), "'stage', which has no state-space model"),
            (rl.Command(inputs={"follower": (1.0,)}), "give 3 finite numbers"),
            (rl.Command(inputs={"follower": (np.nan, 0.0, 0.0)}), "give 3 finite numbers"),
            (rl.Command(inputs={"follower": (1e-3, 0.0, 0.0)}, energy_j=-1.0), "energy"),
        ):
            for give in (simulation.check_command, simulation.step):
                with pytest.raises(ScenarioError, match=told):
                    give(command)
            assert simulation.time_s == 0.0
        simulation.check_command(rl.Command(inputs={"follower": (1.0, 0.0, 0.0)}))
        with pytest.raises(ScenarioError, match="restore: "):
            simulation.restore("here")
        for damage in (
            {"row": 99},
            {"row": -1},
            {"time_ns": "a"},
            {"measured_s": np.nan},
            {"course": None},
            {"aim": None},
        ):
            with pytest.raises(ScenarioError, match=r"^restore: the state's "):
                simulation.restore(dataclasses.replace(state, **damage))
        frame = simulation.step()
        simulation.restore(state)
        same(simulation.step(), frame)
        while not simulation.is_over:
            simulation.step()
        with pytest.raises(ScenarioError, match="call reset"):
            simulation.step()
        simulation.close()
        with pytest.raises(ScenarioError, match="is closed"):
            simulation.step()
    with pytest.raises(ScenarioError, match=r"^frames: "):
        rl.Simulation(thrusters, frames=[1])
    with (
        rl.Simulation(thrusters, frames=[2], commanded=False) as simulation,
        pytest.raises(ScenarioError, match="commanded=False"),
    ):
        simulation.step(rl.Command())


def test_a_state_of_a_changed_scenario(thrusters):
    faster = thrusters.replace(time=thrusters.time.replace(frame_rate_hz=2.0))
    with (
        rl.Simulation(thrusters) as one,
        rl.Simulation(faster) as two,
        rl.Simulation(thrusters.replace(seed=5)) as same,
    ):
        one.step()
        with pytest.raises(ScenarioError, match="another scenario"):
            two.restore(one.save())
        assert (two.time_s, two.observation) == (0.0, None)
        same.restore(one.save())
        assert same.scenario.seed == thrusters.seed
        with pytest.raises(ScenarioError, match=r"^seed: "):
            one.reset("seven")
        one.reset(np.int64(7))
        assert one.step().source.seed == 7


def test_a_state_of_another_scenario(thrusters, pointed):
    with (
        rl.Simulation(thrusters) as one,
        rl.Simulation(pointed) as two,
        pytest.raises(ScenarioError, match=r"^restore: "),
    ):
        two.restore(one.save())
