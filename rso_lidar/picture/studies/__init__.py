"""Figures of studies: budgets, trades, encounters, timelines and dispersions."""
