"""Fly a flash LiDAR past a satellite before you build one."""
