"""Analysis of the shipped detectors (array load, closed forms, descriptions), and checks of a user's own."""
