"""Geometry and single flashes of a mission at a few of its epochs, without a run."""
