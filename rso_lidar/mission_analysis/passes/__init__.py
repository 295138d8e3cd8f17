"""Passes of catalogued objects near a follower, and what a lidar could see of them."""
