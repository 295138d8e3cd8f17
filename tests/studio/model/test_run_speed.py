"""The estimate of a run: from frames that were timed, for the frames that are asked for."""

import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.studio.model.run_speed import RunSpeed, estimate_run

SPEED = RunSpeed(numbers=(0, 5, 9), seconds=(1.0, 2.0, 6.0), start_s=3.0)


def test_a_run_is_estimated_by_the_frames_that_it_makes(text):
    scenario = rl.Scenario.loads(text)
    assert SPEED.estimate_s([0, 5, 9]) == 12.0
    assert SPEED.estimate_s([7]) == 3.0 + 4.0  # half way between the frames that were timed
    assert estimate_run(scenario, "0:1", SPEED).startswith("1 of 10 frames in all; about 4 s (")
    assert estimate_run(scenario, "", RunSpeed((0, 9), (60.0, 60.0), 0.0)).startswith(
        "10 of 10 frames in all; about 10 min ("
    )
    assert estimate_run(scenario, "2:8", None).startswith("6 of 10 frames in all; timing")
    with pytest.raises(ScenarioError):
        estimate_run(scenario, "eight", SPEED)


def test_frames_are_timed_from_the_first_to_the_last(text):
    speed = RunSpeed.measure(text, rl.Scenario.loads(text))
    assert speed.numbers == (0, 2, 5, 7, 9)
    assert min(speed.seconds) > 0.0
    assert RunSpeed.measure(text, rl.Scenario.loads(text)) is speed
