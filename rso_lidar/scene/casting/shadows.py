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
    Numbers of the hits in shadow (shadowed), ascending.
    """
    left_m = np.where(asked, reach_m, 0.0)
    _cut_hit_rays(left_m, hits, toward, engine().occluded)
    return np.flatnonzero(left_m < 0.0)


def find_occluders_m(hits: LocalHits, asked: np.ndarray, toward: np.ndarray) -> np.ndarray:
    """Find how far from hits the first surface on the way to the light is.

    Parameters
    ----------
    asked : (hit) mask of the hits to test
    toward : (xyz, hit), unit vectors to the light, in the surface's axes

    Returns
    -------
    (hit) distance [m]; infinite where nothing is on the way, 0 for hits that are not tested.
    """
    left_m = np.where(asked, np.inf, 0.0)
    _cut_hit_rays(left_m, hits, toward, engine().intersect)
    return left_m


def _cut_hit_rays(left_m: np.ndarray, hits: LocalHits, toward: np.ndarray, question: int) -> None:
    """Cut rays from hits where they meet surfaces, as `cut_rays` does, over all surfaces.

    Parameters
    ----------
    left_m : (hit) length of the rays [m], written
    toward : (xyz, hit) unit vectors, in the surface's axes
    question : address of embree's query
    """
    centre, radius = hits.surface.sphere
    off_m = OFF_THE_FACET * (radius + float(np.linalg.norm(centre)))
    embree = engine()
    rays = packed(hits.point), packed(hits.facing), off_m, packed(toward)
    for number, other in enumerate(hits.surfaces):
        origin, turn = np.zeros(3), np.eye(3)
        if number != hits.number:
            origin, turn = hits.truth.poses.place(other.name, hits.surface.name)
        scene, sphere = other.scene(embree), np.append(*other.sphere)
        cut_rays(left_m, *rays, packed(origin), packed(turn), packed(sphere), question, scene.address, embree.width)
        embree.check()


@kernel
def cut_rays(
    left: np.ndarray,
    point: np.ndarray,
    facing: np.ndarray,
    off: float,
    toward: np.ndarray,
    origin: np.ndarray,
    turn: np.ndarray,
    sphere: np.ndarray,
    question: int,
    scene: int,
    width: int,
) -> None:
    """Cut rays where they meet a surface.

    Like the lidar's rays, these start just before the bounding sphere, where float32 is fine enough.

    Parameters
    ----------
    left : (ray), length of the rays [m]; a ray of no length is not tested. A ray that meets the surface is cut there by
        embree's query for the first hit, and becomes minus infinity by that for any hit
    point, facing, toward : (xyz, ray), where rays start [m], the facet's normal there, and their direction, in the axes of
        the surface that is lit
    off : how far along `facing` rays start from the point [m]
    origin, turn : pose of those axes in the axes of the surface that is tested
    sphere : centre and radius of its bounding sphere [m]
    question, scene : addresses of embree's query and of the surface's acceleration structure
    width : number of rays in a packet
    """
    words = make_packet(width)
    values = words.view(np.float32)[BEFORE:]
    rays, start, along = np.empty(width, np.int64), np.empty(3), np.empty(3)
    sent, before = np.empty(width, np.float32), np.empty(width)
    wide = 1.01 * sphere[3]
    count, n = 0, len(left)
    for i in range(n):
        if left[i] > 0.0:
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
            if centre2 - ahead * ahead <= wide * wide + 1e-4 and ahead > -wide and skipped < left[i]:
                for axis in range(3):
                    values[(START + axis) * width + count] = start[axis] + skipped * along[axis]
                    values[(ALONG + axis) * width + count] = along[axis]
                values[FAR * width + count] = left[i] - skipped
                rays[count], sent[count], before[count] = i, values[FAR * width + count], skipped
                count += 1
        if count == width or (i == n - 1 and count > 0):
            ask(question, scene, words, width, count)
            for k in range(count):
                cut = values[FAR * width + k]
                if cut < sent[k]:
                    left[rays[k]] = before[k] + cut  # minus infinity for any hit
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
    left = np.full(n, np.inf) if reach_m is None else np.array(reach_m, dtype=float)
    nowhere, along = packed(np.zeros((3, n))), packed(np.asarray(direction, dtype=float).T)
    embree = engine()
    for surface in surfaces if n else ():
        origin, turn = truth.poses.place(surface.name, "lidar")
        scene, sphere = surface.scene(embree), np.append(*surface.sphere)
        placed = packed(np.asarray(origin)), packed(np.asarray(turn)), packed(sphere)
        cut_rays(left, nowhere, nowhere, 0.0, along, *placed, embree.occluded, scene.address, embree.width)
        embree.check()
    met: np.ndarray = left < 0.0
    return met
