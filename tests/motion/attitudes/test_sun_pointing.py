"""Attitudes that know the Sun: where they point, how fast they turn, and where they have no answer."""

import datetime

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.motion import Body, Fixed, Nadir, SunPointing, truth
from rso_lidar.orbit import Epochs, Kepler, sun_position_m

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
LAWS = [
    SunPointing(),
    SunPointing(axis=(1, 2, 3), up_axis=(0, 1, 0), up=(0, 0, 1)),
    Nadir(),
    Nadir(euler_zyx_deg=(10, 20, 30)),
    Nadir(yaw_steering=True),
    Nadir(yaw_steering=True, euler_zyx_deg=(10, 20, 30)),
]


def flown(law, time_s, orbit=ORBIT):
    """Return inertial_from_body, its rate in body axes, and the body's state."""
    made = truth([Body(name="a", motion=orbit, attitude=law)], Epochs(START, time_s))
    link = made.poses.link("inertial", "a")
    return link.pose.rotation, link.angular_velocity_rad_s, made.states["a"]


@pytest.mark.parametrize("law", LAWS)
def test_rates_are_the_derivative_of_the_turn(law):
    # Central difference over 20 ms: h^2 / 6 times the third derivative, about 1e-12 rad/s where yaw turns fastest, and
    # rounding of 1e-16 / h = 1e-14.
    time = np.linspace(0.0, 6000.0, 61)
    _, rate, _ = flown(law, time)
    after, before = (flown(law, time + step)[0] for step in (0.01, -0.01))
    np.testing.assert_allclose((before.inv() * after).as_rotvec() / 0.02, rate, atol=2e-11)


@pytest.mark.parametrize("law", LAWS)
def test_an_epoch_has_the_same_bits_alone(law):
    time = np.linspace(0.0, 6000.0, 37)
    rotation, rate, _ = flown(law, time)
    for k in (0, 17, 36):
        one, its_rate, _ = flown(law, time[k : k + 1])
        assert np.array_equal(one.as_quat()[0], rotation.as_quat()[k]) and np.array_equal(its_rate[0], rate[k])


def test_the_axis_points_at_the_sun_and_the_other_nearest_up():
    law = SunPointing(axis=(1, 2, 3), up_axis=(0, 1, 0), up=(0, 0, 1))
    time = np.linspace(0.0, 6000.0, 7)
    rotation, _, state = flown(law, time)
    sun = sun_position_m(Epochs(START, time)) - state.position_m
    sun /= np.linalg.norm(sun, axis=1, keepdims=True)
    np.testing.assert_allclose(rotation.apply(np.array([1, 2, 3]) / 14**0.5), sun, atol=1e-14)
    nearest = rotation.apply([0, 1, 0])[:, 2]
    for turn in np.linspace(0.01, 6.27, 60):  # a further turn about the Sun's line brings it no nearer
        other = Rotation.from_rotvec(turn * sun) * rotation
        assert np.all(other.apply([0, 1, 0])[:, 2] < nearest)


def test_nadir_is_geocentric_and_x_on_the_side_of_the_velocity():
    rotation, _, state = flown(Nadir(), np.linspace(0.0, 6000.0, 7))
    down = -state.position_m / np.linalg.norm(state.position_m, axis=1, keepdims=True)
    np.testing.assert_allclose(rotation.apply([0, 0, 1]), down, atol=1e-14)
    assert np.all(np.sum(rotation.apply([1, 0, 0]) * state.velocity_m_s, axis=1) > 0.0)


