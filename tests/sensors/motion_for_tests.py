"""Motions of a follower for tests of its sensors."""

import numpy as np

from rso_lidar.records import BodyMotion


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def make_motion(time_s, rng=None, **changes):
    """Return a motion with random values at some instants; without a generator, a body at rest in low orbit."""
    n = len(time_s)
    zero = np.zeros((n, 3))
    if rng is None:
        fields = {
            "position_m": np.tile([7e6, 0.0, 0.0], (n, 1)),
            "velocity_m_s": np.tile([0.0, 7.5e3, 0.0], (n, 1)),
            "quaternion_xyzw": np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)),
            "angular_velocity_rad_s": zero,
            "specific_force_m_s2": zero,
        }
    else:
        fields = {
            "position_m": 7e6 * unit(rng.normal(size=(n, 3))),
            "velocity_m_s": 7.5e3 * unit(rng.normal(size=(n, 3))),
            "quaternion_xyzw": unit(rng.normal(size=(n, 4))),
            "angular_velocity_rad_s": 0.01 * rng.normal(size=(n, 3)),
            "specific_force_m_s2": 0.01 * rng.normal(size=(n, 3)),
            "angular_acceleration_rad_s2": 0.001 * rng.normal(size=(n, 3)),
            "sun_direction": unit(rng.normal(size=(n, 3))),
            "moon_direction": unit(rng.normal(size=(n, 3))),
            "earth_direction": unit(rng.normal(size=(n, 3))),
            "earth_angle_rad": np.full(n, 1.1),
        }
    return BodyMotion(**{"time_s": np.asarray(time_s, float), **fields, **changes})
