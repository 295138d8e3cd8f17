"""Relative navigation: a Kalman filter that combines the lidar with gyros, star trackers and GNSS."""
