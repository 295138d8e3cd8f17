"""Bounces: paths from the hits of a flash to further points of the surfaces, with the light that takes them.

The laser and the lens are in one place, or nearly. Light therefore takes a path between two points both ways. Each path
begins at a hit, in a direction drawn from the lobe of its material or by the cosine. It ends where that ray first meets a
surface. From there a shadow ray goes to the laser, and another to the lens where the two are apart. A longer path goes on
from there in the same way. Inward light comes from the laser by the path's end and leaves from the hit; this is path
tracing. Outward light comes by the hit and leaves from the path's end; this is light tracing. The same light is found in two
ways: from either end of its path. Multiple importance sampling by the balance heuristic weighs the two (Veach and Guibas,
"Optimally combining sampling techniques for Monte Carlo rendering", SIGGRAPH 1995), so that a narrow lobe at either end adds
little noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rso_lidar.kernels import kernel, packed
from rso_lidar.parallel import run_in_threads
from rso_lidar.pose import rotate_vectors
from rso_lidar.records import Bounces, Hits, Truth
from rso_lidar.scene.bounces.path_starts import draw_numbers, number_facets, start_paths
from rso_lidar.scene.bounces.scattering import LEAST_COSINE, find_lobes, localize_points, scatter_per_sr
from rso_lidar.scene.bounces.segments import find_segments
from rso_lidar.scene.casting.first_hits import split_by_surface
from rso_lidar.scene.casting.local_hits import LocalHits, dot, face_viewer, rotate
from rso_lidar.scene.casting.shadows import find_shadowed
from rso_lidar.scene.materials.lobe import direction_density, draw_directions
from rso_lidar.scene.surfaces.surface import Surface

HITS_PER_PATH = 2.0  # a path takes some ten times as long as a ray of the cast
FEWEST_PATHS = 3000  # of a flash, so that a small target has some in each pixel
_BAND_PATHS = 8192
_FLAT = 1e-6  # of the surface's size: what stands out less is the facet's own plane, rounded
_BLOCK = 4096  # facets at once


def bounce(
    hits: Hits,
    surfaces: Sequence[Surface],
    truth: Truth,
    key: np.ndarray,
    threads: int | None = None,
    *,
    laser_from_m: ArrayLike | None = None,
    n_paths: int | None = None,
    most: int = 2,
) -> Bounces:
    """Draw paths of light from the hits of a flash to further points of the surfaces.

    Parameters
    ----------
    hits : first facets that rays meet
    surfaces : the surfaces of all targets, each in its own axes
    truth : where the surfaces are
    key : (2) uint32, key of the frame's random words (`philox.draw_key`)
    threads : number of threads (None: one for each core). The result is the same to the bit

    Other Parameters
    ----------------
    laser_from_m : (xyz), position of the laser in lidar axes [m]; None or zeros is in the lens
    n_paths : number of paths that begin (None: half of the hits, at least 3000)
    most : surfaces that light meets at most; each path ends at its second, third, ... point, as often as light can

    Returns
    -------
    The paths that light can take, one for each end; those that meet nothing, or nothing lit, are left out.
    """
    surfaces = tuple(surfaces)
    laser = np.zeros(3) if laser_from_m is None else np.asarray(laser_from_m, dtype=float)
    number, facet = number_facets(hits, surfaces)
    direction = hits.rays.direction[hits.ray]
    wanted = max(int(len(number) / HITS_PER_PATH), FEWEST_PATHS) if n_paths is None else n_paths
    hit, uniform, share = start_paths(hits, _can_send(surfaces, truth, number, facet, direction), key, wanted)
    numbers = np.empty((most - 1, 3, len(hit)))
    numbers[:1] = uniform
    for leg in range(1, most - 1):
        draw_numbers(packed(hits.pixel[hit]), key, leg, numbers[leg])
    paths = _Paths(hits, surfaces, truth, laser, number[hit], facet[hit], direction[hit], hit, numbers)
    bands = [np.arange(a, min(a + _BAND_PATHS, len(hit))) for a in range(0, len(hit), _BAND_PATHS)]
    run_in_threads(threads, paths.follow, bands)
    return paths.collect(share)


def _can_send(
    surfaces: tuple[Surface, ...], truth: Truth, number: np.ndarray, facet: np.ndarray, direction: np.ndarray
) -> np.ndarray:
    """Return whether a path from each hit (hit) can meet another surface.

    Parameters
    ----------
    number, facet : (hit) numbers of the surface and of its facet
    direction : (hit, xyz) of the rays, in lidar axes
    """
    can = np.zeros(len(number), bool)
    for k, on in split_by_surface(number, len(surfaces)):
        openings = find_openings(surfaces, k, truth)
        if openings.any():
            _, turn = truth.poses.place(surfaces[k].name, "lidar")
            along = packed(direction[on].T)
            can[on] = mark_open(along, packed(facet[on]), packed(turn), packed(surfaces[k].planes), openings)
    return can


class _Throughput(NamedTuple):
    """What paths have met before the point from which they go on (path).

    `inward` and `outward` are the products of BRDF and cosine over density at all points before. `reverse` is the
    density of drawing the path from its other end over that of drawing it from the hit, except for the range and the
    cosines of both ends. `length_m` is the way from the hit [m].
    """

    inward: np.ndarray
    outward: np.ndarray
    reverse: np.ndarray
    length_m: np.ndarray

    def only(self, some: np.ndarray) -> _Throughput:
        """Return that of a selection of the paths."""
        return _Throughput(*(values[some] for values in self))


class _Paths:
    """The paths of one flash while they are followed, band by band; each band fills its own entries of the results.

    Results are (leg, path): those of a path that ends with its first leg, at its second point, with its second, and so on.
    """

    def __init__(
        self,
        hits: Hits,
        surfaces: tuple[Surface, ...],
        truth: Truth,
        laser_from_m: np.ndarray,
        number: np.ndarray,
        facet: np.ndarray,
        direction: np.ndarray,
        hit: np.ndarray,
        numbers: np.ndarray,
    ) -> None:
        """Prepare the paths.

        Parameters
        ----------
        hits, surfaces, truth, laser_from_m : as for `bounce`
        number, facet, direction : (path) of the hit where each path begins
        hit : as `start_paths` returns it
        numbers : (leg, 3, path) from 0 to 1, for the direction from each point of the paths
        """
        self.hits, self.surfaces, self.truth, self.laser_from_m = hits, surfaces, truth, laser_from_m
        self.number, self.facet, self.direction, self.hit, self.numbers = number, facet, direction, hit, numbers
        shape = len(numbers), len(hit)
        self.first_seen, self.first_m = np.zeros(len(hit)), hits.range_m[hit]
        self.end = np.zeros((*shape, 3))
        self.range_m, self.between_m = np.zeros(shape), np.zeros(shape)
        self.inward, self.outward, self.reverse = np.zeros(shape), np.zeros(shape), np.zeros(shape)

    def follow(self, band: np.ndarray) -> None:
        """Follow the paths numbered `band`."""
        for k, on in split_by_surface(self.number[band], len(self.surfaces)):
            path = band[on]
            place = self.direction[path], self.facet[path], self.first_m[path]
            starts = localize_points(self.surfaces, k, self.truth, *place)
            self.first_seen[path] = dot(starts.facing, starts.to_viewer)
            nothing = _Throughput(np.ones(len(path)), np.ones(len(path)), np.ones(len(path)), np.zeros(len(path)))
            self._leave(0, path, starts, nothing)

    def _leave(self, leg: int, path: np.ndarray, starts: LocalHits, light: _Throughput) -> None:
        """Follow paths from points of one surface to where they end, and on from there."""
        lobes = find_lobes(starts)
        about = packed(lobes), packed(starts.base), packed(starts.normal)
        toward = draw_directions(packed(self.numbers[leg][:, path]), *about, packed(starts.to_viewer))
        density = direction_density(toward, *about, packed(starts.to_viewer))
        begins = (dot(starts.facing, toward) > 0.0) & (density > 0.0)
        segments = find_segments(starts, toward, begins)
        arrived = np.flatnonzero(segments.number >= 0)
        for end, of in split_by_surface(segments.number[arrived], len(self.surfaces)):
            on = arrived[of]
            there = starts.point[:, on] + segments.length_m[on] * toward[:, on]
            passed = self._pass(leg, starts.only(on), toward[:, on], density[on], light.only(on), segments.length_m[on])
            self._arrive(leg, path[on], starts, end, segments.facet[on], there, toward[:, on], passed)

    def _pass(
        self,
        leg: int,
        points: LocalHits,
        toward: np.ndarray,
        density: np.ndarray,
        light: _Throughput,
        length_m: np.ndarray,
    ) -> _Throughput:
        """Return the light of paths after points, which are given as the lens or the point before sees them.

        Parameters
        ----------
        toward : (xyz, path) unit vectors, in the surface's axes
        density : (path) with which they were drawn [1/sr]
        length_m : (path) of the leg [m]
        """
        leaving, seen = dot(points.facing, toward), dot(points.facing, points.to_viewer)
        source, reverse = points.to_viewer, light.reverse
        if leg == 0 and self.laser_from_m.any():
            source, _ = self._to_laser(points)
        out_of = scatter_per_sr(points, toward, points.to_viewer)
        into = out_of if source is points.to_viewer else scatter_per_sr(points, source, toward)
        # Interpolated normals change the cosine of the light that comes in, not that of the area it leaves (Veach 1996).
        lit = _cosine(points.base, source) * leaving / np.maximum(seen, LEAST_COSINE)
        if leg > 0:
            lobes = find_lobes(points)
            about = packed(lobes), packed(points.base), packed(points.normal), packed(toward)
            reverse = reverse * direction_density(packed(points.to_viewer), *about) / np.maximum(seen, LEAST_COSINE)
        return _Throughput(
            light.inward * out_of * _cosine(points.base, toward) / density,
            light.outward * into * lit / density,
            reverse * leaving / density,
            light.length_m + length_m,
        )

    def _arrive(
        self,
        leg: int,
        path: np.ndarray,
        starts: LocalHits,
        end: int,
        facet: np.ndarray,
        there: np.ndarray,
        toward: np.ndarray,
        light: _Throughput,
    ) -> None:
        """Join the points where paths arrive to the laser and the lens, and let longer paths go on.

        Parameters
        ----------
        end, facet : number of the surface where they arrive, and of its facets (path)
        there, toward : (xyz, path) the points [m] and the directions to them, in the axes of the surface that they leave
        """
        place = self.truth.poses.place("lidar", starts.surface.name)
        away = place[0][:, None] + rotate(place, there)
        range_m = np.sqrt(dot(away, away))
        direction = (away / range_m).T
        ends = localize_points(self.surfaces, end, self.truth, direction, facet, range_m)
        along = rotate(self.truth.poses.place(ends.surface.name, starts.surface.name), toward)
        self.end[leg, path], self.range_m[leg, path], self.between_m[leg, path] = direction, range_m, light.length_m
        self._join(leg, path, ends, -along, light, range_m)
        if leg + 1 < len(self.numbers):
            cosine = np.abs(dot(ends.surface.planes[:3, facet], along))
            onward = face_viewer(self.surfaces, end, self.truth, facet, ends.point, along, cosine)
            self._leave(leg + 1, path, onward, light)

    def _join(
        self,
        leg: int,
        path: np.ndarray,
        ends: LocalHits,
        back: np.ndarray,
        light: _Throughput,
        end_range_m: np.ndarray,
    ) -> None:
        """Compute the light of paths that end at points, which are given as the lens sees them.

        Parameters
        ----------
        back : (xyz, path) direction to the point before, in the surface's axes
        end_range_m : (path) distance of the ends from the lidar [m]
        """
        end_leaving, end_seen = dot(ends.facing, back), dot(ends.facing, ends.to_viewer)
        beside = bool(self.laser_from_m.any())
        end_laser, end_laser_m = ends.to_viewer, end_range_m
        if beside:
            end_laser, end_laser_m = self._to_laser(ends)
        out_of_end = scatter_per_sr(ends, back, ends.to_viewer)
        into_end = scatter_per_sr(ends, end_laser, back) if beside else out_of_end
        inward = light.inward * into_end * _cosine(ends.base, end_laser)
        left = _cosine(ends.base, back) * end_seen / np.maximum(end_leaving, LEAST_COSINE)
        outward = light.outward * out_of_end * left
        if beside:
            outward[self.hits.cos_incidence[self.hit[path]] <= 0.0] = 0.0
        hidden = np.zeros(len(path), bool)
        hidden[find_shadowed(ends, (outward > 0.0) | (inward > 0.0), ends.to_viewer, end_range_m)] = True
        outward[hidden] = 0.0
        if beside:
            inward[find_shadowed(ends, inward > 0.0, end_laser, end_laser_m)] = 0.0
        else:
            inward[hidden] = 0.0
        lobes = find_lobes(ends)
        about = packed(lobes), packed(ends.base), packed(ends.normal), packed(ends.to_viewer)
        reverse = light.reverse * direction_density(packed(back), *about) * end_seen * self.first_m[path] ** 2
        forward = end_leaving * self.first_seen[path] * end_range_m**2
        is_seen = ~hidden & (forward > 0.0) & (reverse > 0.0)
        self.inward[leg, path], self.outward[leg, path] = inward, outward
        self.reverse[leg, path] = np.where(is_seen, reverse / np.where(forward > 0.0, forward, 1.0), 0.0)

    def _to_laser(self, points: LocalHits) -> tuple[np.ndarray, np.ndarray]:
        """Return the unit vectors (xyz, path) to the laser, in the surface's axes, and its distance (path) [m]."""
        origin, turn = points.target_from_lidar
        away = (origin + rotate_vectors(turn, self.laser_from_m))[:, None] - points.point
        distance_m = np.sqrt(dot(away, away))
        return away / distance_m, distance_m

    def collect(self, share: float) -> Bounces:
        """Return the paths with light, ordered by their hit."""
        path, leg = np.nonzero(((self.inward > 0.0) | (self.outward > 0.0)).T)
        return Bounces(
            pixel_share=share,
            hit=self.hit[path],
            direction=self.end[leg, path],
            range_m=self.range_m[leg, path],
            between_m=self.between_m[leg, path],
            inward_per_sr=self.inward[leg, path],
            outward_per_sr=self.outward[leg, path],
            reverse_density=self.reverse[leg, path],
        )


