"""First hits: embree finds which facet a ray hits first, and the facet's plane gives the range in float64.

Rays are taken in blocks. Each block is tested against every target whose bounding sphere it may touch. The rays that touch
it go to embree in packets, and the nearest hit of each ray is kept. Blocks begin at fixed places, so that the number of
threads does not change them.
"""

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.parallel import run_in_threads
from rso_lidar.records import Rays, Truth
from rso_lidar.scene.embree.engine import Engine, Scene
from rso_lidar.scene.embree.packets import ALONG, BEFORE, FACET, FAR, GEOMETRY, NOTHING, START, ask, make_packet
from rso_lidar.scene.surfaces.surface import Surface

# Accuracy of a range. A facet through the lidar's own position has no range, and its radiometry would diverge.
NEAREST_M = 1e-6
BAND_RAYS = 8_192  # about 0.5 ms of casting, long compared with starting work on another thread
BLOCK_RAYS = 256
# Layout of a placed target: rotation by rows, position of the lidar, bounding sphere as seen from there, start of rays.
_ORIGIN, _CENTRE, _REACH, _START, _SLACK, _WORDS = 9, 12, 15, 16, 17, 18


class FirstHits(NamedTuple):
    """The first hits of rays, in their order: the columns of `Hits`, and numbers of the surface and its facet (hit)."""

    ray: np.ndarray
    pixel: np.ndarray
    weight: np.ndarray
    target: np.ndarray
    number: np.ndarray
    facet: np.ndarray
    part: np.ndarray
    source_facet: np.ndarray
    range_m: np.ndarray
    cosine: np.ndarray
    brdf_per_sr: np.ndarray


@lru_cache(maxsize=4)
def gather_targets(surfaces: tuple[Surface, ...], engine: Engine) -> "tuple[tuple[Scene, ...], Targets]":
    """Return the acceleration structures of surfaces and the arrays that the kernel reads, once for all frames."""
    scenes = tuple(surface.scene(engine) for surface in surfaces)
    count = np.array([0] + [len(surface.facets) for surface in surfaces], dtype=np.int64)

    def row(columns: list[np.ndarray], dtype: type, shape: tuple[int, ...] = (0,)) -> np.ndarray:
        """Return the columns of all surfaces, joined."""
        return np.concatenate([np.empty(shape), *columns]).astype(dtype)

    return scenes, Targets(
        np.array([scene.address for scene in scenes], dtype=np.int64),
        np.array([[*surface.sphere[0], surface.sphere[1]] for surface in surfaces]).reshape(-1, 4),
        target_numbers(surfaces),
        np.cumsum(count)[:-1],
        row([surface.planes.T for surface in surfaces], np.float64, (0, 4)),
        row([surface.part for surface in surfaces], np.int16),
        row([surface.mesh.source_facet for surface in surfaces], np.int32),
        row([surface.lambertian_per_sr for surface in surfaces], np.float64),
    )


def target_numbers(surfaces: Sequence[Surface]) -> np.ndarray:
    """Return the number of the target that each surface belongs to."""
    of = [k if surface.target is None else surface.target for k, surface in enumerate(surfaces)]
    return np.array(of, dtype=np.int16)


