"""Figures of merit of frames that are not independent: weighted statistics, ranked scores, and a bootstrap of encounters."""
