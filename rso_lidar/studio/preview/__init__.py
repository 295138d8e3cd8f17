"""Previews of the studio: single frames, pixels and geometry of a scenario, without a run."""