def find_first_hits(
    rays: Rays, surfaces: Sequence[Surface], truth: Truth, threads: int | None, engine: Engine
) -> FirstHits:
    """Find the first hit of each ray on all surfaces; return the columns of the hits, in the order of rays.

    Parameters
    ----------
    rays : the rays, in lidar axes
    surfaces : the surfaces, each in its own axes
    threads : number of bands in parallel (None: one for each core)
    """
    _held, targets = gather_targets(tuple(surfaces), engine)  # embree frees a scene that is not referenced
    origin, turn = np.empty((len(surfaces), 3)), np.empty((len(surfaces), 3, 3))
    for k, surface in enumerate(surfaces):
        origin[k], turn[k] = truth.poses.place(surface.name, "lidar")
    columns = Columns(packed(rays.direction.T), packed(rays.pixel), packed(rays.weight))

    def meet(band: slice) -> tuple[np.ndarray, ...]:
        return cast_rays(columns, band.start, band.stop, targets, origin, turn, engine.intersect, engine.width)

    n_rays = len(rays.pixel)
    bands = [slice(start, min(start + BAND_RAYS, n_rays)) for start in range(0, n_rays, BAND_RAYS)]
    if threads == 1 or len(bands) < 2:
        first = FirstHits(*meet(slice(0, n_rays)))
    else:
        pieces = run_in_threads(threads, meet, bands)
        first = FirstHits(*(np.concatenate(column) for column in zip(*pieces, strict=True)))
    engine.check()
    if not all(surface.is_lambertian for surface in surfaces):
        for k, on in split_by_surface(first.number, len(surfaces)):
            if not surfaces[k].is_lambertian:
                first.brdf_per_sr[on] = surfaces[k].brdf_per_sr(first.facet[on], first.cosine[on])
    return first


def split_by_surface(number: np.ndarray, n_surfaces: int, most: int | None = None) -> list[tuple[int, np.ndarray]]:
    """Group hits by surface, at most `most` together: return the number of the surface, and the hits in order, of each."""
    order, edges = np.arange(len(number)), [0, len(number)]
    if n_surfaces > 1:
        order = np.argsort(number, kind="stable")
        edges = np.searchsorted(number[order], np.arange(n_surfaces + 1)).tolist()
    step = most or max(len(number), 1)
    return [
        (k, order[a : min(a + step, end)])
        for k, (begin, end) in enumerate(pairwise(edges))
        for a in range(begin, end, step)
    ]


class Columns(NamedTuple):
    """Rays: `direction` (xyz, ray), `pixel` and `weight` (ray)."""

    direction: np.ndarray
    pixel: np.ndarray
    weight: np.ndarray


class Targets(NamedTuple):
    """All surfaces: addresses of scenes, bounding spheres (centre, radius), numbers of targets; then the facets of all."""

    scenes: np.ndarray
    sphere: np.ndarray
    number: np.ndarray
    first_facet: np.ndarray
    planes: np.ndarray
    part: np.ndarray
    source_facet: np.ndarray
    matt_per_sr: np.ndarray


@kernel
def place_targets(origin: np.ndarray, turn: np.ndarray, sphere: np.ndarray) -> np.ndarray:
    """Return how targets are placed before the lidar (target, word).

    Parameters
    ----------
    origin, turn : (target, xyz) [m] and (target, xyz, xyz), target_from_lidar
    sphere : (target, 4) centre and radius of the bounding sphere [m]
    """
    words = np.empty((len(origin), _WORDS))
    for t in range(len(origin)):
        word, radius = words[t], sphere[t, 3]
        x, y, z = sphere[t, 0] - origin[t, 0], sphere[t, 1] - origin[t, 1], sphere[t, 2] - origin[t, 2]
        distance = np.sqrt(x * x + y * y + z * z)
        for axis in range(3):
            for other in range(3):
                word[3 * axis + other] = turn[t, axis, other]
            word[_ORIGIN + axis] = origin[t, axis]
            toward = turn[t, 0, axis] * x + turn[t, 1, axis] * y + turn[t, 2, axis] * z
            word[_CENTRE + axis] = toward / distance if distance > 0.0 else 0.0
        word[_REACH] = 2.0
        if distance > radius:
            sine = radius / distance
            word[_REACH] = sine * np.sqrt(2.0 / (1.0 + np.sqrt(1.0 - sine * sine)))
        word[_START] = max(0.0, distance - 1.01 * radius - 0.01)
        word[_SLACK] = 1e-3 * (1.0 + 2.0 * radius)
    return words