def _cosine(normal: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return the cosines (path) of the angles between vectors (xyz, path), at least 0."""
    cosine: np.ndarray = np.clip(dot(normal, direction), 0.0, 1.0)
    return cosine


def find_openings(surfaces: Sequence[Surface], number: int, truth: Truth) -> np.ndarray:
    """Find the sides of facets in front of which anything lies: another part of the surface, or another surface.

    A facet of a convex body lights nothing, so no path begins there. Other surfaces count by their bounding sphere.

    Returns
    -------
    (2, facet) whether anything lies in front of the side to which the plane's normal points, and of the other side.
    """
    surface = surfaces[number]
    opening = _own_openings(surface).copy()
    x, y, z, offset = surface.planes
    for k, other in enumerate(surfaces):
        if k != number:
            centre, radius = other.sphere
            place, turn = truth.poses.place(surface.name, other.name)
            a, b, c = place + turn @ centre
            ahead = a * x + b * y + c * z - offset
            opening[0] |= ahead + radius > 0.0
            opening[1] |= ahead - radius < 0.0
    return opening


@lru_cache(maxsize=64)
def _own_openings(surface: Surface) -> np.ndarray:
    """Return the openings (2, facet) of a surface that is alone."""
    normal, offset = surface.planes[:3], surface.planes[3]
    opening = np.empty((2, len(offset)), bool)
    flat = _FLAT * (surface.sphere[1] + float(np.linalg.norm(surface.sphere[0])))
    for start in range(0, len(offset), _BLOCK):
        block = slice(start, start + _BLOCK)
        ahead = normal[:, block].T @ surface.outline.T - offset[block, None]
        opening[0, block] = ahead.max(axis=1) > flat
        opening[1, block] = ahead.min(axis=1) < -flat
    return opening


@kernel
def mark_open(
    direction: np.ndarray, facet: np.ndarray, turn: np.ndarray, planes: np.ndarray, openings: np.ndarray
) -> np.ndarray:
    """Return whether anything lies in front of the side of its facet that each ray meets (hit).

    Parameters
    ----------
    direction : (xyz, hit) unit vectors of the rays, in lidar axes
    facet : (hit) number of the facet
    turn : (xyz, xyz) rotation body_from_lidar
    planes : (4, facet) planes of the facets
    openings : (2, facet) as `find_openings` returns them
    """
    is_open = np.empty(len(facet), np.bool_)
    for k in range(len(facet)):
        f = facet[k]
        toward = 0.0
        for axis in range(3):
            row = turn[axis]
            along = row[0] * direction[0, k] + row[1] * direction[1, k] + row[2] * direction[2, k]
            toward += planes[axis, f] * along
        is_open[k] = openings[1, f] if toward > 0.0 else openings[0, f]
    return is_open
