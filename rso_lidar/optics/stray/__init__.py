"""Stray light: ghost images of the lens, and the Sun, the lit Earth and the Moon in or near the field."""
