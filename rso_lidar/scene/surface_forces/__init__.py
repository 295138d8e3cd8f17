"""Surface forces: sunlight and air on the facets of a target, with the shadows of its own parts, tabulated."""
