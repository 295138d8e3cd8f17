"""The rotating Earth: its axes and orientation, places on the ground, and when one spacecraft or station sees another."""
