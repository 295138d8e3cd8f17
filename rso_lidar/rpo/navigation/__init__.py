"""Relative navigation on the way: sensors with limits, and the Kalman filter that guidance takes its estimate from."""
