"""What targets hide of the sky: directions from the lens that meet a surface."""

from collections.abc import Sequence

import numpy as np

from rso_lidar.kernels import packed
from rso_lidar.records import Truth
from rso_lidar.scene.casting.shadows import mark_shadowed
from rso_lidar.scene.embree.engine import engine
from rso_lidar.scene.surfaces.surface import Surface


def find_hidden(direction: np.ndarray, surfaces: Sequence[Surface], truth: Truth) -> np.ndarray:
    """Find the directions from the lidar's origin that meet a target.

    Parameters
    ----------
    direction : (ray, xyz) unit vectors in lidar axes
    surfaces : the surfaces of all targets, each in its own axes
    truth : where the surfaces are

    Returns
    -------
    (ray) bool, whether a target hides what is there.
    """
    n = len(direction)
    met, asked = np.zeros(n, dtype=bool), np.ones(n, dtype=bool)
    nowhere, along = packed(np.zeros((3, n))), packed(np.asarray(direction, dtype=float).T)
    embree = engine()
    for surface in surfaces if n else ():
        origin, turn = truth.poses.place(surface.name, "lidar")
        scene, sphere = surface.scene(embree), np.append(*surface.sphere)
        rays = packed(asked), nowhere, nowhere, 0.0, along, packed(np.full(n, np.inf))
        placed = packed(np.asarray(origin)), packed(np.asarray(turn)), packed(sphere)
        mark_shadowed(met, *rays, *placed, embree.occluded, scene.address, embree.width)
        embree.check()
    return met
