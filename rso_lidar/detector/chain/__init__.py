"""The stages combined: what a detector stores and reports of one flash."""
