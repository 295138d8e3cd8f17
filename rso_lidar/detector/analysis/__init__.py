"""Analysis of the shipped detectors: loads of the array, closed forms and descriptions."""
