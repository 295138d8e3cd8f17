"""Derivatives of states: between breaks, beside a break, and where there is no state beside an epoch."""

import datetime

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import motion
from rso_lidar.errors import PropagationError
from rso_lidar.orbit import differentiate, state_rates
from rso_lidar.orbit.trajectory import DIFFERENCE_STEP_S
from rso_lidar.records import BodyState

START = datetime.datetime(2026, 5, 7, tzinfo=datetime.UTC)
RATE = 1.1e-3  # of a circle of 7000 km [rad/s]


def circle(time_s):
    angle = RATE * np.asarray(time_s)
    place = 7e6 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)
    return place, np.cross([0.0, 0.0, RATE], place)


class Kicked:
    """A circle whose velocity jumps along z at 100 s and stays so, and that exists up to `end_s`."""

    def __init__(self, breaks=True, end_s=np.inf):
        self.end_s = end_s
        if breaks:
            self.breaks_s = lambda epochs: np.array([100.0])

    def states(self, epochs):
        bad = epochs.time_s > self.end_s
        if bad.any():
            raise PropagationError("gone", bad)
        place, speed = circle(epochs.time_s)
        after = np.maximum(epochs.time_s - 100.0, 0.0)
        place[:, 2] += 5.0 * after
        speed[:, 2] += 5.0 * (epochs.time_s >= 100.0)
        return BodyState(place, speed)


def rates(trajectory, time_s):
    epochs = rl.orbit.Epochs(START, np.asarray(time_s, dtype=float))
    return state_rates(trajectory, epochs, trajectory.states(epochs))


def test_a_break_is_not_differenced_across():
    time_s = np.array([50.0, 98.5, 99.99999, 100.0, 100.00001, 101.5, 200.0])
    place, speed = circle(time_s)
    speed[:, 2] = 5.0 * (time_s >= 100.0)
    velocity, acceleration = rates(Kicked(), time_s)
    np.testing.assert_allclose(velocity, speed, rtol=0, atol=3e-9)  # 1e-9 m of rounding
    np.testing.assert_allclose(acceleration, -(RATE**2) * place, rtol=0, atol=3e-5)  # v''' h^2 / 3 beside a break
    assert np.abs(rates(Kicked(breaks=False), [100.5])[1][0, 2]) > 1.0  # and so it would be


def test_where_a_trajectory_ends_two_bodies_stand_in():
    trajectory = Kicked(end_s=300.0)
    velocity, acceleration = rates(trajectory, [250.0, 299.5])
    place, _ = circle(np.array([250.0, 299.5]))
    distance = np.linalg.norm(trajectory.states(rl.orbit.Epochs(START, np.array([299.5]))).position_m)
    np.testing.assert_allclose(acceleration[0], -(RATE**2) * place[0], rtol=0, atol=1e-5)  # v''' h^2 / 6
    np.testing.assert_allclose(np.linalg.norm(acceleration[1]), 3.986004418e14 / distance**2, rtol=1e-12)
    np.testing.assert_array_equal(
        velocity[1], trajectory.states(rl.orbit.Epochs(START, np.array([299.5]))).velocity_m_s[0]
    )


def test_a_derivative_within_a_short_piece():
    def rows(time_s):
        return np.sin(time_s)[:, None]

    time_s = np.array([0.1, 0.15, 0.2])
    found = differentiate(rows, time_s, rows(time_s), np.array([0.1, 0.2]))
    assert DIFFERENCE_STEP_S > 0.1
    np.testing.assert_allclose(found[:2, 0], np.cos(time_s[:2]), rtol=0, atol=0.05**2)  # f''' h^2 / 3


def test_a_pair_of_real_sets_has_rates_that_are_derivatives(shared):
    """TerraSAR-X and TanDEM-X, up to 0.9 km apart: the turn of the plane alone is up to 0.4 mm/s of their rate."""
    catalog = rl.orbit.Catalog.from_file(shared / "tle" / "pairs" / "terrasarx_tandemx_2025-10.tle")
    a, b = (rl.Tle(lines=(entry.line1, entry.line2)) for entry in catalog)
    bodies = [motion.Body(name="a", motion=a), motion.Body(name="b", motion=b)]
    start = catalog.sets[0].epoch_utc + datetime.timedelta(hours=1)
    times = np.arange(0.0, 6000.0, 250.0)
    step = 4.0
    grid = (times[:, None] + step * np.arange(-2, 3)).ravel()
    truth = motion.truth(bodies, rl.orbit.Epochs(start, grid))
    place = truth.poses.place("a.rtn", "b.rtn")[0].reshape(-1, 5, 3)
    slope = np.einsum("k,nki->ni", np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0 / step, place)
    told = truth.rates("a.rtn", "b.rtn")[0][2::5]
    assert np.abs(told - slope).max() < 2e-6  # time from the epoch is rounded to 1e-10 s, 1e-6 m of each
    plane = np.cross(truth.rates("inertial", "a.rtn")[1][2::5] * [1.0, 0.0, 0.0], place[:, 2])
    assert np.linalg.norm(plane, axis=1).max() > 3e-4


def test_commands_do_not_ask_dynamics_beyond_the_flash():
    asked = []

    def drift(t, x, u):
        asked.append(t)
        return np.concatenate([x[3:6], [0.0, 0.0, u[0]]])

    model = rl.motion.StateSpace(
        dynamics=drift, initial_state=(0.0, -50.0, 0.0, 0.0, 0.0, 0.0), inputs=(0.1,), axes="rtn", relative_to="chief"
    )
    chief = rl.Kepler(
        epoch_utc=START, semi_major_axis_km=7000.0, eccentricity=0.001, inclination_deg=51.6, raan_deg=0.0,
        argument_of_perigee_deg=0.0, true_anomaly_deg=0.0,
    )  # fmt: skip
    bodies = [motion.Body(name="chief", motion=chief), motion.Body(name="follower", motion=model)]
    truth = motion.truth(bodies, rl.orbit.Epochs(START, np.array([0.0, 10.0])))
    assert min(asked) >= 0.0
    state = truth.states["follower"]
    # thrust of 0.1 m/s2 across the plane turns it by r a / |r x v| = a / v
    turn = truth.rates("inertial", "follower.rtn")[1][0, 0]
    assert turn == pytest.approx(0.1 / np.linalg.norm(state.velocity_m_s[0]), rel=1e-4)
