"""Clohessy-Wiltshire motion: its closed-form special cases, a hop, rtn axes, arcs, and where it stops being valid."""

import datetime
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs, State
from rso_lidar.rpo import Hill, clohessy_wiltshire, rtn_axes
from rso_lidar.rpo.plans.two_impulse import solve_departure_m_s
from rso_lidar.rpo.relative import curvilinear
from rso_lidar.rpo.relative.hill import find_mean_motion_rad_s

GM = units.EARTH_GM_M3_S2
RADIUS = 42164e3
N = math.sqrt(GM / RADIUS**3)
PERIOD = math.tau / N
TIMES = np.linspace(0.0, PERIOD, 101)
START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)


def chief(radius=RADIUS, e=0.0):
    """Return an orbit at its perigee."""
    speed = math.sqrt(GM * (1 + e) / radius)
    return State(epoch_utc=START, position_m=(radius, 0.0, 0.0), velocity_m_s=(0.0, 0.6 * speed, 0.8 * speed))


def hill(position, velocity, **more):
    return Hill(relative_to="chief", position_m=position, velocity_m_s=velocity, **more)


def flown(position, velocity, **more):
    """Return positions and velocities about a circular orbit at TIMES."""
    return hill(position, velocity, **more).relative(Epochs(START, TIMES), chief())


def test_hold_on_the_v_bar():
    position, velocity = flown((0.0, -500.0, 0.0), (0.0, 0.0, 0.0))
    np.testing.assert_array_equal(position, np.broadcast_to([0.0, -500.0, 0.0], position.shape))
    np.testing.assert_array_equal(velocity, np.zeros_like(velocity))


def test_two_by_one_ellipse():
    # x0 = b, vy0 = -2 n b: x = b cos nt, y = -2 b sin nt
    b = 100.0
    position, velocity = clohessy_wiltshire((b, 0.0, 0.0), (0.0, -2 * N * b, 0.0), TIMES, N)
    c, s = np.cos(N * TIMES), np.sin(N * TIMES)
    # 6 (s - nt) x0 and 3 nt vy0 / n cancel: rounding of 12 pi b
    np.testing.assert_allclose(position, np.stack([b * c, -2 * b * s, 0 * c], axis=1), rtol=0, atol=1e-16 * 100 * b)
    np.testing.assert_allclose(
        velocity, np.stack([-b * N * s, -2 * b * N * c, 0 * c], axis=1), rtol=0, atol=1e-16 * 100 * b * N
    )


def test_radial_offset_drifts():
    # a body x0 higher, on its own circle, falls back 3/2 n x0 per second; its velocity here is the shear
    x0 = 50.0
    position, velocity = clohessy_wiltshire((x0, 0.0, 0.0), (0.0, -1.5 * N * x0, 0.0), TIMES, N)
    np.testing.assert_allclose(position[:, 0], x0, rtol=1e-14)
    np.testing.assert_allclose(position[:, 1], -1.5 * N * x0 * TIMES, rtol=0, atol=1e-15 * 100 * x0)
    np.testing.assert_allclose(velocity[:, 1], -1.5 * N * x0, rtol=1e-14)


def test_release_at_rest_drifts_six_pi_and_oscillates():
    # CW: y gains -12 pi x0 each revolution
    x0 = 10.0
    position, _ = clohessy_wiltshire((x0, 0.0, 0.0), (0.0, 0.0, 0.0), np.array([PERIOD, 2 * PERIOD]), N)
    np.testing.assert_allclose(position[:, 1], [-12 * math.pi * x0, -24 * math.pi * x0], rtol=1e-14)


def test_cross_track_is_a_pendulum():
    position, velocity = clohessy_wiltshire((0.0, 0.0, 30.0), (0.0, 0.0, 0.002), TIMES, N)
    np.testing.assert_allclose(
        position[:, 2], 30 * np.cos(N * TIMES) + 0.002 / N * np.sin(N * TIMES), rtol=0, atol=1e-13
    )
    np.testing.assert_allclose(
        velocity[:, 2], 0.002 * np.cos(N * TIMES) - 30 * N * np.sin(N * TIMES), rtol=0, atol=1e-17
    )


MOTION = (300.0, -2000.0, 150.0), (0.02, -0.1, 0.03)
FORCE = (3e-6, -2e-6, 1e-6)


