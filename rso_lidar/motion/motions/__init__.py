"""Motions that are given or integrated, and what a motion of any kind answers."""
