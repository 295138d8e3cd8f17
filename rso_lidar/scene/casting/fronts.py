"""Fronts: the planes of the facets that rays meet, which may hide what is behind them."""

from collections.abc import Sequence

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.records import Rays, Truth
from rso_lidar.scene.casting.first_hits import Targets, find_first_hits, gather_targets
from rso_lidar.scene.embree.engine import engine
from rso_lidar.scene.surfaces.surface import Surface

_EDGE_ON = 1e-3  # cosine of incidence; the plane of a facet that is seen so nearly edge-on counts as facing the lidar


def find_fronts(rays: Rays, surfaces: Sequence[Surface], truth: Truth, threads: int | None = None) -> np.ndarray:
    """Find the planes of the facets that rays meet first.

    Parameters
    ----------
    rays : in lidar axes
    surfaces : surfaces of all targets
    truth : where they are at one epoch
    threads : number of threads (None: one for each core). The result is the same to the bit

    Returns
    -------
    (abc, ray) [1/m]: 1/z = a x/z + b y/z + c on the plane, in lidar axes; zeros for a ray that meets nothing.
    """
    casting = engine()
    first = find_first_hits(rays, surfaces, truth, threads, casting)
    _held, targets = gather_targets(tuple(surfaces), casting)
    origin, turn = np.empty((len(surfaces), 3)), np.empty((len(surfaces), 3, 3))
    for k, surface in enumerate(surfaces):
        origin[k], turn[k] = truth.poses.place(surface.name, "lidar")
    fronts = np.zeros((3, len(rays.pixel)))
    project_planes(
        first.ray, first.number, first.facet, first.range_m, packed(rays.direction.T), targets, origin, turn, fronts
    )
    return fronts


@kernel
def project_planes(
    ray: np.ndarray,
    number: np.ndarray,
    facet: np.ndarray,
    range_m: np.ndarray,
    direction: np.ndarray,
    targets: Targets,
    origin: np.ndarray,
    turn: np.ndarray,
    fronts: np.ndarray,
) -> None:
    """Project the planes of facets into the tangent plane.

    Parameters
    ----------
    ray, number, facet, range_m : (hit) columns of `FirstHits`
    direction : (xyz, ray)
    origin, turn : (target, xyz) [m] and (target, xyz, xyz), target_from_lidar
    fronts : (abc, ray), written where rays meet something
    """
    for h in range(len(ray)):
        t, i = number[h], ray[h]
        plane = targets.planes[targets.first_facet[t] + facet[h]]
        distance = plane[3] - plane[0] * origin[t, 0] - plane[1] * origin[t, 1] - plane[2] * origin[t, 2]
        if abs(distance) <= _EDGE_ON * range_m[h]:
            fronts[2, i] = 1.0 / (range_m[h] * direction[2, i])
            continue
        for axis in range(3):
            along = plane[0] * turn[t, 0, axis] + plane[1] * turn[t, 1, axis] + plane[2] * turn[t, 2, axis]
            fronts[axis, i] = along / distance
