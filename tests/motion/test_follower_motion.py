"""The motion that sensors measure: attitudes and rates in turning axes, referred to inertial axes."""

import numpy as np
from scipy.spatial.transform import Rotation

from rso_lidar.motion import follower_motion
from tests.reference.motion import follower_motion as reference


def test_turning_axes_are_left_as_by_matrix_products():
    rng = np.random.default_rng(2)
    outer, inner = (Rotation.random(6, rng=rng).as_matrix() for _ in range(2))
    turning, rate, force = rng.normal(size=(3, 6, 3))
    found = follower_motion.leave_turning_axes(outer, turning, inner, rate, force)
    for ours, theirs in zip(found, reference.leave_turning_axes(outer, turning, inner, rate, force), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-14)
