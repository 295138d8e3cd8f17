"""Models and materials by name: the shipped catalogue and the user's own."""
