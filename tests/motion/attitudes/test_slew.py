"""Slews: exact before and after, within limits between, the same whatever is asked for."""

import datetime
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.errors import ScenarioError
from rso_lidar.motion import Body, Fixed, FixedAttitude, LookAt, Nadir, Rtn, Slew, Spin, SunPointing, truth
from rso_lidar.motion.attitudes.slew import _initial_rotvec
from rso_lidar.orbit import Epochs, Kepler

START = datetime.datetime(2026, 3, 1, tzinfo=datetime.UTC)
ORBIT = Kepler(
    epoch_utc=START,
    semi_major_axis_km=7000.0,
    eccentricity=0.01,
    inclination_deg=51.6,
    raan_deg=30.0,
    argument_of_perigee_deg=10.0,
    true_anomaly_deg=0.0,
)
PAIRS = [
    (Rtn(), LookAt(at="t")),
    (Nadir(), SunPointing()),
    (FixedAttitude(), Nadir(yaw_steering=True)),
    (Spin(axis=(0, 0, 1), rate_deg_s=0.05), FixedAttitude(euler_zyx_deg=(100, 20, 0))),
]
LIMITS = [(0.5, 0.01), (0.5, 1.0), (5.0, 0.01), (0.2, 0.05)]


def flown(law, time_s, motion=ORBIT, local=False):
    """Return inertial_from_body and its rate in body axes."""
    other = Body(name="t", motion=motion.replace(semi_major_axis_km=7010.0) if not local else motion)
    made = truth([other, Body(name="a", motion=motion, attitude=law)], Epochs(START, time_s), local=local)
    link = made.poses.link("inertial", "a")
    n = len(time_s)
    rate = np.broadcast_to(link.angular_velocity_rad_s, (n, 3))
    return (link.pose.rotation if not link.pose.single else link.pose[[0] * n].rotation), rate


def slew(first, then, limits=(0.5, 0.01), **more):
    return Slew(
        **{"first": first, "then": then, "at_s": 100.0, "max_rate_deg_s": limits[0], **more},
        max_acceleration_deg_s2=limits[1],
    )


def bench(law, time_s):
    """Return root_from_body and its rate on a bench without an Earth."""
    return flown(law, time_s, Fixed(position_m=(0, 0, 0)), local=True)


@pytest.mark.parametrize(("first", "then"), PAIRS)
@pytest.mark.parametrize("limits", LIMITS)
def test_limits_hold_and_rates_are_exact(first, then, limits):
    law = slew(first, then, limits)
    time = np.linspace(95.0, 1495.0, 5601)
    rotation, rate = flown(law, time)
    moving = np.degrees(np.linalg.norm(rate, axis=1))
    assert moving.max() <= limits[0] * (1.0 + 1e-4)  # between the steps of its grid
    change = np.degrees(np.linalg.norm(np.diff(rate, axis=0), axis=1)) / np.diff(time)
    assert change.max() <= limits[1] * (1.0 + 1e-3)
    # and one of the two is used to the full within some per cent, or the slew is longer than it need be
    assert moving.max() > 0.97 * limits[0] or change.max() > 0.97 * limits[1]
    # Simpson's rule on the rate gives the turn: steps across a corner of the profile err by the change of acceleration
    # times the square of the step, all others by its fourth power
    step = (rotation[:-2:2].inv() * rotation[2::2]).as_rotvec() / 0.5
    mean = (rate[:-2:2] + 4.0 * rate[1:-1:2] + rate[2::2]) / 6.0
    off = np.linalg.norm(step - mean, axis=1)
    assert np.sort(off)[-9] < 1e-6 * np.radians(limits[1]) * 100.0 + 1e-8
    assert off.max() < np.radians(limits[1]) * 0.5


@pytest.mark.parametrize(("first", "then"), PAIRS)
def test_before_and_after_it_is_the_laws(first, then):
    law = slew(first, then, (2.0, 0.5))
    for instants, alone in ((np.array([0.0, 99.0, 100.0]), first), (np.array([500.0, 700.0]), then)):
        rotation, rate = flown(law, instants)
        expected, expected_rate = flown(alone, instants)
        np.testing.assert_allclose((rotation.inv() * expected).magnitude(), 0.0, atol=1e-14)
        np.testing.assert_allclose(rate, expected_rate, atol=1e-16)


def test_an_epoch_has_the_same_bits_alone():
    law = slew(*PAIRS[2])
    time = np.linspace(0.0, 400.0, 41)
    rotation, rate = flown(law, time)
    for k in (0, 10, 11, 15, 20, 40):
        one, its_rate = flown(law, time[k : k + 1])
        assert np.array_equal(one.as_quat()[0], rotation.as_quat()[k]) and np.array_equal(its_rate[0], rate[k])


