"""Orbits estimated from a recording, as its spacecraft could: its own from GNSS, and that relative to a target."""
