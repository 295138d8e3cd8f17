import datetime

import numpy as np
import pytest

import rso_lidar as rl
from tests.orbit.earth.earth_for_tests import GEO, LOW, START


@pytest.fixture(scope="module")
def scenario():
    return rl.Scenario.load("examples/tdrs_approach.toml")


def test_it_is_the_truth_of_the_frames_but_for_the_pan_tilt_unit(scenario):
    frames = [0, 100, 200]
    where = rl.truth(scenario, scenario.epochs(np.array(frames)))
    flown = [frame.truth for frame in rl.simulate(scenario, frames=frames)]
    for k, one in enumerate(flown):
        expected = one.pose("follower", "tdrs")
        np.testing.assert_array_equal(where.at(k).pose("follower", "tdrs").translation, expected.translation)
        np.testing.assert_array_equal(where.at(k).states["tdrs"].velocity_m_s, one.states["tdrs"].velocity_m_s)
        line = where.at(k).pose("lidar", "tdrs").translation  # the demand, without lag and jitter: on the boresight
        assert np.hypot(*line[:2]) < 1e-9 * line[2]
    assert len(rl.truth(scenario).time_s) == scenario.time.n_frames


def test_seconds_and_instants_of_another_start_are_the_same(scenario):
    start = scenario.time.start_utc
    seconds = np.array([10.0, 70.0])
    later = rl.orbit.Epochs(start - datetime.timedelta(seconds=3600), seconds + 3600.0)
    a, b = rl.truth(scenario, seconds), rl.truth(scenario, later)
    np.testing.assert_array_equal(a.states["follower"].position_m, b.states["follower"].position_m)


def test_bodies_need_no_lidar():
    epochs = rl.orbit.Epochs(START, np.array([0.0, 600.0]))
    bodies = [
        rl.motion.Body(name="low", motion=LOW),
        rl.motion.Body(name="high", motion=GEO, attitude=rl.LookAt(at="low")),
    ]
    where = rl.truth(bodies, epochs)
    line = where.pose("high", "low").translation
    expected = np.linalg.norm(LOW.states(epochs).position_m - GEO.states(epochs).position_m, axis=1)
    np.testing.assert_allclose(line[:, 0], expected, rtol=1e-12)  # +x of the body looks at it
    np.testing.assert_allclose(line[:, 1:], 0.0, atol=1e-6)


def test_bad_input_is_told(scenario):
    for given, epochs, message in (
        ("examples/tdrs_approach.toml", None, "needs a Scenario, or a list of bodies"),
        (None, None, "needs a Scenario"),
        ([LOW], None, "needs a Scenario"),
        ([rl.motion.Body(name="low", motion=LOW)], [0.0], "give rl.orbit.Epochs"),
        (scenario, ["now"], "time_s: needs seconds"),
        (scenario, [np.nan], "finite seconds"),
    ):
        with pytest.raises(rl.ScenarioError, match=message):
            rl.truth(given, epochs)
