"""Environments of Gymnasium: their interface, rewards by hand, episodes that repeat, and no growth of memory."""

import importlib.util
import math
import os
from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from tests.settings_for_tests import limit_pixels

gymnasium = pytest.importorskip("gymnasium", reason="the extra `gym` is not installed")

from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402

from rso_lidar.loop.environments import (  # noqa: E402
    Approach,
    LidarVectorEnvironment,
    PointAndTrack,
    draw_approach,
    draw_pass,
)

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
NAMES = ("rso_lidar/PointAndTrack-v0", "rso_lidar/Approach-v0")
TINY = limit_pixels(16)


@pytest.fixture(scope="module")
def passage():
    return rl.Scenario.load(EXAMPLES / "closed_loop.toml", settings=(*TINY, "time.duration_s=10"))


@pytest.fixture(scope="module")
def thrusters():
    return rl.Scenario.load(EXAMPLES / "thrusters.toml", settings=(*TINY, "time.duration_s=10"), trust_code=True)


@pytest.fixture(scope="module")
def hold():
    spec = importlib.util.spec_from_file_location("thrusters_for_tests", EXAMPLES / "thrusters.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Hold


def fly(env, seed, action, most=None):
    """Return observations, rewards and ends of an episode, or of its first rows, under constant or computed actions."""
    observation, _ = env.reset(seed=seed)
    rows, is_over = [(observation, 0.0, False, False)], False
    while not is_over and (most is None or len(rows) < most):
        observation, reward, terminated, truncated, _ = env.step(action(env) if callable(action) else action)
        rows.append((observation, reward, terminated, truncated))
        is_over = terminated or truncated
    return rows


def target_pixels(env, seed):
    """Return the numbers of pixels on the target, flash by flash, without commands."""
    _, info = env.reset(seed=seed)
    pixels, is_over = [info["target_pixels"]], False
    while not is_over:
        *_, is_over, _, info = env.step(np.zeros(2))
        pixels.append(info["target_pixels"])
    return pixels


@pytest.mark.parametrize("name", NAMES)
def test_gymnasium_finds_nothing_to_warn_of(name):
    env = gymnasium.make(name, render_mode="rgb_array").unwrapped
    check_env(env)  # warnings are errors here
    assert env.metadata["render_modes"] == ["rgb_array"] and env.spec.id == name


def test_absence_is_zero_under_a_mask(passage):
    env = PointAndTrack(passage)
    observation, info = env.reset(seed=4)
    reading = env.simulation.observation.reading
    seen = np.isfinite(reading.range_m)
    assert 5 < seen.sum() < seen.size and info["target_pixels"] > 5
    assert np.array_equal(observation["valid"] == 1, seen)
    assert np.array_equal(observation["range_m"], np.where(seen, reading.range_m, 0.0))
    assert np.array_equal(observation["intensity_counts"], reading.intensity_counts)
    assert observation in env.observation_space
    assert env.observation_space["range_m"].high.max() == 2000.0  # armed_to_m
    assert env.observation_space["intensity_counts"].high.max() == 4095.0  # 12 bits


@pytest.mark.parametrize("make", [PointAndTrack, Approach])
def test_a_seed_repeats_an_episode_bit_for_bit(make):
    env, other = make(), make()
    actions = np.full(env.action_space.shape, 0.1)
    runs = [fly(flown, seed, actions, most=4) for flown, seed in ((env, 5), (other, 5), (env, 6))]
    first, again, different = ([row[0] for row in run] for run in runs)
    for one, two in zip(first, again, strict=True):
        assert all(one[name].tobytes() == two[name].tobytes() for name in one)
    assert runs[0][1][1] == runs[1][1][1]
    assert not np.array_equal(first[0]["range_m"], different[0]["range_m"])


def test_episodes_after_the_first_differ(passage):
    env = PointAndTrack(passage)
    first, _ = env.reset(seed=1)
    pose = env.simulation.truth.pose("lidar", "stage").translation
    second, _ = env.reset()
    assert not np.array_equal(first["range_m"], second["range_m"])  # other noise
    later = env.simulation.truth.pose("lidar", "stage").translation
    assert np.allclose(pose, later, atol=0.5)  # the same scenario: only jitter differs


def test_reward_of_pointing(passage):
    env = PointAndTrack(passage)
    env.reset(seed=1)
    action = np.array([0.02, -0.01])
    _, reward, *_, info = env.step(action)
    x, y, z = env.simulation.truth.pose("lidar", "stage").translation
    angle = math.acos(z / math.sqrt(x * x + y * y + z * z))
    assert info["off_boresight_rad"] == pytest.approx(angle, abs=1e-9)
    expected = 1.0 - angle / math.radians(1.5) - 0.01 * (0.02**2 + 0.01**2) / 2
    assert 0.2 < reward < 0.999 and reward == pytest.approx(expected, abs=1e-9)


def test_a_rate_is_a_ramp_and_an_angle_a_step(passage):
    """A drive of 2 Hz that follows a ramp of 2 deg/s moves at that rate; after a step it has come to rest."""
    slow = passage.replace(ptu=passage.ptu.replace(errors=rl.PointingErrors()))
    env = PointAndTrack(slow, max_rate_deg_s=4.0, substeps=50, lost_after_s=100.0)
    env.reset(seed=1)
    for _ in range(6):
        env.step(np.array([0.5, -0.25]))
    pointing = env.simulation.truth.pointing
    assert np.degrees(pointing.demand_rad) == pytest.approx([45.0 + 6 * 0.5 * 2.0, -6 * 0.5], abs=1e-9)
    assert np.degrees(pointing.rate_rad_s) == pytest.approx([2.0, -1.0], abs=0.1)
    env = PointAndTrack(slow, action="angle", lost_after_s=100.0)
    env.reset(seed=1)
    for _ in range(6):
        env.step(np.array([40.0 / 180.0, 2.0 / 180.0]))
    pointing = env.simulation.truth.pointing
    assert np.degrees(pointing.actual_rad) == pytest.approx([40.0, 2.0], abs=0.01)
    assert np.degrees(pointing.rate_rad_s) == pytest.approx([0.0, 0.0], abs=0.01)


def test_angles_keep_to_the_travel_and_wrap_without_it(passage):
    response = passage.ptu.response.replace(tilt_limits_deg=(-10.0, 30.0))
    env = PointAndTrack(passage.replace(ptu=passage.ptu.replace(response=response)), action="angle", lost_after_s=100.0)
    space = env.observation_space["pan_tilt_rad"]
    assert np.degrees(space.low) == pytest.approx([-180.0, -10.0], abs=1e-4)
    assert np.degrees(space.high) == pytest.approx([180.0, 30.0], abs=1e-4)
    env.reset(seed=1)
    env.step(np.array([1.0, 1.0]))
    assert np.degrees(env.simulation.truth.pointing.demand_rad) == pytest.approx([180.0, 30.0])
    observation, *_ = env.step(np.array([-170.0 / 180.0, -1.0]))  # by the shortest way, past 180 deg
    assert np.degrees(env.simulation.truth.pointing.demand_rad) == pytest.approx([190.0, -10.0])
    assert np.degrees(observation["demand_rad"]) == pytest.approx([-170.0, -10.0], abs=1e-4)


@pytest.mark.parametrize("kind", ["rate", "angle"])
def test_commands_of_a_controller_become_actions(passage, kind):
    env = PointAndTrack(passage, action=kind)
    env.reset(seed=1)
    assert np.allclose(
        env.to_action(rl.Command(pan_rad=10.0, tilt_rad=0.0)), [1.0 if kind == "rate" else -0.8169, 0.0], atol=1e-3
    )
    command = rl.Command(pan_rad=math.radians(45.3), tilt_rad=None)
    env.step(env.to_action(command))
    demand = env.simulation.truth.pointing.demand_rad
    assert np.degrees(demand) == pytest.approx([45.3, 0.0], abs=1e-4)
    env.step(env.to_action(None))
    assert np.array_equal(env.simulation.truth.pointing.demand_rad.round(6), demand.round(6))


def test_the_reference_controller_tracks_and_an_idle_one_loses_the_stage():
    env = PointAndTrack()
    point = rl.track.Pointing(gate_m=20.0, lead_s=0.16)
    tracked = fly(env, 3, lambda env: env.to_action(point(env.simulation.observation)))
    assert len(tracked) == 120 and sum(row[1] for row in tracked) > 110.0
    assert tracked[-1][2:] == (False, True)  # truncated at the last flash, and not before
    lost = fly(env, 3, np.zeros(2))
    assert lost[-1][2:] == (True, False) and len(lost) < 60
    masks = target_pixels(env, 3)
    assert masks[-1] == 0 and masks[-6] > 0 and not any(masks[-5:])  # 2 s are four flashes: the fifth is too late


def test_the_reference_controller_comes_closer_and_an_idle_one_does_not(thrusters, hold):
    receiver = thrusters.lidar.receiver.replace(n_rows=32, n_cols=32)
    longer = thrusters.replace(
        lidar=thrusters.lidar.replace(receiver=receiver), time=thrusters.time.replace(duration_s=60)
    )
    env, controller = Approach(longer), hold()
    idle = fly(env, 2, np.zeros(3))
    held = fly(env, 2, lambda env: env.to_action(controller(env.simulation.observation)))
    assert len(held) == len(idle) == 60
    assert sum(row[1] for row in held) > 1.5 * sum(row[1] for row in idle)
    assert held[-1][0]["acceleration_m_s2"] == pytest.approx(env.to_action(None) * 0.02, rel=1e-5)


def test_reward_of_an_approach(thrusters):
    env = Approach(thrusters)
    _, info = env.reset(seed=1)
    assert info["distance_m"] == pytest.approx(math.sqrt(3**2 + 40**2 + 2**2))  # the initial state, from (0, -80, 0)
    action = np.array([0.5, -1.0, 0.0])
    _, reward, terminated, _, info = env.step(action)
    place = env.simulation.truth.pose("stage.rtn", "follower").translation
    expected = math.exp(-math.dist(place, (0.0, -80.0, 0.0)) / 20.0) - (0.01 + 0.02) * 1.0 / 1.0
    assert reward == pytest.approx(expected, abs=1e-12) and not terminated
    # CW over 1 s: x0 + v0 + a/2, to the small terms of orbital motion
    assert place == pytest.approx([3 + 0.02 + 0.005, -120 - 0.15 - 0.01, -2 + 0.01], abs=1e-3)


@pytest.mark.parametrize(("limits", "costs"), [({"keep_out_m": 121.0}, 10.0), ({"farthest_m": 120.0}, 0.0)])
def test_ends_of_an_approach(thrusters, limits, costs):
    *_, last = fly(Approach(thrusters, **limits), 1, np.array([0.0, 1.0, 0.0]) if costs else np.zeros(3))
    _, reward, terminated, _ = last
    assert terminated
    assert reward == pytest.approx((0.13 - 0.02 - 10.0) if costs else 0.13, abs=0.02)


def test_drawn_beginnings_are_within_what_the_page_says(passage, thrusters):
    rng = np.random.default_rng(3)
    for _ in range(40):
        drawn = draw_pass(passage, rng)
        position, velocity = np.array(drawn.follower.motion.position_m), np.array(drawn.follower.motion.velocity_m_s)
        distance = np.linalg.norm(position)
        along = velocity @ position / distance
        assert 300.0 <= distance <= 500.0 and abs(along) <= 0.5
        assert 1.0 <= np.linalg.norm(velocity - along * position / distance) <= 3.0
        with rl.Simulation(drawn, threads=1) as simulation:
            x, y, z = simulation.truth.pose("lidar", "stage").translation
        assert max(abs(math.degrees(math.atan2(x, z))), abs(math.degrees(math.atan2(y, z)))) < 0.25 * 3.0 * 1.05
        state = draw_approach(thrusters, rng).follower.motion.initial_state
        assert np.all(np.abs(np.array(state) - [0, -120, 0, 0, 0, 0]) <= [5, 20, 5, 0.03, 0.15, 0.03])


@pytest.mark.slow
def test_vector_environments_name_their_autoreset_mode():
    envs = gymnasium.make_vec(NAMES[0], num_envs=2, vectorization_mode="sync")
    observations, _ = envs.reset(seed=[7, 8])
    assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert not np.array_equal(observations["range_m"][0], observations["range_m"][1])
    alone, _ = PointAndTrack().reset(seed=7)
    assert np.array_equal(observations["range_m"][0], alone["range_m"])
    envs = gymnasium.make_vec(NAMES[0], num_envs=1, vectorization_mode="async", vector_kwargs={"context": "spawn"})
    try:
        observations, _ = envs.reset(seed=[7])
        assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
        assert np.array_equal(observations["range_m"][0], alone["range_m"])  # in another process, too
        envs.step(envs.action_space.sample())
    finally:
        envs.close()


def test_environments_that_share_a_process_have_the_bits_of_each_alone(passage):
    """Three steps of two environments, of which one is lost and begins again: NEXT_STEP is Gymnasium's word for that."""
    envs = LidarVectorEnvironment(PointAndTrack, 2, threads=2, scenario=passage, lost_after_s=0.1, action="angle")
    alone = [PointAndTrack(passage, lost_after_s=0.1, action="angle") for _ in range(2)]
    away = np.array([[0.0, 0.0], [0.25, 0.0]], dtype=np.float32)  # the first looks away, and has lost the stage
    observations, _ = envs.reset(seed=[3, 4])
    expected = [env.reset(seed=seed)[0] for env, seed in zip(alone, (3, 4), strict=True)]
    ended = [False, False]
    for _ in range(3):
        for name in ("range_m", "valid", "pan_tilt_rad"):
            np.testing.assert_array_equal(observations[name], np.stack([one[name] for one in expected]))
        observations, rewards, terminated, truncated, infos = envs.step(away)
        rows = []
        for env, action, is_over in zip(alone, away, ended, strict=True):
            rows.append((*env.reset(), 0.0, False, False) if is_over else env.step(action))
        expected = [row[0] for row in rows]
        kept = [(row[2], row[3], row[4]) if is_over else row[1:4] for row, is_over in zip(rows, ended, strict=True)]
        assert list(zip(rewards.tolist(), terminated.tolist(), truncated.tolist(), strict=True)) == kept
        assert infos["time_s"].tolist() == [env.simulation.time_s for env in alone]
        ended = [bool(row[1]) for row in kept]
    assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert envs.envs[0].scenario is envs.envs[1].scenario
    envs.close()
    with pytest.raises(ScenarioError, match="num_envs: 0 is no number of num_envs; give a whole number from 1"):
        LidarVectorEnvironment(PointAndTrack, 0)
    envs = gymnasium.make_vec(NAMES[0], num_envs=2, scenario=passage, threads=1)
    assert isinstance(envs, LidarVectorEnvironment) and envs.num_envs == 2
    envs.close()


def test_observations_can_be_flattened_and_scaled():
    env = gymnasium.make(NAMES[1])
    scaled = gymnasium.wrappers.RescaleObservation(
        gymnasium.wrappers.FlattenObservation(env), np.float32(0), np.float32(1)
    )
    observation, _ = scaled.reset(seed=1)
    assert observation.shape == (3 * 32 * 32 + 3,) and observation.min() >= 0.0 and observation.max() == 1.0


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="resident memory is read from /proc")
def test_memory_does_not_grow(passage):
    """A leak of one frame in a step would be 5 MiB, one of a simulation in an episode as much."""
    env = PointAndTrack(passage, draw_pass)

    def fly_episodes(count):
        for seed in range(count):
            env.reset(seed=seed)
            for _ in range(4):
                env.step(env.action_space.sample())
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20

    env.action_space.seed(1)
    before = fly_episodes(20)
    assert fly_episodes(50) - before < 3.0


