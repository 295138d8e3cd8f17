"""Segments in NumPy, by embreex: the oracle of `rso_lidar.scene.bounces.segments`."""

import numpy as np

from rso_lidar.scene.bounces.segments import Segments
from rso_lidar.scene.casting.local_hits import dot, rotate
from rso_lidar.scene.casting.shadows import OFF_THE_FACET


def find_segments(starts, toward, asked):
    """Return the first facet of each path that is `asked` for, of any surface, and its distance on the facet's plane."""
    n = len(starts.facet)
    found = Segments(np.full(n, -1), np.zeros(n, int), np.where(asked, np.inf, 0.0))
    centre, radius = starts.surface.sphere
    lifted = starts.point + OFF_THE_FACET * (radius + np.linalg.norm(centre)) * starts.facing
    for number, other in enumerate(starts.surfaces):
        pose = np.zeros(3), np.eye(3)
        if number != starts.number:
            pose = starts.truth.poses.place(other.name, starts.surface.name)
        begin, along = pose[0][:, None] + rotate(pose, starts.point), rotate(pose, toward)
        sent = np.ascontiguousarray((pose[0][:, None] + rotate(pose, lifted)).T, np.float32)
        facet = other.embree.run(sent, np.ascontiguousarray(along.T, np.float32), query="INTERSECT")
        plane = other.planes[:, facet]
        distance = (plane[3] - dot(plane[:3], begin)) / dot(plane[:3], along)
        nearer = np.flatnonzero((facet >= 0) & (distance > 0.0) & (distance < found.length_m))
        found.number[nearer], found.facet[nearer], found.length_m[nearer] = number, facet[nearer], distance[nearer]
    return found
