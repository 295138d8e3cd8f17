"""Attitude laws: orientation and body rate at any epochs."""