def test_a_picture_of_the_range(passage):
    env = PointAndTrack(passage, render_mode="rgb_array")
    with pytest.raises(ScenarioError, match="before reset"):
        env.render()
    env.reset(seed=1)
    image = env.render()
    assert image.shape == (256, 256, 3) and image.dtype == np.uint8
    empty = (image[8::16, 8::16] == 255).all(axis=-1)
    assert np.array_equal(empty, np.isnan(env.simulation.observation.reading.range_m))
    assert PointAndTrack(passage).render() is None


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"action": "torque"}, "action: 'torque' is unknown"),
        ({"substeps": 0}, "substeps: 0 is no number"),
        ({"max_rate_deg_s": -1.0}, "max_rate_deg_s: -1.0 is no rate"),
        ({"max_rate_deg_s": math.nan}, "max_rate_deg_s: nan is no rate"),
        ({"target": "stag"}, "no target is named 'stag'; did you mean 'stage'"),
        ({"lost_after_s": 0.0}, "lost_after_s: 0.0 is not a time"),
        ({"render_mode": "human"}, "render_mode: 'human' is unknown"),
        ({"scenario": "nothing.toml"}, "nothing.toml"),
    ],
)
def test_bad_settings_of_pointing(passage, settings, told):
    with pytest.raises(ScenarioError, match=told):
        PointAndTrack(**({"scenario": passage} | settings))


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"goal_m": (0.0, 1.0)}, "goal_m: .* is no position"),
        ({"goal_m": (0.0, math.inf, 0.0)}, "goal_m: .* is no position"),
        ({"max_acceleration_m_s2": 0.0}, "max_acceleration_m_s2: 0.0 is no acceleration"),
        ({"keep_out_m": 400.0}, "leave no room"),
    ],
)
def test_bad_settings_of_an_approach(thrusters, settings, told):
    with pytest.raises(ScenarioError, match=told):
        Approach(thrusters, **settings)