def test_yaw_steering_is_the_law_of_navigation_satellites():
    # Montenbruck et al., GPS Solutions 19 (2015) 3, eq. 3: psi = atan2(-tan beta, sin mu), from along-track about nadir;
    # mu from orbit midnight. For a Sun at infinity; its parallax over 7000 km is 5e-5 rad.
    time = np.linspace(0.0, 6000.0, 49)
    rotation, _, state = flown(Nadir(yaw_steering=True), time)
    r, v = state.position_m, state.velocity_m_s
    e_r = r / np.linalg.norm(r, axis=1, keepdims=True)
    e_n = np.cross(r, v) / np.linalg.norm(np.cross(r, v), axis=1, keepdims=True)
    e_t = np.cross(e_n, e_r)
    sun = sun_position_m(Epochs(START, time))
    sun /= np.linalg.norm(sun, axis=1, keepdims=True)
    beta = np.arcsin(np.sum(sun * e_n, axis=1))
    mu = np.arctan2(np.sum(sun * e_t, axis=1), -np.sum(sun * e_r, axis=1))
    psi = np.arctan2(-np.tan(beta), np.sin(mu))
    x, y = rotation.apply([1, 0, 0]), rotation.apply([0, 1, 0])
    np.testing.assert_allclose(x, np.cos(psi)[:, None] * e_t - np.sin(psi)[:, None] * e_n, atol=1e-3)
    seen = sun_position_m(Epochs(START, time)) - r
    seen /= np.linalg.norm(seen, axis=1, keepdims=True)
    np.testing.assert_allclose(np.sum(y * seen, axis=1), 0.0, atol=1e-14)  # the hinge stands across the Sun
    assert np.all(np.sum(x * seen, axis=1) > 0.0)


def test_yaw_turns_at_noon_as_its_angle_says():
    # psi' = mu' / tan beta at noon and midnight (Bar-Sever 1996): the largest of the orbit. Circular, beta as it comes.
    orbit = ORBIT.replace(eccentricity=0.0)
    time = np.linspace(0.0, 6000.0, 6001)
    _, rate, state = flown(Nadir(yaw_steering=True), time, orbit)
    normal = np.cross(state.position_m[0], state.velocity_m_s[0])
    sun = sun_position_m(Epochs(START, np.zeros(1)))[0]
    sine = np.dot(normal, sun) / np.linalg.norm(normal) / np.linalg.norm(sun)
    n = np.sqrt(3.986004418e14 / 7000e3**3)
    largest = np.abs(rate[:, 2]).max()
    assert largest == pytest.approx(n * np.sqrt(1.0 - sine**2) / abs(sine), rel=2e-3)


def test_a_sun_along_up_is_refused_with_its_epochs():
    time = np.array([0.0, 40000.0])
    up = sun_position_m(Epochs(START, time[:1]))[0]
    far = ORBIT.replace(semi_major_axis_km=6600.0)
    _, _, state = flown(None, time, far)
    line = up - state.position_m[0]
    with pytest.raises(
        PropagationError, match=r"a\.attitude: sun_pointing: the Sun is within 1e-06 rad of `up`"
    ) as error:
        flown(SunPointing(up=tuple(line / np.linalg.norm(line))), time, far)
    assert error.value.bad.tolist() == [True, False]


def test_a_sun_overhead_has_no_yaw():
    # An orbit through the point under the Sun: position along the Sun's direction at t = 0.
    sun = sun_position_m(Epochs(START, np.zeros(1)))[0]
    raan = np.degrees(np.arctan2(sun[1], sun[0]))
    tilt = np.degrees(np.arcsin(sun[2] / np.linalg.norm(sun)))
    polar = ORBIT.replace(inclination_deg=90.0, raan_deg=raan, argument_of_perigee_deg=tilt % 360.0)
    with pytest.raises(PropagationError, match="zenith or nadir") as error:
        flown(Nadir(yaw_steering=True), np.array([0.0, 600.0]), polar)
    assert error.value.bad.tolist() == [True, False]


def test_worlds_without_a_sun_or_an_orbit():
    plate = Body(name="plate", motion=Fixed(position_m=(1000, 0, 0)), attitude=SunPointing())
    epochs = Epochs(START, np.zeros(2))
    with pytest.raises(ScenarioError, match="no Sun"):
        truth([plate], epochs, local=True)
    lit = truth([plate], epochs, local=True, sun_direction=(0.0, 2.0, 0.0))
    rotation = lit.poses.link("inertial", "plate").pose.rotation
    np.testing.assert_allclose(np.atleast_2d(rotation.apply([1, 0, 0]))[0], [0, 1, 0], atol=1e-15)
    with pytest.raises(ScenarioError, match="orbits"):
        truth([plate.replace(attitude=Nadir())], epochs, local=True, sun_direction=(0, 1, 0))
    with pytest.raises(ScenarioError, match="axis and up_axis are parallel"):
        SunPointing(axis=(0, 0, 2))
