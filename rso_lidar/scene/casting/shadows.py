"""Shadows: points from which a surface hides the light."""

from collections.abc import Sequence

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.records import Truth
from rso_lidar.scene.casting.local_hits import LocalHits
from rso_lidar.scene.embree.engine import engine
from rso_lidar.scene.embree.packets import ALONG, BEFORE, FAR, START, ask, make_packet
from rso_lidar.scene.surfaces.surface import Surface

OFF_THE_FACET = 1e-5  # of the surface's size: a hundred float32 steps, so that no facet shades itself


def find_shadowed(hits: LocalHits, asked: np.ndarray, toward: np.ndarray, reach_m: np.ndarray) -> np.ndarray:
    """Find the hits in shadow: those from which a ray toward the light meets a surface.

    Parameters
    ----------
    asked : (hit) mask of the hits to test
    toward : (xyz, hit), unit vectors to the light, in the surface's axes
    reach_m : (hit), distance of the light [m]

    Returns
    -------
    (hit) whether it is in shadow; False for hits that are not tested.
    """
    centre, radius = hits.surface.sphere
    off_m = OFF_THE_FACET * (radius + float(np.linalg.norm(centre)))
    embree = engine()
    met = np.zeros(len(asked), dtype=bool)
    rays = packed(asked), packed(hits.point), packed(hits.facing), off_m, packed(toward), packed(reach_m)
    for number, other in enumerate(hits.surfaces):
        origin, turn = np.zeros(3), np.eye(3)
        if number != hits.number:
            origin, turn = hits.truth.poses.place(other.name, hits.surface.name)
        scene, sphere = other.scene(embree), np.append(*other.sphere)
        placed = packed(origin), packed(turn), packed(sphere)
        mark_shadowed(met, *rays, *placed, embree.occluded, scene.address, embree.width)
        embree.check()
    return np.flatnonzero(met)


@kernel
def mark_shadowed(
    met: np.ndarray,
    asked: np.ndarray,
    point: np.ndarray,
    facing: np.ndarray,
    off: float,
    toward: np.ndarray,
    reach: np.ndarray,
    origin: np.ndarray,
    turn: np.ndarray,
    sphere: np.ndarray,
    question: int,
    scene: int,
    width: int,
) -> None:
    """Mark the rays that meet a surface within their reach.

    Like the lidar's rays, these start just before the bounding sphere, where float32 is fine enough.

    Parameters
    ----------
    met : (ray) bool, in which rays that meet the surface are set. Rays already set are not tested again
    asked : (ray) bool, mask of the rays to test
    point, facing, toward : (xyz, ray), where rays start [m], the facet's normal there, and their direction, in the axes of
        the surface that is lit
    off : how far along `facing` rays start from the point [m]
    reach : (ray), length of the rays [m]
    origin, turn : pose of those axes in the axes of the surface that is tested
    sphere : centre and radius of its bounding sphere [m]
    """
    words = make_packet(width)
    values = words.view(np.float32)[BEFORE:]
    rays, start, along = np.empty(width, np.int64), np.empty(3), np.empty(3)
    wide = 1.01 * sphere[3]
    count, n = 0, len(met)
    for i in range(n):
        if asked[i] and not met[i]:
            x, y, z = (
                point[0, i] + off * facing[0, i],
                point[1, i] + off * facing[1, i],
                point[2, i] + off * facing[2, i],
            )
            ahead = centre2 = 0.0
            for axis in range(3):
                row = turn[axis]
                start[axis] = origin[axis] + (row[0] * x + row[1] * y + row[2] * z)
                along[axis] = row[0] * toward[0, i] + row[1] * toward[1, i] + row[2] * toward[2, i]
                to_centre = sphere[axis] - start[axis]
                ahead += to_centre * along[axis]
                centre2 += to_centre * to_centre
            skipped = max(ahead - wide - 0.01, 0.0)
            if centre2 - ahead * ahead <= wide * wide + 1e-4 and ahead > -wide and skipped < reach[i]:
                for axis in range(3):
                    values[(START + axis) * width + count] = start[axis] + skipped * along[axis]
                    values[(ALONG + axis) * width + count] = along[axis]
                values[FAR * width + count] = reach[i] - skipped
                rays[count] = i
                count += 1
        if count == width or (i == n - 1 and count > 0):
            ask(question, scene, words, width, count)
            for k in range(count):
                met[rays[k]] = values[FAR * width + k] < 0.0  # embree reports an occluder by minus infinity
            count = 0


def find_hidden(
    direction: np.ndarray, surfaces: Sequence[Surface], truth: Truth, reach_m: np.ndarray | None = None
) -> np.ndarray:
    """Find the directions from the lidar's origin that meet a target.

    Parameters
    ----------
    direction : (ray, xyz) unit vectors in lidar axes
    surfaces : the surfaces of all targets, each in its own axes
    truth : where the surfaces are
    reach_m : (ray), distance to which each ray goes [m] (None: without end)

    Returns
    -------
    (ray) bool, whether a target hides what is there.
    """
    n = len(direction)
    met, asked = np.zeros(n, dtype=bool), np.ones(n, dtype=bool)
    nowhere, along = packed(np.zeros((3, n))), packed(np.asarray(direction, dtype=float).T)
    reach = packed(np.full(n, np.inf) if reach_m is None else reach_m)
    embree = engine()
    for surface in surfaces if n else ():
        origin, turn = truth.poses.place(surface.name, "lidar")
        scene, sphere = surface.scene(embree), np.append(*surface.sphere)
        rays = packed(asked), nowhere, nowhere, 0.0, along, reach
        placed = packed(np.asarray(origin)), packed(np.asarray(turn)), packed(sphere)
        mark_shadowed(met, *rays, *placed, embree.occluded, scene.address, embree.width)
        embree.check()
    return met