def test_scenarios_that_an_environment_cannot_fly(passage, thrusters):
    for make, scenario, told in (
        (PointAndTrack, thrusters, "has no PTU"),
        (Approach, passage, "no inputs"),
        (PointAndTrack, passage.replace(time=passage.time.replace(duration_s=0.5)), "one flash"),
    ):
        with pytest.raises(ScenarioError, match=told):
            make(scenario)
    turned = thrusters.replace(ptu=passage.ptu)
    for draw, scenario, told in (
        (draw_pass, thrusters, "no PTU"),
        (draw_pass, turned, "motion: has no position_m"),
        (draw_approach, passage, "motion: has no initial_state"),
    ):
        with pytest.raises(ScenarioError, match=told):
            draw(scenario, np.random.default_rng(1))


def test_misuse_of_an_episode(passage):
    env = PointAndTrack(passage)
    with pytest.raises(ScenarioError, match="call reset"):
        env.step(np.zeros(2))
    for options in ({"wind": 1}, 3, 0, ["wind"], "wind"):
        with pytest.raises(ScenarioError, match=r"options: .* is given, and no options are known"):
            env.reset(options=options)
    env.reset(options={})
    env.reset(seed=1)
    for action in (np.zeros(3), np.array([0.0, math.nan]), 0.5, "left", np.zeros(2, complex)):
        with pytest.raises(ScenarioError, match="is not an action; give 2 numbers"):
            env.step(action)
    while not env.step(np.zeros(2))[3]:
        pass
    with pytest.raises(ScenarioError, match="call reset"):
        env.step(np.zeros(2))
