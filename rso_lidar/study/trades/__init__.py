"""Which variant of a scenario is best: trade studies and their figures of merit."""
