"""Two-body motion: elements and states of a conic, Kepler's equation, and Lambert's problem."""
