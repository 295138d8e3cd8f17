"""The oracle of `rso_lidar.motion.follower_motion`: products of matrices and vectors by NumPy."""

import numpy as np


def leave_turning_axes(inertial_from_axes, turning, axes_from_body, rate, force):
    """Angular velocities add up: that of the axes, seen in body axes, and that of the body in the axes."""
    body_from_axes = np.swapaxes(axes_from_body, -1, -2)
    total = rate + np.einsum("tij,tj->ti", body_from_axes, turning)
    return inertial_from_axes @ axes_from_body, total, np.einsum("tij,tj->ti", body_from_axes, force)
