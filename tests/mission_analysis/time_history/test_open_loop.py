from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import motion
from rso_lidar.mission_analysis import fly_open_loop
from rso_lidar.mission_analysis.time_history.open_loop import (
    find_mission_plan,
    find_umbras,
    sample_between_impulses,
    tabulate_run,
)
from rso_lidar.orbit import write_oem
from rso_lidar.scenario import preview_mission
from rso_lidar.scenario.assessment.environment import describe_environment

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"


@pytest.fixture
def bench(text):
    return rl.Scenario.loads(text)


def test_it_is_the_truth_that_the_frames_carry(bench):
    truth, angles = fly_open_loop(bench)
    for k, frame in enumerate(rl.simulate(bench)):
        np.testing.assert_array_equal(truth.time_s[k], frame.time_s)
        np.testing.assert_array_equal(angles[k].actual_rad, frame.truth.pointing.actual_rad)
        np.testing.assert_array_equal(angles[k].measured_rad, frame.truth.pointing.measured_rad)
        ours, theirs = (place.pose("lidar", "plate").as_matrix() for place in (truth, frame.truth))
        np.testing.assert_allclose(ours[k], theirs, rtol=0, atol=1e-12 * 1e3)  # rounding at 1 km


def test_chosen_frames_are_those_of_the_whole_run(bench):
    whole, all_angles = fly_open_loop(bench)
    some, angles = fly_open_loop(bench, [2, 5, 9])
    np.testing.assert_array_equal(some.time_s, whole.time_s[[2, 5, 9]])
    for k, angle in zip([2, 5, 9], angles, strict=True):
        np.testing.assert_array_equal(angle.actual_rad, all_angles[k].actual_rad)


def test_without_the_drive_the_lidar_stands_on_its_demand(bench):
    truth, angles = fly_open_loop(bench, drive=False)
    assert angles == ()
    line = truth.pose("lidar", "plate").translation
    np.testing.assert_allclose(line, np.broadcast_to([0.0, 0.0, 1000.0], line.shape), atol=1e-9)


def test_columns_of_an_orbit():
    scenario = rl.Scenario.load(EXAMPLES / "tle_flyby.toml")
    truth, angles = fly_open_loop(scenario, slice(None, None, 30))
    table = tabulate_run(scenario, truth, angles)
    assert all(len(values) == 6 for values in table.values())
    assert table["utc"][1] == "2024-09-17T11:59:00.000000Z"
    apart = [table[f"stage_position_{axis}_m"] - table[f"follower_position_{axis}_m"] for axis in "xyz"]
    np.testing.assert_allclose(
        table["stage_range_m"], np.linalg.norm(apart, axis=0), atol=1e-6
    )  # the lidar has no mount
    quaternion = np.stack([table[f"lidar_from_stage_quaternion_{axis}"] for axis in "xyzw"])
    np.testing.assert_allclose(np.sum(quaternion**2, axis=0), 1.0, atol=1e-14)
    assert table["stage_range_m"].argmin() == 3  # the closest approach is 90 s into the run, by the file's comment
    assert {"pan_demand_rad", "tilt_rate_rad_s", "sun_direction_z", "stage_sunlit_fraction"} <= set(table)
    units = ("_s", "_m", "_m_s", "_rad", "_rad_s", "_fraction", "utc")
    unitless = ("sun_direction", "quaternion")
    assert all(name.endswith(units) or any(word in name for word in unitless) for name in table)


def test_a_world_without_a_sun_has_no_columns_of_it(bench):
    truth, angles = fly_open_loop(bench)
    assert not [name for name in tabulate_run(bench, truth, angles) if "sun" in name or "phase" in name]


def test_a_motion_without_a_plan_has_no_impulses(bench):
    assert find_mission_plan(bench, "plate") is None
    assert find_mission_plan(bench, None) is None


def test_the_plan_of_a_run_is_that_of_its_motion():
    hop = {"type": "hop", "relative_to": "stage", "from_m": [0, -400, 0], "to_m": [0, -100, 0], "duration_s": 200.0}
    scenario = rl.Scenario.load(EXAMPLES / "closed_loop.toml")
    text = scenario.model_dump(exclude_unset=True)
    text["follower"]["motion"] = {**hop, "keep_out_m": 50.0}
    plan = find_mission_plan(rl.Scenario.model_validate(text), "stage")
    assert [one.time_s for one in plan.impulses] == [0.0, 200.0]


def test_a_plan_about_what_moves_about_something_else():
    """The chief of the chief is found: a hop about a body that is itself flown by Clohessy-Wiltshire."""
    text = rl.Scenario.load(EXAMPLES / "closed_loop.toml").model_dump(exclude_unset=True)
    stage = text["target"][0]
    host = {**stage, "name": "host"}
    beside = {"type": "hill", "relative_to": "host", "position_m": [0, 500, 0], "velocity_m_s": [0, 0, 0]}
    text["target"] = [host, {**stage, "motion": beside}]
    hop = {"type": "hop", "relative_to": "stage", "from_m": [0, -400, 0], "to_m": [0, -100, 0], "duration_s": 200.0}
    text["follower"]["motion"] = hop
    assert len(find_mission_plan(rl.Scenario.model_validate(text), "stage").impulses) == 2


def test_umbras_are_those_of_check():
    scenario = rl.Scenario.load(EXAMPLES / "safety_ellipse.toml")
    ((begins_s, ends_s),) = find_umbras(scenario)["tdrs"]
    told = next(line for line in describe_environment(scenario, preview_mission(scenario)) if "eclipse" in line)
    assert f"umbra from {begins_s:.3f} s to {ends_s:.3f} s" in told
    assert find_umbras(rl.Scenario.load(EXAMPLES / "bench_plate.toml")) == {}


def test_an_oem_of_a_run_with_impulses_is_flown_again(tmp_path):
    """A teardrop's impulses are edges of segments: read back between rows a minute apart, it is where it was.

    Degree 7 at even steps of 60 s in low orbit is good to a micrometre (tests/orbit/test_oem.py), at the uneven ones beside
    an impulse to some millimetres; across an impulse it would be off by metres.
    """
    text = rl.Scenario.load(EXAMPLES / "closed_loop.toml").model_dump(exclude_unset=True)
    text["time"]["duration_s"] = 4000
    drop = {"type": "teardrop", "relative_to": "stage", "cusp_m": 400.0, "turn_m": 100.0, "loops": 3}
    text["follower"]["motion"] = drop
    scenario = rl.Scenario.model_validate(text)
    epochs, states, breaks_s = sample_between_impulses(scenario, "follower", np.arange(0.0, 4000.0, 60.0))
    assert breaks_s
    file = write_oem(tmp_path / "drop.oem", "follower", "follower", epochs, states, breaks_s=breaks_s)
    assert file.read_text().count("META_START") == len(breaks_s) + 1
    asked = rl.orbit.Epochs(scenario.time.start_utc, np.arange(1.0, 3900.0, 7.0))
    there = motion.truth(scenario.bodies, asked).states["follower"]
    read = rl.orbit.Ephemeris(file=str(file)).states(asked)
    np.testing.assert_allclose(read.position_m, there.position_m, rtol=0, atol=0.01)
