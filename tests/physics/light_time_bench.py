"""A bench for light time: a plate and a lidar that move at constant velocity, in a world without an Earth."""

import datetime

import numpy as np

import rso_lidar as rl
from rso_lidar import motion

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
AHEAD_M = 50_000.0


def coast(time_s, state, inputs):
    """Return the derivatives of position and velocity without force."""
    return np.concatenate([state[3:], np.zeros(3)])


def moving(position_m, velocity_m_s):
    """Return a motion of constant velocity on the bench."""
    state = (*map(float, position_m), *map(float, velocity_m_s))
    return rl.motion.StateSpace(axes="local", dynamics=coast, initial_state=state)


def bench(position_m, velocity_m_s, *, attitude=None, lidar_m_s=(0, 0, 0), turning=None, light_time=True, **world):
    """Return a mission of a plate before a lidar at the origin, whose boresight is +x of the root axes."""
    return rl.Scenario(
        version=1,
        name="light time",
        world={"axes": "local", "light_time": light_time} | world,
        time={"start_utc": START, "duration_s": 1, "frame_rate_hz": 1},
        target=[
            {
                "name": "plate",
                "model": "plate",
                "scale": 40.0,
                "motion": moving(position_m, velocity_m_s),
                "attitude": attitude,
            }
        ],
        follower={"motion": moving((0, 0, 0), lidar_m_s), "attitude": turning},
        lidar={
            "laser": {"energy_mj": 5e4, "divergence_deg": 0.5},
            "receiver": {"fov_deg": 0.5, "f_number": 2.8, "n_rows": 16, "n_cols": 16, "rays_per_pixel": 1},
        },
    )


def at_emission(scenario):
    """Return the truth of the first flash."""
    return rl.Simulation(scenario).advance().truth


def place(scenario):
    """Return where the plate stands in lidar axes [m] for casting, and how it is turned."""
    return scenario.apply_light_time(at_emission(scenario)).poses.place("lidar", "plate")


def with_lidar(truth):
    """Return a truth with a lidar on its follower."""
    poses = motion.add_lidar(truth.poses, None, np.zeros(2), np.zeros(2), motion.Mount())
    return rl.records.Truth(truth.time_s, poses, truth.states, truth.sun_direction)