@pytest.mark.parametrize("force", [(0.0, 0.0, 0.0), FORCE])
def test_it_satisfies_hills_equations(force):
    h = 1.0
    before, at, after = (clohessy_wiltshire(*MOTION, TIMES + shift, N, force) for shift in (-h, 0.0, h))
    (x, _, z), (u, v, _) = (values.T for values in at)
    # the cut-off of central differences: h^2 / 6 times the third derivative, at most n^3 times the path's size
    size = 1e5
    np.testing.assert_allclose((after[0] - before[0]) / (2 * h), at[1], rtol=0, atol=N**3 * size + 1e-10)
    pull = (after[1] - before[1]) / (2 * h)
    expected = np.stack([3 * N**2 * x + 2 * N * v, -2 * N * u, -(N**2) * z], axis=1) + force
    np.testing.assert_allclose(pull, expected, rtol=0, atol=N**4 * size + 1e-14)


def test_forced_motion_begins_where_it_is_told_to():
    position, velocity = flown(*MOTION, acceleration_m_s2=FORCE)
    np.testing.assert_array_equal(position[0], MOTION[0])
    np.testing.assert_array_equal(velocity[0], MOTION[1])


def test_a_constant_push_along_the_track():
    # Fehse, Automated Rendezvous and Docking of Spacecraft, eq. 3.29: x = 2 a / n (t - sin nt / n),
    # y = a (4 (1 - cos nt) / n^2 - 1.5 t^2)
    push = 1e-5
    position, _ = flown((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), acceleration_m_s2=(0.0, push, 0.0))
    nt = N * TIMES
    size = push / N**2 * 60  # of the terms
    np.testing.assert_allclose(position[:, 0], 2 * push / N**2 * (nt - np.sin(nt)), rtol=0, atol=1e-15 * size)
    np.testing.assert_allclose(
        position[:, 1], push / N**2 * (4 * (1 - np.cos(nt)) - 1.5 * nt**2), rtol=0, atol=1e-15 * size
    )


def test_many_states_at_once():
    rng = np.random.default_rng(3)
    starts, speeds = rng.normal(0.0, 100.0, (7, 1, 3)), rng.normal(0.0, 0.1, (7, 1, 3))
    position, velocity = clohessy_wiltshire(starts, speeds, TIMES, N, FORCE)
    assert position.shape == velocity.shape == (7, 101, 3)
    for k in range(7):
        for got, want in zip(
            (position, velocity), clohessy_wiltshire(starts[k, 0], speeds[k, 0], TIMES, N, FORCE), strict=True
        ):
            np.testing.assert_array_equal(got[k], want)
    one = clohessy_wiltshire(starts[2, 0], speeds[2, 0], TIMES[5], N, FORCE)
    assert one[0].shape == (3,)
    np.testing.assert_array_equal(one[0], position[2, 5])


@pytest.mark.parametrize("curved", [False, True])
def test_an_epoch_has_the_same_bits_alone(curved):
    part = hill(*MOTION, acceleration_m_s2=FORCE, curvilinear=curved)
    times = np.linspace(-3e4, 3e4, 20_001)
    together = part.relative(Epochs(START, times), chief(7e6, 0.1))
    for k in (0, 1, 8191, 8192, 20_000):
        for got, want in zip(part.relative(Epochs(START, times[k : k + 1]), chief(7e6, 0.1)), together, strict=True):
            np.testing.assert_array_equal(got[0], want[k])


def test_mean_motion_of_the_osculating_orbit():
    # at the perigee of e = 0.2, a is q / 0.8
    assert find_mean_motion_rad_s(chief(8e6, 0.2), START) == pytest.approx(math.sqrt(GM / 1e7**3), rel=1e-14)
    with pytest.raises(ScenarioError, match="is open"):
        find_mean_motion_rad_s(chief(8e6, 1.1), START)
    with pytest.raises(ScenarioError, match="nonlinear"):
        hill(*MOTION).relative(Epochs(START, TIMES), chief(8e6, 1.0 + 1e-9))


def test_hop_arrives():
    aim = np.array([0.0, -300.0, 20.0])
    velocity = solve_departure_m_s((0.0, -3000.0, 0.0), aim, 2700.0, N)
    position, _ = clohessy_wiltshire((0.0, -3000.0, 0.0), velocity, 2700.0, N)
    np.testing.assert_allclose(position, aim, rtol=0, atol=1e-9)


