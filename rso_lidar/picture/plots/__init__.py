"""Tables and curves drawn: orbits, angles, trajectories and time curves, one figure each."""
