"""Motion beyond two bodies: J2 mean elements, and numerical integration with forces and maneuvers."""
