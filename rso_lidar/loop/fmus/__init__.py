"""Functional Mock-up Units in the loop: a simulation written as one, and one as a controller."""
