"""Stages of the detector, in the order in which light passes them; each takes its own part."""
