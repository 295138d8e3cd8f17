"""Light time: where it acts, where it does not, and what is said of it."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import motion
from rso_lidar.errors import ScenarioError
from rso_lidar.motion.light_time import flight_time_s
from rso_lidar.orbit import Epochs
from rso_lidar.pose import length
from rso_lidar.units import SPEED_OF_LIGHT_M_S as C
from tests.physics.light_time_bench import AHEAD_M, START, at_emission, bench, place, with_lidar


class TestWalk:
    def test_frames_without_it_are_unchanged(self):
        """Off, the truth is passed on as it is."""
        scenario = bench((AHEAD_M, 0, 0), (100.0, 0, 0), light_time=False)
        truth = at_emission(scenario)
        assert scenario.apply_light_time(truth) is truth
        assert not rl.World().light_time

    def test_a_scene_at_rest_is_the_same_with_it(self):
        frames = [
            next(rl.simulate(bench((AHEAD_M, 0, 0), (0, 0, 0), light_time=on), keep=("hits",))) for on in (False, True)
        ]
        off, on = (frame.kept["hits"] for frame in frames)
        np.testing.assert_array_equal(off.ray, on.ray)
        np.testing.assert_allclose(off.range_m, on.range_m, rtol=0, atol=1e-9)

    def test_hinges_and_their_body_move_together(self):
        """Each part is met at its own instant: beside its body it moves by less than v d / c (docs/physics.md)."""
        scenario = rl.Scenario.load("examples/safety_ellipse.toml", ("world.light_time=true",))
        body = scenario.target[0].name
        parts = [surface.name for surface in scenario.surfaces if surface.name.startswith(f"{body}.")]
        before = rl.Simulation(scenario).advance().truth
        after = scenario.apply_light_time(before)
        assert len(parts) == 2 and after.poses.parent(body) == "lidar" != before.poses.parent(body)
        speed_m_s = length(before.states[body].velocity_m_s)
        for part in parts:
            first, second = (truth.pose(body, part) for truth in (before, after))
            bound_m = speed_m_s * length(first.translation) / C
            assert length(first.translation) > 0.1 and length(second.translation - first.translation) <= bound_m
            # both turn with the rate of the body for a difference of at most d / c
            assert (first.inv() * second).rotation.magnitude() < 1e-9

    def test_a_batch_is_its_epochs(self):
        scenario = bench(
            (AHEAD_M, 0, 0), (-10_000.0, 300.0, 0), attitude={"type": "spin", "axis": [0, 0, 1], "rate_deg_s": 5}
        )
        course = motion.Course(scenario.bodies, Epochs(START, np.array([0.0, 0.5])), local=True)
        truth = course.during(1, np.array([-0.5, 0.0]))
        truth = with_lidar(truth)
        whole = motion.apply_light_time(truth, ["plate"]).poses.place("lidar", "plate")
        for row in range(2):
            one = motion.apply_light_time(truth.at(row), ["plate"]).poses.place("lidar", "plate")
            for got, expected in zip(one, whole, strict=True):
                np.testing.assert_array_equal(got, expected[row])

    def test_the_lidar_at_the_target(self):
        assert (place(bench((0, 0, 0), (0, 0, 0)))[0] == 0.0).all()


class TestAdvice:
    SETTINGS = ("follower.motion.velocity_m_s=[0, 1200, 0]", "time.duration_s=5", "time.frame_rate_hz=1")

    def test_says_what_to_set(self):
        lines = rl.Scenario.load("examples/tdrs_approach.toml", self.SETTINGS).advice()
        assert any("light time" in line and "set world.light_time = true" in line for line in lines), lines

    def test_is_silent_where_it_is_simulated(self):
        scenario = rl.Scenario.load("examples/tdrs_approach.toml", (*self.SETTINGS, "world.light_time=true"))
        assert not any("light time" in line for line in scenario.advice())
        text = scenario.describe()
        assert "light time 12.0" in text and "mm (simulated)" in text


def test_what_is_not_slower_than_light_is_refused():
    scenario = bench((AHEAD_M, 0, 0), (4e8, 0, 0))
    with pytest.raises(
        ScenarioError, match=r"world\.light_time: 'plate' or the lidar moves at 4e\+08 m/s.*correct its motion"
    ):
        scenario.apply_light_time(at_emission(scenario))


def test_the_root_is_the_positive_one():
    place_m, velocity_m_s = np.array([[1e4, -2e4, 3e4], [0.0, 0.0, 0.0]]), np.array([1e7, 2e7, -3e7])
    tau = flight_time_s(place_m, velocity_m_s)
    assert (tau >= 0.0).all()
    np.testing.assert_allclose(length(place_m + velocity_m_s * tau[:, None]), C * tau, rtol=1e-14)