def test_hop_along_the_v_bar_has_a_closed_form():
    # Solve x(t) = 0: u = -2 (1 - c) v / s, in y(t) - y0 = [(4 s - 3 nt) v - 2 (1 - c) u] / n
    duration = 2700.0
    s, c, nt = math.sin(N * duration), math.cos(N * duration), N * duration
    along = 2700.0 * N / (4 * s - 3 * nt + 4 * (1 - c) ** 2 / s)
    velocity = solve_departure_m_s((0.0, -3000.0, 0.0), (0.0, -300.0, 0.0), duration, N)
    np.testing.assert_allclose(velocity, [-2 * (1 - c) / s * along, along, 0.0], rtol=1e-10, atol=1e-15)


@pytest.mark.parametrize("duration", [0.0, PERIOD, 0.5 * PERIOD])
def test_hop_without_an_answer(duration):
    with pytest.raises(ScenarioError, match="transfer: "):
        solve_departure_m_s((0.0, -3000.0, 0.0), (0.0, -300.0, 10.0), duration, N)


def test_rtn_axes_of_a_known_state():
    rotation, rate = rtn_axes(np.array([0.0, 7e6, 0.0]), np.array([0.0, 100.0, 7500.0]))
    # x radially out = +y; z along r x v = +x; y = z x x = +z
    np.testing.assert_allclose(rotation.as_matrix(), [[0, 0, 1], [1, 0, 0], [0, 1, 0]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(rate, [0, 0, 7500.0 / 7e6], rtol=1e-15)


def test_rtn_rate_is_the_turn_of_the_axes():
    from rso_lidar.orbit import propagate_two_body

    r0, v0 = np.array([7e6, 1e6, -2e6]), np.array([-1000.0, 6000.0, 5500.0])
    times, h = np.linspace(0.0, 9000.0, 50), 0.05
    rotation, rate = rtn_axes(*propagate_two_body(r0, v0, times))
    ahead, behind = (
        rtn_axes(*propagate_two_body(r0, v0, times + h))[0],
        rtn_axes(*propagate_two_body(r0, v0, times - h))[0],
    )
    turned = (behind.inv() * ahead).as_rotvec() / (2 * h)
    # rounding of a rotation vector over 2 h = 0.1 s, and h^2 / 6 times the rate's second derivative (about n^3)
    np.testing.assert_allclose(turned, rate, rtol=0, atol=1e-14 + h**2 * 0.0015**3)
    assert isinstance(rotation, Rotation)
    np.testing.assert_array_equal(
        rotation[3].as_quat(), rtn_axes(*(a[0] for a in propagate_two_body(r0, v0, times[3:4])))[0].as_quat()
    )


def test_arcs_and_back():
    rng = np.random.default_rng(4)
    position, velocity = rng.uniform(-3e6, 3e6, (500, 3)), rng.uniform(-2e3, 2e3, (500, 3))
    radius, radial = rng.uniform(6.5e6, 4e7, 500), rng.uniform(-1e3, 1e3, 500)
    back = curvilinear.to_rectilinear(*curvilinear.to_curvilinear(position, velocity, radius, radial), radius, radial)
    # some roundings of 4e7 m and of 2e3 m/s
    np.testing.assert_allclose(back[0], position, rtol=0, atol=5e-8)
    np.testing.assert_allclose(back[1], velocity, rtol=0, atol=5e-12 * 2e3)


def test_arcs_of_a_known_place():
    # a quarter of a turn ahead, a third as far again from the Earth
    radius = 9e6
    arcs, rates = curvilinear.to_curvilinear(np.array([-radius, 12e6, 0.0]), np.array([-50.0, 7.0, 3.0]), radius, 0.0)
    np.testing.assert_allclose(arcs, [3e6, radius * math.pi / 2, 0.0], rtol=1e-15)
    np.testing.assert_allclose(rates, [7.0, 50.0 * 0.75, 3.0 * 0.75], rtol=1e-15)


def test_rates_of_arcs_are_their_slopes():
    h = 1e-2
    (x, u), radius, radial = (np.array([2e5, -3e6, 4e5]), np.array([30.0, -50.0, 20.0])), 7e6, 40.0
    ahead, behind = (curvilinear.to_curvilinear(x + t * u, u, radius + t * radial, radial)[0] for t in (h, -h))
    _, rates = curvilinear.to_curvilinear(x, u, radius, radial)
    np.testing.assert_allclose((ahead - behind) / (2 * h), rates, rtol=0, atol=1e-6)  # 1e-9 m of rounding over 2 h


def test_what_is_near_keeps_its_digits_through_the_arcs():
    position, velocity = np.array([1e-3, -2e-3, 3e-3]), np.array([1e-6, 2e-6, -1e-6])
    arcs, rates = curvilinear.to_curvilinear(position, velocity, RADIUS, 5.0)
    back = curvilinear.to_rectilinear(arcs, rates, RADIUS, 5.0)
    np.testing.assert_allclose(back[0], position, rtol=1e-12)
    np.testing.assert_allclose(arcs, position, rtol=1e-9)
    np.testing.assert_allclose(rates, velocity, rtol=0, atol=1e-14)


def test_nearby_arcs_are_straight():
    straight, arcs = flown(*MOTION), flown(*MOTION, curvilinear=True)
    # second order: 15 pi rho^2 / r over the revolution, rho some 20 km
    assert 1e-3 < np.abs(straight[0] - arcs[0]).max() < 15 * math.pi * 2e4**2 / RADIUS


def test_far_along_a_circle_arcs_stay():
    """A body 1 rad ahead on the same circle stands still in turning axes, which x, y, z cannot say."""
    angle = 1.0
    place = RADIUS * (math.cos(angle) - 1), RADIUS * math.sin(angle), 0.0
    position, velocity = flown(place, (0.0, 0.0, 0.0), curvilinear=True)
    np.testing.assert_allclose(position, np.broadcast_to(place, position.shape), rtol=0, atol=1e-6)
    np.testing.assert_allclose(velocity, 0.0, rtol=0, atol=1e-10)
    assert np.abs(flown(place, (0.0, 0.0, 0.0))[0] - place).max() > RADIUS


def test_arcs_begin_where_they_are_told_to_on_an_ellipse():
    part = hill((3e4, -4e5, 2e4), (3.0, -2.0, 1.0), curvilinear=True)
    later = State(
        epoch_utc=START - datetime.timedelta(seconds=900), **chief(7e6, 0.1).model_dump(exclude={"type", "epoch_utc"})
    )
    position, velocity = part.relative(Epochs(START, np.zeros(1)), later)
    np.testing.assert_allclose(position[0], part.position_m, rtol=0, atol=1e-8)
    np.testing.assert_allclose(velocity[0], part.velocity_m_s, rtol=0, atol=1e-11)


HOUR = Epochs(START, np.linspace(0.0, 3600.0, 7))
REST = (0.0, 0.0, 0.0)


def test_validity():
    near, far = (0.0, -9000.0, 0.0), (0.0, -12345.0, 0.0)
    assert hill(near, REST).validity(HOUR, chief(e=0.001)) == []
    (only,) = hill(far, REST).validity(HOUR, chief(e=0.001))
    assert "12.3 km" in only
    assert "curvilinear = true" in only
    (only,) = hill(near, REST).validity(HOUR, chief(e=0.02))
    assert "0.0200" in only
    assert "yamanaka_ankersen" in only
    assert len(hill(far, REST).validity(HOUR, chief(e=0.02))) == 2


def test_validity_of_arcs_is_of_height_not_of_distance():
    assert hill((-1e5, -3e6, 0.0), REST, curvilinear=True).validity(HOUR, chief()) == []
    (only,) = hill((2e4, 0.0, 0.0), REST, curvilinear=True).validity(HOUR, chief())
    assert "height" in only
    assert "curvilinear" not in only


def test_validity_over_many_low_revolutions():
    week = Epochs(START, np.array([0.0, 7 * 86400.0]))
    (only,) = hill((0.0, -100.0, 0.0), REST).validity(week, chief(7e6))
    assert "103.8 revolutions" in only  # 604,800 s of 5828.5 s
    assert "relative_elements" in only
    (only,) = hill((0.0, -100.0, 0.0), REST).validity(Epochs(START, np.array([0.0, 400 * 86400.0])), chief())
    assert "flattening" in only
    assert hill((0.0, -100.0, 0.0), REST).validity(week, chief()) == []
