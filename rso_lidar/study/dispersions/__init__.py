"""Missions flown many times with errors: what may happen, and with which probability."""
