"""A target's facets in body axes, with their materials, and what is derived from the two."""
