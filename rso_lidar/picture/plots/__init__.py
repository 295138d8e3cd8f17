"""Tables and curves drawn: orbits, angles, budgets, encounters, trades and model cards, one figure each."""
