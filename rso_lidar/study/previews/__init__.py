"""Previews of a scenario without a run: any of its frames, pixels, figures and views in space."""
