"""Tables and curves drawn: orbits, angles, tracks and model cards, one figure each."""
