"""The oracle of `rso_lidar.scene.casting.fronts`: planes through the corners of the facets that are hit."""

import numpy as np

from rso_lidar import scene


def find_fronts(rays, surfaces, truth):
    """Return (abc, ray) of the facets that rays hit: a x/z + b y/z + c = 1/z at each of their corners."""
    hits = scene.cast(rays, surfaces, truth, 1)
    fronts = np.zeros((3, len(rays.pixel)))
    for ray, target, facet in zip(hits.ray, hits.target, hits.facet, strict=True):
        translation, matrix = truth.poses.place("lidar", surfaces[target].name)
        corners = surfaces[target].corners[facet] @ np.asarray(matrix).T + translation
        fronts[:, ray] = np.linalg.solve(corners, np.ones(3))
    return fronts
