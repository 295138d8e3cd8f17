"""Shadows in NumPy, by embreex: the oracle of `rso_lidar.scene.casting.shadows`."""

import numpy as np

from rso_lidar.scene import Surface
from rso_lidar.scene.casting.local_hits import LocalHits, dot, rotate
from rso_lidar.scene.casting.shadows import OFF_THE_FACET


def find_shadowed(hits: LocalHits, asked: np.ndarray, toward: np.ndarray, reach_m: np.ndarray) -> np.ndarray:
    """Return the hits, of those asked for, from which a ray `toward` (xyz, hit) meets a surface within its reach [m]."""
    centre, radius = hits.surface.sphere
    off_m = OFF_THE_FACET * (radius + float(np.linalg.norm(centre)))
    index = np.flatnonzero(asked)
    start, toward = hits.point[:, index] + off_m * hits.facing[:, index], toward[:, index]
    shaded = np.zeros(len(index), dtype=bool)
    for number, other in enumerate(hits.surfaces):
        if number == hits.number:
            shaded |= _occluded(other, start, toward, reach_m[index])
        else:
            other_from_here = hits.truth.poses.place(other.name, hits.surface.name)
            there = other_from_here[0][:, None] + rotate(other_from_here, start)
            shaded |= _occluded(other, there, rotate(other_from_here, toward), reach_m[index])
    return index[shaded]


def _occluded(surface: Surface, start: np.ndarray, toward: np.ndarray, reach_m: np.ndarray) -> np.ndarray:
    """Return whether rays (xyz, ray) in a surface's axes meet it within their reach [m]."""
    centre, radius = surface.sphere
    to_centre = centre[:, None] - start
    ahead = dot(to_centre, toward)
    beside2 = dot(to_centre, to_centre) - ahead**2
    met = np.zeros(len(ahead), dtype=bool)
    ray = np.flatnonzero((beside2 <= (1.01 * radius) ** 2 + 1e-4) & (ahead > -1.01 * radius))
    # As the lidar's rays do, these start just before the sphere about the target, where float32 is fine.
    skipped = np.maximum(ahead[ray] - 1.01 * radius - 0.01, 0.0)
    ray, skipped = ray[skipped < reach_m[ray]], skipped[skipped < reach_m[ray]]
    if len(ray):
        near = (start[:, ray] + skipped * toward[:, ray]).T
        left = (reach_m[ray] - skipped).astype(np.float32)
        found = surface.embree.run(
            np.ascontiguousarray(near, np.float32),
            np.ascontiguousarray(toward[:, ray].T, np.float32),
            left,
            query="OCCLUDED",
        )
        met[ray] = found >= 0
    return met
