"""
How do I get a point cloud into ROS?
====================================

Write an MCAP file or a rosbag2 folder and play it; neither ROS nor this package is needed where it is played.
Writing needs `pip install "rso-lidar[mcap]"`.
"""

import tempfile
from pathlib import Path

import rso_lidar as rl

folder = Path(tempfile.mkdtemp())
scenario = rl.Scenario.load("examples/tumbling_inspection.toml")
path = rl.save(folder / "stage.rosbag2", rl.simulate(scenario, frames=range(3)))
print((path / "metadata.yaml").read_text(encoding="utf-8")[:600])

# %%
# ``ros2 bag play stage.rosbag2`` publishes `/lidar/points` as an organised `sensor_msgs/PointCloud2` in the axes
# `lidar`, range and intensity images, `camera_info`, labels, and the whole tree of axes on `/tf`. Stamps are the
# instants of the flashes.
#
# The points themselves, as an array, without any file:
frame = next(rl.simulate(scenario, frames=[0]))
cloud = frame.points_m[frame.valid]
print(cloud.shape, cloud[:3], sep="\n")

# %%
# A live node: `examples/bridges/ros2`. Topics and messages: :doc:`/exports`.
