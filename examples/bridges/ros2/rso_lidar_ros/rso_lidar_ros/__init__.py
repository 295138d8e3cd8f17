"""A simulated flash LiDAR as a ROS 2 node. `messages.py` runs in another Python, beside `node.py`."""