@kernel
def bound_rays(direction: np.ndarray, first: int, last: int) -> tuple[float, float, float, float]:
    """Return the centre (x, y, z) of the box about the ends of rays first to last, and half its diagonal.

    Parameters
    ----------
    direction : (xyz, ray) f8, unit vectors
    """
    x0 = y0 = z0 = np.inf
    x1 = y1 = z1 = -np.inf
    for i in range(first, last):
        x0, x1 = min(x0, direction[0, i]), max(x1, direction[0, i])
        y0, y1 = min(y0, direction[1, i]), max(y1, direction[1, i])
        z0, z1 = min(z0, direction[2, i]), max(z1, direction[2, i])
    half = 0.5 * np.sqrt((x1 - x0) ** 2 + (y1 - y0) ** 2 + (z1 - z0) ** 2)
    return 0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (z0 + z1), half


@kernel
def may_touch(x: float, y: float, z: float, half: float, target: np.ndarray) -> bool:
    """Return whether a ray that ends within `half` of (x, y, z) may meet the bounding sphere of a target."""
    apart = (x - target[_CENTRE]) ** 2 + (y - target[_CENTRE + 1]) ** 2 + (z - target[_CENTRE + 2]) ** 2
    reach = half + target[_REACH]
    return bool(apart <= (1.0 + 1e-6) * reach * reach + 1e-24)


@kernel
def order_by_distance(targets: np.ndarray) -> np.ndarray:
    """Return the numbers of the targets, nearest first."""
    order = np.arange(len(targets))
    for t in range(1, len(targets)):
        at = t
        while at > 0 and targets[order[at - 1], _START] > targets[t, _START]:
            order[at] = order[at - 1]
            at -= 1
        order[at] = t
    return order


@kernel
def select_rays(
    direction: np.ndarray, first: int, last: int, target: np.ndarray, near: np.ndarray, chosen: np.ndarray
) -> int:
    """Select those of rays first to last that meet the bounding sphere of a target; return how many.

    Parameters
    ----------
    direction : (xyz, ray) f8, unit vectors
    near : (ray in the block), range of the nearest hit so far [m]. A ray with a hit nearer than the target is left out
    chosen : (ray in the block), to which the numbers of the selected rays are written
    """
    count = 0
    x, y, z = target[_CENTRE], target[_CENTRE + 1], target[_CENTRE + 2]
    within = (1.0 + 1e-6) * target[_REACH] * target[_REACH] + 1e-24
    for i in range(first, last):
        apart = (direction[0, i] - x) ** 2 + (direction[1, i] - y) ** 2 + (direction[2, i] - z) ** 2
        if apart <= within and near[i - first] >= target[_START]:
            chosen[count] = i
            count += 1
    return count


