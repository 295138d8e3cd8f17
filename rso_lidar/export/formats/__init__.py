"""Frames, poses and tables written in the formats of other tools."""
