"""Telemetry of wheels and thrusters: which entries are read, units, rounding, and messages."""

import numpy as np
import pytest

from rso_lidar import sensors, units
from rso_lidar.errors import ScenarioError
from tests.sensors.motion_for_tests import make_motion

KEY = sensors.make_key(7, "wheels")
DYNAMICS = {"attitude.state": np.arange(18.0).reshape(2, 9), "attitude.input": np.array([[0.1, 0.2], [0.3, 0.4]])}


def test_wheels_are_entries_of_state_and_input():
    motion = make_motion([0.0, 1.0], dynamics=DYNAMICS)
    wheels = sensors.WheelTelemetry(
        name="wheels", rate_hz=1.0, dynamics="attitude", speed_entries=(7, 8), torque_entries=(1,)
    )
    samples, _ = wheels.measure(motion, KEY, 0)
    np.testing.assert_array_equal(samples.speed_rad_s, [[7.0, 8.0], [16.0, 17.0]])
    np.testing.assert_array_equal(samples.torque_n_m, [[0.2], [0.4]])
    rounded, _ = wheels.replace(speed_resolution_rpm=50.0).measure(motion, KEY, 0)
    np.testing.assert_allclose(rounded.speed_rad_s[0], np.array([50.0, 100.0]) * units.RPM)  # 66.8 and 76.4 rpm


def test_thrusters_are_entries_of_the_input_in_newtons():
    motion = make_motion([0.0, 1.0], dynamics={"motion.input": np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])})
    thrusters = sensors.ThrusterTelemetry(
        name="wheels", rate_hz=1.0, dynamics="motion", force_entries=(2, 0), newtons_per_input=50.0
    )
    samples, _ = thrusters.measure(motion, KEY, 0)
    np.testing.assert_array_equal(samples.force_n, [[150.0, 50.0], [300.0, 200.0]])
    rounded, _ = thrusters.replace(force_resolution_n=40.0).measure(motion, KEY, 0)
    np.testing.assert_array_equal(rounded.force_n[0], [160.0, 40.0])
    scaled, _ = thrusters.replace(scale_factor_ppm=1e5).measure(motion, KEY, 0)
    ratios = scaled.force_n / samples.force_n
    np.testing.assert_allclose(ratios[0], ratios[1])
    assert (ratios[0] != 1.0).all() and ratios[0, 0] != ratios[0, 1]


@pytest.mark.parametrize(
    ("wheels", "words"),
    [
        ({"dynamics": "motion", "speed_entries": (0,)}, "follower's motion is not of type state_space"),
        ({"dynamics": "attitude", "speed_entries": (9,)}, "has 9 entries, counted from 0, but entry 9"),
        ({"dynamics": "attitude", "torque_entries": (0, 2)}, "input of the follower's attitude has 2 entries"),
        ({"dynamics": "attitude"}, "has no wheels"),
        ({"dynamics": "attitude", "speed_entries": (-1,)}, "greater than or equal to 0"),
    ],
)
def test_wheels_that_are_not_there_are_an_error(wheels, words):
    with pytest.raises(ScenarioError, match=words):
        sensors.WheelTelemetry(name="wheels", rate_hz=1.0, **wheels).measure(
            make_motion([0.0], dynamics={name: rows[:1] for name, rows in DYNAMICS.items()}), KEY, 0
        )
