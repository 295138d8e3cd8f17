"""Attitude laws: how a body is turned, and how fast, at any epochs."""
