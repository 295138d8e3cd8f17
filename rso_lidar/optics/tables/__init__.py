"""Optics described in files: Zemax listings, tables of numbers, measured beams and pulses."""
