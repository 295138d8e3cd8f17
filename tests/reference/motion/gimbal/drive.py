"""Both axes of a drive at once, by matrices: the oracle of `rso_lidar.motion.gimbal.drive.advance_first_order` and
`rso_lidar.motion.gimbal.drive.advance_second_order`.
"""

import math

import numpy as np
from scipy.linalg import expm

from rso_lidar.motion import FirstOrder


def advance(response, dt, axes, held):
    """Return (angle, rate) of pan and of tilt after each row of `held` (tick, 2) [rad] was the demand for `dt` [s]."""
    angle, rate = np.array(axes, dtype=float).T
    low, high = np.array(response.travel_rad).T
    most, change = response.max_rate_rad_s, response.max_acceleration_rad_s2 * dt
    for demand in held:
        new_angle, new_rate = transition(response, dt, angle - demand, rate)
        new_angle = new_angle + demand
        # The limits of a first-order drive, which has no inertia, hold for the mean rate over the tick too.
        within = np.abs(new_rate - rate) <= change
        if isinstance(response, FirstOrder):
            within &= np.abs(new_angle - angle) <= most * dt
        else:
            within &= np.abs(new_rate) <= most
        clipped = np.clip(np.clip(new_rate, rate - change, rate + change), -most, most)
        share = 1.0 if isinstance(response, FirstOrder) else 0.5
        moved = angle + dt * (share * clipped + (1.0 - share) * rate)
        angle, rate = np.where(within, new_angle, moved), np.where(within, new_rate, clipped)
        beyond = (angle < low) | (angle > high)
        angle, rate = np.clip(angle, low, high), np.where(beyond, 0.0, rate)
    return tuple(zip(angle.tolist(), rate.tolist(), strict=True))


def transition(response, dt, error, rate):
    """Return the error of the angle and the rate `dt` later, without limits."""
    if isinstance(response, FirstOrder):
        error = error * math.exp(-dt / response.time_constant_s)
        return error, -error / response.time_constant_s
    w = 2.0 * math.pi * response.natural_hz
    return expm(np.array([[0.0, 1.0], [-w * w, -2.0 * response.damping * w]]) * dt) @ [error, rate]
