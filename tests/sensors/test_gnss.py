"""GNSS: antenna, axes and sign of relative solutions, vertical errors."""

import numpy as np
import pytest

from rso_lidar import sensors
from rso_lidar.errors import ScenarioError
from rso_lidar.records import BodyState
from tests.sensors.motion_for_tests import make_motion

KEY = sensors.make_key(7, "gnss")
HALF = np.sqrt(0.5)


def test_the_antenna_is_placed_and_moves_with_the_body():
    turned = [[0.0, 0.0, HALF, HALF]]  # body x along inertial y
    motion = make_motion([0.0], quaternion_xyzw=turned, angular_velocity_rad_s=[[0.0, 0.0, 0.1]])
    gnss = sensors.Gnss(name="gnss", rate_hz=1.0, antenna_m=(2.0, 0.0, 0.0))
    samples, _ = gnss.measure(motion, KEY, 0)
    np.testing.assert_allclose(samples.position_m, [[7e6, 2.0, 0.0]], atol=1e-8)
    np.testing.assert_allclose(samples.velocity_m_s, [[-0.2, 7.5e3, 0.0]], atol=1e-11)


def test_vertical_errors_are_along_the_position():
    even = sensors.Gnss(name="gnss", rate_hz=1.0, position_noise_m=1.0, velocity_noise_m_s=0.1)
    motion = make_motion(np.arange(50.0))
    (one, _), (two, _) = even.measure(motion, KEY, 0), even.replace(vertical_ratio=3.0).measure(motion, KEY, 0)
    stretch = np.array([3.0, 1.0, 1.0])
    np.testing.assert_allclose(
        two.position_m - motion.position_m, stretch * (one.position_m - motion.position_m), atol=1e-7
    )
    np.testing.assert_allclose(
        two.velocity_m_s - motion.velocity_m_s, stretch * (one.velocity_m_s - motion.velocity_m_s), atol=1e-11
    )
    at_origin = make_motion([0.0], position_m=np.zeros((1, 3)))
    assert np.isfinite(even.replace(vertical_ratio=3.0).measure(at_origin, KEY, 0)[0].position_m).all()


def test_a_relative_solution_is_the_follower_seen_from_the_target():
    """The target is 100 m ahead of the follower on a circular orbit: the follower is at -100 m along track, at rest."""
    radius, speed = 7e6, 7.5e3
    rate = speed / radius
    angle = 100.0 / radius
    ahead = np.array([[radius * np.cos(angle) - radius, radius * np.sin(angle), 0.0]])
    faster = np.array([[-speed * np.sin(angle), speed * np.cos(angle) - speed, 0.0]])
    motion = make_motion([0.0], targets={"tdrs": BodyState(ahead, faster)})
    rtn, _ = sensors.RelativeGnss(name="gnss", rate_hz=1.0, target="tdrs").measure(motion, KEY, 0)
    np.testing.assert_allclose(rtn.relative_position_m, [[-50.0 * angle, -100.0, 0.0]], atol=1e-6)
    np.testing.assert_allclose(rtn.relative_velocity_m_s, 0.0, atol=1e-9)
    inertial, _ = sensors.RelativeGnss(name="gnss", rate_hz=1.0, target="tdrs", axes="inertial").measure(motion, KEY, 0)
    np.testing.assert_allclose(inertial.relative_position_m, -ahead)
    np.testing.assert_allclose(inertial.relative_velocity_m_s, -faster)
    assert rate * 100.0 == pytest.approx(np.linalg.norm(faster), rel=1e-6)


def test_an_unknown_target_is_an_error():
    with pytest.raises(ScenarioError, match=r"no target 'iss' \(known: none\)"):
        sensors.RelativeGnss(name="gnss", rate_hz=1.0, target="iss").measure(make_motion([0.0]), KEY, 0)
