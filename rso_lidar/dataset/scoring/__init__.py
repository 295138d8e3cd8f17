"""Scores of predictions on a dataset: figures of merit with intervals, curves, reports, and comparisons of algorithms."""
