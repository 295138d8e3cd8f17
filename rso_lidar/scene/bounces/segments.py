"""Segments: from a point on a surface along any direction to the first facet there."""

from typing import NamedTuple

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.scene.casting.local_hits import LocalHits
from rso_lidar.scene.casting.shadows import OFF_THE_FACET
from rso_lidar.scene.embree.engine import engine
from rso_lidar.scene.embree.packets import ALONG, BEFORE, FACET, FAR, GEOMETRY, NOTHING, START, ask, make_packet


class Segments(NamedTuple):
    """First facet of each path: number of its surface (-1: none), number of the facet, and distance [m] (path)."""

    number: np.ndarray
    facet: np.ndarray
    length_m: np.ndarray


def find_segments(starts: LocalHits, toward: np.ndarray, asked: np.ndarray) -> Segments:
    """Find the first facet of any surface that each path meets.

    Parameters
    ----------
    starts : where the paths begin, on one surface
    toward : (xyz, path), unit vectors in the axes of that surface, on the side of `starts.facing`
    asked : (path) mask of the paths to follow
    """
    n = len(starts.facet)
    centre, radius = starts.surface.sphere
    off_m = OFF_THE_FACET * (radius + float(np.linalg.norm(centre)))
    segments = Segments(np.full(n, -1, np.int16), np.zeros(n, np.int32), np.where(asked, np.inf, 0.0))
    point, facing, toward = packed(starts.point), packed(starts.facing), packed(toward)
    embree = engine()
    for number, other in enumerate(starts.surfaces):
        origin, turn = np.zeros(3), np.eye(3)
        if number != starts.number:
            origin, turn = starts.truth.poses.place(other.name, starts.surface.name)
        scene, sphere = other.scene(embree), np.append(*other.sphere)
        placed = packed(origin), packed(turn), packed(sphere), packed(other.planes)
        asks = embree.intersect, scene.address, embree.width
        meet_surface(
            segments.number, segments.facet, segments.length_m, number, point, facing, off_m, toward, *placed, *asks
        )
        embree.check()
    return segments


@kernel
def meet_surface(
    met: np.ndarray,
    facet: np.ndarray,
    near: np.ndarray,
    number: int,
    point: np.ndarray,
    facing: np.ndarray,
    off: float,
    toward: np.ndarray,
    origin: np.ndarray,
    turn: np.ndarray,
    sphere: np.ndarray,
    planes: np.ndarray,
    question: int,
    scene: int,
    width: int,
) -> None:
    """Find which rays meet a surface nearer than what they have met before.

    As in `shadows`, rays start just off their own facet, or before the bounding sphere of another surface, where float32 is
    fine enough. The distance is that of the facet's plane, in float64.

    Parameters
    ----------
    met, facet, near : (ray) number of the surface that is met, its facet and its distance [m], changed in place
    number : number of the surface that is tested
    point, facing, toward : (xyz, ray), where rays start [m], the facet's normal there, and their direction
    off : how far along `facing` rays start from the point [m]
    origin, turn : pose of those axes in the axes of the surface that is tested
    sphere : centre and radius of its bounding sphere [m]
    planes : (4, facet) planes of its facets
    scene : address of the surface's acceleration structure
    width : number of rays in a packet
    """
    words = make_packet(width)
    words[0] = 0  # neighbouring rays go anywhere
    values = words.view(np.float32)[BEFORE:]
    rays, ahead_of, start, along = np.empty(width, np.int64), np.empty(width), np.empty(3), np.empty(3)
    exact, cosine = np.empty((3, width)), np.empty((3, width))
    wide = 1.01 * sphere[3]
    slack = 1e-3 * (1.0 + 2.0 * sphere[3])
    count, n = 0, len(met)
    for i in range(n):
        beside2 = ahead = 0.0
        for axis in range(3):
            row, at = turn[axis], origin[axis]
            start[axis] = at + (row[0] * point[0, i] + row[1] * point[1, i] + row[2] * point[2, i])
            along[axis] = row[0] * toward[0, i] + row[1] * toward[1, i] + row[2] * toward[2, i]
            to_centre = sphere[axis] - start[axis]
            ahead += to_centre * along[axis]
            beside2 += to_centre * to_centre
        skipped = max(ahead - wide - 0.01, 0.0)
        if beside2 - ahead * ahead <= wide * wide + 1e-4 and ahead > -wide and skipped < near[i]:
            for axis in range(3):
                row = turn[axis]
                lift = off * (row[0] * facing[0, i] + row[1] * facing[1, i] + row[2] * facing[2, i])
                values[(START + axis) * width + count] = start[axis] + lift + skipped * along[axis]
                values[(ALONG + axis) * width + count] = along[axis]
                exact[axis, count], cosine[axis, count] = start[axis], along[axis]
            values[FAR * width + count] = near[i] - skipped
            rays[count], ahead_of[count] = i, skipped
            count += 1
        if count == width or (i == n - 1 and count > 0):
            ask(question, scene, words, width, count)
            for k in range(count):
                if words[BEFORE + GEOMETRY * width + k] == NOTHING:
                    continue
                f = np.int64(words[BEFORE + FACET * width + k])
                a, b, c = planes[0, f], planes[1, f], planes[2, f]
                before = a * exact[0, k] + b * exact[1, k] + c * exact[2, k]
                distance = (planes[3, f] - before) / (a * cosine[0, k] + b * cosine[1, k] + c * cosine[2, k])
                rough = ahead_of[k] + np.float64(values[FAR * width + k])
                if not abs(distance - rough) <= slack:  # seen edge-on, as in `first_hits`
                    distance = rough
                j = rays[k]
                if 0.0 < distance < near[j]:
                    met[j], facet[j], near[j] = number, f, distance
            count = 0
