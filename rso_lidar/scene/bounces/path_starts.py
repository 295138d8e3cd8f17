"""Starts of paths: which hits send how many paths on, and the random numbers of each path."""

from __future__ import annotations

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.philox import draw_block
from rso_lidar.records import Hits
from rso_lidar.scene.surfaces.surface import Surface

PATHS = 8  # the last word of the counter of random words
_WORD = 2.0**-32
# Steps of a sequence that fills the unit cube evenly: powers of 1 / 1.2207..., the root of x^4 = x + 1 (Roberts, "The
# unreasonable effectiveness of quasirandom sequences", 2018).
STEPS = (0.8191725133961645, 0.6710436067037893, 0.5497004779019703)


def number_facets(hits: Hits, surfaces: tuple[Surface, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return the number of the surface, and that of its facet, of each hit (hit)."""
    number, facet = np.zeros(len(hits.ray), np.int16), np.zeros(len(hits.ray), np.int32)
    of_target: dict[int, list[int]] = {}
    for k, surface in enumerate(surfaces):
        of_target.setdefault(k if surface.target is None else surface.target, []).append(k)
    for target, members in of_target.items():
        on = np.flatnonzero(hits.target == target) if len(of_target) > 1 else slice(None)
        size = max(surfaces[k].mesh.source_facets for k in members)
        owner, place = np.zeros(size, np.int16), np.zeros(size, np.int32)
        for k in members:
            of = surfaces[k].mesh.source_facet
            owner[of], place[of] = k, np.arange(len(of))
        number[on], facet[on] = owner[hits.facet[on]], place[hits.facet[on]]
    return number, facet


def start_paths(
    hits: Hits, can_send: np.ndarray, key: np.ndarray, n_paths: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """Spread paths over hits, evenly by area.

    Parameters
    ----------
    can_send : (hit) whether a path from it can meet another surface
    key : (2) uint32, key of the frame's random words

    Returns
    -------
    The hit of each path (path), ascending. Three numbers from 0 to 1 for each (3, path). The share of a pixel's area for
    which each path stands.
    """
    area = np.where(can_send, hits.weight, 0.0)
    total = float(area.sum())
    per_pixel = n_paths / total if total > 0.0 else 0.0
    most = int(n_paths + len(hits.pixel) + 2)
    hit, uniform = spread_paths(packed(hits.pixel), packed(area), per_pixel, key, most)
    return hit, uniform, 1.0 / per_pixel if per_pixel > 0.0 else 0.0


@kernel
def spread_paths(
    pixel: np.ndarray, area: np.ndarray, per_pixel: float, key: np.ndarray, most: int
) -> tuple[np.ndarray, np.ndarray]:
    """Spread paths over the hits of each pixel: by systematic sampling, `per_pixel` for an area of one pixel.

    The numbers of the paths of one pixel are consecutive points of an even sequence, shifted at random.

    Parameters
    ----------
    pixel : (hit), never falling
    area : (hit), share of the pixel's area that may send paths
    per_pixel : number of paths for a whole pixel
    key : (2) uint32, key of the frame's random words
    most : upper bound of the number of paths

    Returns
    -------
    The hit of each path, and three numbers from 0 to 1 for each path (3, path).
    """
    hit, uniform = np.empty(most, np.int32), np.empty((3, most))
    n_paths, j, reached = 0, 0, 0.0
    shift_0 = shift_1 = shift_2 = 0.0
    for k in range(len(pixel)):
        if k == 0 or pixel[k] != pixel[k - 1]:
            words = draw_block(key, 0, 0, pixel[k], PATHS)
            reached, j = (np.float64(words[0]) + 0.5) * _WORD, 0
            shift_0 = (np.float64(words[1]) + 0.5) * _WORD
            shift_1 = (np.float64(words[2]) + 0.5) * _WORD
            shift_2 = (np.float64(words[3]) + 0.5) * _WORD
        reached += per_pixel * area[k]
        while reached >= 1.0 and n_paths < most:
            reached -= 1.0
            hit[n_paths] = k
            uniform[0, n_paths] = (shift_0 + j * STEPS[0]) % 1.0
            uniform[1, n_paths] = (shift_1 + j * STEPS[1]) % 1.0
            uniform[2, n_paths] = (shift_2 + j * STEPS[2]) % 1.0
            n_paths += 1
            j += 1
    return hit[:n_paths].copy(), uniform[:, :n_paths].copy()


@kernel
def draw_numbers(pixel: np.ndarray, key: np.ndarray, leg: int, numbers: np.ndarray) -> None:
    """Draw three numbers from 0 to 1 for each path (3, path), for a further direction.

    Parameters
    ----------
    pixel : (path) in which the path begins, never falling
    key : (2) uint32, key of the frame's random words
    leg : number of the direction, from 1; `spread_paths` gives those of leg 0
    numbers : (3, path), written
    """
    place = 0
    for k in range(len(pixel)):
        place = place + 1 if k > 0 and pixel[k] == pixel[k - 1] else 0
        words = draw_block(key, leg, place, pixel[k], PATHS)
        for axis in range(3):
            numbers[axis, k] = (np.float64(words[axis]) + 0.5) * _WORD
