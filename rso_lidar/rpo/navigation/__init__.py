"""Relative navigation for guidance: sensors with limits, and Kalman filters of many flights at once.

`rso_lidar.track.navigation` estimates absolute states from recorded samples of sensors; this room lies below it and cannot
use it.
"""
