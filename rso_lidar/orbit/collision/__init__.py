"""Probability of collision of two objects whose states and covariances are known: in a plane, and by Monte Carlo."""
