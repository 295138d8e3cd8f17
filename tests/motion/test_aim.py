"""From the follower to the lidar with every mount away from its parent and turned, and demands that follow a target."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar.motion.aim import FollowingDemand

PTU = "ptu.mount={position_m=[0.5, 1.2, -0.7], euler_zyx_deg=[30, -20, 40]}"
LIDAR = "lidar.mount={position_m=[0.05, -0.3, 0.2], euler_zyx_deg=[3, -5, 60]}"
NEAR = (
    "target.0.motion.position_m=[9.0, -4.0, 3.0]",
    "follower.motion.position_m=[1.0, 2.0, -0.5]",
    'follower.attitude={type="fixed", euler_zyx_deg=[-15, 25, 70]}',
    'ptu.response={type="ideal"}',
    "ptu.errors.jitter_deg=0",
    "lidar.receiver.n_rows=4",
    "lidar.receiver.n_cols=4",
)


def truth(text, *settings):
    return next(rl.simulate(rl.Scenario.loads(text, settings=(*NEAR, *settings)), frames=[3])).truth


def test_a_ptu_away_from_the_middle_looks_at_its_target(text):
    """Its +x goes through the target, 10 m away, where a lever arm of 1.5 m turns the line by 8 degrees."""
    seen = truth(text, PTU)
    at = seen.pose("ptu", "plate").translation
    mount = np.array([1.0, 2.0, -0.5]) + Rotation.from_euler("ZYX", [-15, 25, 70], degrees=True).apply([0.5, 1.2, -0.7])
    distance = np.linalg.norm(np.array([9.0, -4.0, 3.0]) - mount)
    np.testing.assert_allclose(at, [distance, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(seen.pose("inertial", "ptu").translation, mount, atol=1e-12)


def test_the_lidars_own_mount_is_in_the_ptus_axes(text):
    """ptu_from_lidar = mount · (x forward, y left, z up to x right, y down, z ahead), the mount's place in ptu axes."""
    seen = truth(text, PTU, LIDAR)
    pose = seen.pose("ptu", "lidar")
    np.testing.assert_allclose(pose.translation, [0.05, -0.3, 0.2], atol=1e-12)
    optical = np.array(
        [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    )  # columns: right, down and ahead in ptu axes
    turned = Rotation.from_euler("ZYX", [3, -5, 60], degrees=True).as_matrix() @ optical
    np.testing.assert_allclose(pose.rotation.as_matrix(), turned, atol=1e-12)
    ahead = seen.pose("lidar", "plate").translation[2]
    assert ahead == pytest.approx(turned[:, 2] @ (seen.pose("ptu", "plate").translation - [0.05, -0.3, 0.2]), rel=1e-9)


def test_a_demand_that_follows_begins_at_the_pan_nearest_to_zero():
    """Directions behind the mount are met at the angles of the circle's nearer half; later ones go on without a jump."""
    demand = FollowingDemand(
        lambda time_s: np.stack([np.cos(3.0 + time_s), -np.sin(3.0 + time_s), 0.0 * time_s], axis=-1)
    )
    np.testing.assert_allclose(demand(np.array([0.0, 0.1]))[:, 0], [-3.0, -3.1], atol=1e-12)
    np.testing.assert_allclose(demand(np.array([0.3, 0.5]))[:, 0], [-3.3, -3.5], atol=1e-12)
