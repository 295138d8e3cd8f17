"""
Which axes, and which order of quaternions?
===========================================

Poses are named `a_from_b` and take coordinates in b to coordinates in a. Quaternions are x, y, z, w, everywhere.
"""

import numpy as np

import rso_lidar as rl

frame = next(rl.simulate(rl.Scenario.load("examples/closed_loop.toml"), frames=[0]))
lidar_from_stage = frame.truth.pose("lidar", "stage")
print("position of the stage in lidar axes:", lidar_from_stage.translation)
print("quaternion x, y, z, w:", lidar_from_stage.rotation.as_quat(canonical=True))

# %%
# Lidar axes are the optical axes of ROS (REP-103): +z along the boresight, +x right with the columns, +y down with the
# rows. Body axes are x forward, y left, z up. Inertial axes are GCRS.
points = frame.points_m[frame.valid]
print("points in stage axes:", lidar_from_stage.inv().apply(points)[:2])
print("names of all axes:", sorted(frame.truth.poses))

# %%
# To others: scalar first for MATLAB and Basilisk's Euler parameters, a 4 × 4 matrix, or x forward as ROS bodies have
# it.
x, y, z, w = lidar_from_stage.rotation.as_quat(canonical=True)
print("w, x, y, z:", np.array([w, x, y, z]))
print(lidar_from_stage.as_matrix())
print("x forward, y left, z up:", points[0][[2, 0, 1]] * [1, -1, -1])

# %%
# Rotations and rates: :doc:`/scenario`; what each pose in a file means: :doc:`/records`.
