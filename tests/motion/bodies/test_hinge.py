import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.errors import ScenarioError
from rso_lidar.motion import FixedAngle, FollowSun, HingeAxes, PlannedAngle
from rso_lidar.motion.bodies.hinge import find_sun_in_body

HINGE = {"name": "array", "parts": ("solar_array",), "position_m": (0.0, 1.0, 0.0), "axis": (0.0, 2.0, 0.0)}


def angles(joint, time_s, to_sun=None, rate=None):
    link = joint.link(np.asarray(time_s, dtype=float), to_sun, rate)
    return link, link.rotation.as_rotvec()[:, 1], link.angular_velocity_rad_s[:, 1]


def test_a_fixed_angle_turns_on_at_its_rate():
    joint = HingeAxes(**HINGE, angle=FixedAngle(angle_deg=30.0, rate_deg_s=2.0))
    link, angle, rate = angles(joint, [0.0, 10.0])
    np.testing.assert_allclose(np.rad2deg(angle), [30.0, 50.0])
    np.testing.assert_allclose(np.rad2deg(rate), 2.0)
    # right-handed about +y: +z of the part goes toward +x; the hinge's own point stays
    np.testing.assert_allclose(link.pose[0].apply([0, 0, 1]), [0.5, 1.0, np.sqrt(0.75)], atol=1e-15)


def test_planned_angles_are_linear_between_entries_and_still_outside():
    joint = HingeAxes(**HINGE, angle=PlannedAngle(time_s=(10.0, 20.0), angle_deg=(0.0, 90.0)))
    _, angle, rate = angles(joint, [0.0, 10.0, 15.0, 20.0, 30.0])
    np.testing.assert_allclose(np.rad2deg(angle), [0.0, 0.0, 45.0, 90.0, 90.0], atol=1e-12)
    np.testing.assert_allclose(np.rad2deg(rate), [0.0, 9.0, 9.0, 0.0, 0.0], atol=1e-12)


def test_the_array_turns_its_normal_as_near_to_the_sun_as_the_axis_allows():
    """No other angle of the hinge has a smaller angle between normal and Sun: scanned at every tenth of a degree."""
    joint = HingeAxes(**HINGE, angle=FollowSun(normal=(0.0, 0.3, 1.0)))
    suns = Rotation.random(20, rng=np.random.default_rng(5)).apply([1.0, 0.0, 0.0])
    link, _, _ = angles(joint, np.zeros(20), suns, np.zeros_like(suns))
    normal = np.array([0.0, 0.3, 1.0]) / np.hypot(0.3, 1.0)
    reached = np.sum(link.rotation.apply(normal) * suns, axis=1)
    scan = Rotation.from_euler("y", np.arange(0.0, 360.0, 0.1)[:, None], degrees=True).apply(normal)
    assert np.all(reached >= (suns @ scan.T).max(axis=1) - 1e-12)


def test_its_rate_is_that_of_its_angle():
    joint = HingeAxes(**HINGE, angle=FollowSun(normal=(0.0, 0.0, 1.0)))
    body_rate = np.array([0.02, -0.03, 0.01])
    sun = np.array([0.4, 0.5, -0.3]) / np.sqrt(0.5)
    step = 1e-4
    turns = Rotation.from_rotvec(np.outer([-step, 0.0, step], body_rate))
    seen, rate = find_sun_in_body(turns, body_rate, sun)
    _, angle, rates = angles(joint, np.zeros(3), seen, rate)
    np.testing.assert_allclose((angle[2] - angle[0]) / (2 * step), rates[1], rtol=1e-6)


def test_the_sun_along_the_axis_leaves_the_array_at_zero():
    joint = HingeAxes(**HINGE, angle=FollowSun(normal=(0.0, 0.0, 1.0)))
    _, angle, rate = angles(joint, np.zeros(1), np.array([[0.0, 1.0, 0.0]]), np.array([[0.1, 0.0, 0.0]]))
    assert angle[0] == rate[0] == 0.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"axis": (0.0, 0.0, 0.0)}, "zero vector"),
        ({"name": "rtn"}, "body's own axes"),
        ({"parts": ()}, "at least 1"),
        ({"angle": {"type": "follow_sun", "normal": (0.0, -1.0, 0.0)}}, "parallel to the hinge's axis"),
        ({"angle": {"type": "planned", "time_s": (0.0, 1.0), "angle_deg": (0.0,)}}, "same number of entries"),
        ({"angle": {"type": "planned", "time_s": (1.0, 1.0), "angle_deg": (0.0, 1.0)}}, "must ascend"),
        ({"angle": {"type": "sun"}}, "unknown type 'sun'"),
    ],
)
def test_bad_hinges(changes, words):
    with pytest.raises(ScenarioError, match=words):
        HingeAxes(**{**HINGE, "angle": FixedAngle(), **changes})


def test_following_the_sun_without_one_is_an_error():
    joint = HingeAxes(**HINGE, angle=FollowSun(normal=(0.0, 0.0, 1.0)))
    with pytest.raises(
        ScenarioError, match=r"joint array: follows the Sun, which this world does not have; set world.sun_direction"
    ):
        joint.link(np.zeros(1), None, None)
