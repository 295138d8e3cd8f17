"""The oracle of `rso_lidar.sensors.inertial`: what a triad measures, with matrices."""

import numpy as np


def measure_triad(truth, sensor_from_body, distortion, limit, resolution, errors, valid):
    """Return the measured values (sample, xyz), and whether they are valid (sample)."""
    scale, angles = distortion[:3], distortion[3:]
    distorted = np.eye(3) + np.diag(scale)
    distorted[~np.eye(3, dtype=bool)] = angles  # row by row
    values = truth @ (distorted @ sensor_from_body).T + errors
    beyond = np.abs(values) > limit
    if resolution:
        values = np.where(beyond, values, resolution * np.rint(values / resolution))
    values = np.where(valid[:, None], np.clip(values, -limit, limit), np.nan)
    return values, valid & ~beyond.any(axis=1)


def add_lever_arm(arm_m, rate, change, force):
    """Return the specific force (sample, xyz) of a point of the body."""
    return force + np.cross(change, arm_m) + np.cross(rate, np.cross(rate, arm_m))
