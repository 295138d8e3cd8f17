"""Recordings in a window: the player of matplotlib, and scenes for the viewer Rerun."""