@kernel
def cast_rays(
    rays: Columns,
    first: int,
    last: int,
    targets: Targets,
    origin: np.ndarray,
    turn: np.ndarray,
    question: int,
    width: int,
) -> tuple[np.ndarray, ...]:
    """Cast rays first to last and return the columns of `FirstHits`; the BRDF is NaN where it depends on directions.

    Parameters
    ----------
    origin, turn : (target, xyz) [m] and (target, xyz, xyz), target_from_lidar

    Returns
    -------
    columns of `FirstHits`.
    """
    direction, pixel, weight = rays
    scenes, sphere, target_number, first_facet, planes, part, source_facet, matt_per_sr = targets
    n = last - first
    hit_ray, hit_pixel, hit_weight = np.empty(n, np.int32), np.empty(n, np.int32), np.empty(n)
    hit_target, hit_number, hit_facet = np.empty(n, np.int16), np.empty(n, np.int16), np.empty(n, np.int32)
    hit_part, hit_source = np.empty(n, np.int16), np.empty(n, np.int32)
    hit_range, hit_cosine, hit_brdf = np.empty(n), np.empty(n), np.empty(n)
    words = make_packet(width)
    values = words.view(np.float32)
    sent_from = values[BEFORE + START * width : BEFORE + (START + 3) * width].reshape(3, width)
    sent_along = values[BEFORE + ALONG * width : BEFORE + (ALONG + 3) * width].reshape(3, width)
    far = values[BEFORE + FAR * width : BEFORE + (FAR + 1) * width]
    ahead, turned = np.zeros((3, width)), np.empty((3, width))
    chosen = np.empty(BLOCK_RAYS, np.int64)
    near, cosine = np.empty(BLOCK_RAYS), np.empty(BLOCK_RAYS)
    facet, number = np.empty(BLOCK_RAYS, np.int64), np.empty(BLOCK_RAYS, np.int64)
    places = place_targets(origin, turn, sphere)
    order = order_by_distance(places)
    alone = len(places) == 1
    hits = 0
    for block in range(first, last, BLOCK_RAYS):
        end = min(block + BLOCK_RAYS, last)
        for j in range(end - block):
            near[j] = np.inf
        x, y, z, half = bound_rays(direction, block, end)
        for t in order:
            target = places[t]
            if not alone and not may_touch(x, y, z, half, target):
                continue
            start = target[_START]
            if alone:  # the rays were made for this target
                count = end - block
                for j in range(count):
                    chosen[j] = block + j
            else:
                count = select_rays(direction, block, end, target, near, chosen)
            for p in range(0, count, width):
                used = min(width, count - p)
                for k in range(used):
                    i = chosen[p + k]
                    ahead[0, k], ahead[1, k], ahead[2, k] = direction[0, i], direction[1, i], direction[2, i]
                    far[k] = near[i - block] - start + target[_SLACK]
                for axis in range(3):  # all columns, used or not, so that the compiler vectorises the loop
                    a, b, c, o = target[3 * axis], target[3 * axis + 1], target[3 * axis + 2], target[_ORIGIN + axis]
                    for k in range(width):
                        along = a * ahead[0, k] + b * ahead[1, k] + c * ahead[2, k]
                        turned[axis, k] = along
                        sent_along[axis, k] = along
                        sent_from[axis, k] = o + start * along
                ask(question, scenes[t], words, width, used)
                for k in range(used):
                    if words[BEFORE + GEOMETRY * width + k] == NOTHING:
                        continue
                    f = np.int64(words[BEFORE + FACET * width + k])
                    plane = planes[first_facet[t] + f]
                    c = plane[0] * turned[0, k] + plane[1] * turned[1, k] + plane[2] * turned[2, k]
                    before = (
                        plane[0] * target[_ORIGIN] + plane[1] * target[_ORIGIN + 1] + plane[2] * target[_ORIGIN + 2]
                    )
                    exact = (plane[3] - before) / c
                    rough = start + np.float64(values[BEFORE + FAR * width + k])
                    # Seen edge-on, a facet's plane does not determine the range, and embree's own distance is used. It is
                    # good to some 1e-6 of the target's size. Where the two differ by a thousand times that, the
                    # ray is within 1e-3 rad of the plane.
                    distance = exact if abs(exact - rough) <= target[_SLACK] else rough
                    j = chosen[p + k] - block
                    if not distance > NEAREST_M:
                        continue
                    if distance < near[j] or (distance == near[j] and t < number[j]):
                        near[j], cosine[j], facet[j], number[j] = distance, min(abs(c), 1.0), f, t
        for i in range(block, end):
            j = i - block
            if near[j] == np.inf:
                continue
            f = first_facet[number[j]] + facet[j]
            hit_ray[hits], hit_pixel[hits], hit_weight[hits] = i, pixel[i], weight[i]
            hit_target[hits], hit_number[hits], hit_facet[hits] = target_number[number[j]], number[j], facet[j]
            hit_part[hits], hit_source[hits] = part[f], source_facet[f]
            hit_range[hits], hit_cosine[hits], hit_brdf[hits] = near[j], cosine[j], matt_per_sr[f]
            hits += 1
    return (
        hit_ray[:hits],
        hit_pixel[:hits],
        hit_weight[:hits],
        hit_target[:hits],
        hit_number[:hits],
        hit_facet[:hits],
        hit_part[:hits],
        hit_source[:hits],
        hit_range[:hits],
        hit_cosine[:hits],
        hit_brdf[:hits],
    )
