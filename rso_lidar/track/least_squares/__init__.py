"""Batch least squares: an orbit from GNSS, and a relative orbit from ranges and lines of sight."""