@pytest.mark.parametrize(
    # Rest to rest by angle a: a / rate + rate / acceleration where a > rate^2 / acceleration, else 2 sqrt(a / acceleration)
    # (Wertz, Space Mission Engineering, sec. 19.1: bang-coast-bang and bang-bang).
    ("angle_deg", "limits", "lasts_s"),
    [(90.0, (1.0, 0.1), 100.0), (4.0, (1.0, 1.0), 5.0), (1.0, (10.0, 0.25), 4.0), (180.0, (3.0, 1.0), 63.0)],
)
def test_rest_to_rest_takes_as_long_as_the_limits_say(angle_deg, limits, lasts_s):
    law = slew(FixedAttitude(), FixedAttitude(euler_zyx_deg=(angle_deg, 0, 0)), limits, at_s=0.0)
    time = np.array([0.5 * lasts_s, lasts_s - 1e-3, lasts_s + 1e-9])
    rotation, rate = bench(law, time)
    assert np.degrees(rotation[0].magnitude()) == pytest.approx(0.5 * angle_deg, rel=1e-12)
    assert rate[1, 2] > 0.0 and np.all(rate[2] == 0.0)
    # the last millisecond of the deceleration
    assert np.degrees(rate[1, 2]) == pytest.approx(limits[1] * 1e-3, rel=1e-6)
    peak = min(limits[0], math.sqrt(angle_deg * limits[1]))
    assert np.degrees(rate[0, 2]) == pytest.approx(peak, rel=1e-9)


def test_half_a_turn_goes_the_same_way_always():
    for then in ((180.0, 0.0, 0.0), (-180.0, 0.0, 0.0)):
        law = slew(FixedAttitude(), FixedAttitude(euler_zyx_deg=then), (3.0, 1.0), at_s=0.0)
        _, rate = bench(law, np.array([30.0]))
        assert np.degrees(rate[0, 2]) == pytest.approx(3.0)  # about +z


def test_what_is_less_than_half_a_turn_goes_the_shorter_way():
    """By a tenth of a microradian about -z, by all of it but rounding about +z."""
    for less_rad, sign in ((1e-7, -1.0), (1e-11, 1.0)):
        angle = Rotation.from_rotvec([[0.0, 0.0, less_rad - math.pi]])
        assert np.sign(_initial_rotvec(Rotation.identity(1), angle)[2]) == sign


def test_the_way_round_is_kept_past_half_a_turn():
    # The second law turns away: 170 degrees at the start, beyond 180 before the slew is over.
    then = Spin(
        axis=(0, 0, 1),
        rate_deg_s=0.5,
        quaternion_xyzw=(0.0, 0.0, math.sin(math.radians(85)), math.cos(math.radians(85))),
    )
    law = slew(FixedAttitude(), then, (3.0, 1.0), at_s=0.0)
    time = np.linspace(0.0, 100.0, 1001)
    rotation, rate = bench(law, time)
    assert np.all(rate[1:, 2] > 0.0)
    steps = (rotation[:-1].inv() * rotation[1:]).as_rotvec()[:, 2]
    assert np.all(steps >= 0.0) and steps.max() < np.radians(0.301)


def test_no_turn_at_all_is_soon_over():
    law = slew(FixedAttitude(), FixedAttitude(), (1.0, 1.0), at_s=0.0)
    rotation, rate = bench(law, np.linspace(0.0, 1.0, 11))
    assert np.all(rate == 0.0) and np.all(rotation.magnitude() == 0.0)


def test_laws_beyond_the_limits_are_told():
    fast = Spin(axis=(0, 0, 1), rate_deg_s=2.0)
    with pytest.raises(
        ScenarioError, match=r"a.attitude: slew: one of its two laws alone reaches 2 deg/s, and max_rate is 1 deg/s"
    ):
        flown(slew(FixedAttitude(), fast, (1.0, 1.0)), np.array([200.0]))
    flown(slew(FixedAttitude(), fast, (1.0, 1.0)), np.array([50.0]))  # nobody has asked about the slew
    with pytest.raises(ScenarioError, match="max_rate_deg_s"):
        slew(FixedAttitude(), fast, (0.0, 1.0))
    with pytest.raises(ScenarioError, match="'rtn'"):
        Slew(first={"type": "lvlh"}, then=Rtn(), at_s=0.0, max_rate_deg_s=1.0, max_acceleration_deg_s2=1.0)
