"""Many states side by side against the propagator of one, which is validated elsewhere."""

import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.errors import PropagationError
from rso_lidar.orbit import propagate_two_body
from rso_lidar.orbit.two_body.many_states import propagate_many


def draw_states(count):
    """Return random elliptic states, from circular to e = 0.9."""
    rng = np.random.default_rng(2)
    position = rng.normal(size=(count, 3))
    position *= (rng.uniform(7e6, 4e7, count) / np.linalg.norm(position, axis=1))[:, None]
    velocity = rng.normal(size=(count, 3))
    speed = np.sqrt(units.EARTH_GM_M3_S2 / np.linalg.norm(position, axis=1)) * rng.uniform(0.6, 1.3, count)
    velocity *= (speed / np.linalg.norm(velocity, axis=1))[:, None]
    return position, velocity


def test_each_state_flies_as_it_does_alone():
    position, velocity = draw_states(40)
    time_s = np.linspace(-20_000.0, 20_000.0, 9)
    places, speeds = propagate_many(position, velocity, np.broadcast_to(time_s, (40, 9)))
    for k in range(40):
        place, speed = propagate_two_body(position[k], velocity[k], time_s)
        assert places[k] == pytest.approx(place, abs=1e-4)
        assert speeds[k] == pytest.approx(speed, abs=1e-7)


def test_one_instant_for_each_state():
    position, velocity = draw_states(5)
    time_s = np.array([0.0, 10.0, -10.0, 5000.0, 1.0])
    places, speeds = propagate_many(position, velocity, time_s)
    assert places[0] == pytest.approx(position[0], abs=1e-7)
    assert speeds[0] == pytest.approx(velocity[0], abs=1e-10)
    for k in range(5):
        assert places[k] == pytest.approx(
            propagate_two_body(position[k], velocity[k], time_s[k : k + 1])[0][0], abs=1e-4
        )


def test_a_quarter_of_a_circle():
    radius = 42_164e3
    speed = math.sqrt(units.EARTH_GM_M3_S2 / radius)
    there, _ = propagate_many(
        np.array([[radius, 0.0, 0.0]]), np.array([[0.0, speed, 0.0]]), np.array([0.5 * math.pi * radius / speed])
    )
    assert there[0] == pytest.approx([0.0, radius, 0.0], abs=1e-6)


def test_open_orbits_are_refused_and_named():
    position, velocity = draw_states(3)
    velocity[1] *= 3.0
    with pytest.raises(PropagationError, match=r"^states: 1 of 3 are not on an ellipse") as caught:
        propagate_many(position, velocity, np.zeros(3))
    assert caught.value.bad.tolist() == [False, True, False]
