"""Penumbrae: edges of shadows as soft as the Sun's disc makes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rso_lidar.parallel import run_in_threads
from rso_lidar.pose import ROOT, rotate_vectors
from rso_lidar.records import Hits, Truth
from rso_lidar.scene.bounces.path_starts import number_facets
from rso_lidar.scene.bounces.scattering import localize_points
from rso_lidar.scene.casting.cast import compute_sunlight
from rso_lidar.scene.casting.first_hits import BAND_RAYS, split_by_surface
from rso_lidar.scene.casting.local_hits import LocalHits, dot, rotate
from rso_lidar.scene.casting.shadows import find_shadowed
from rso_lidar.scene.materials.scatterer import SUN_RADIUS_RAD
from rso_lidar.scene.surfaces.surface import Surface


def soften_shadows(
    hits: Hits, surfaces: Sequence[Surface], truth: Truth, pixel_rad: float, threads: int | None = None
) -> Hits:
    """Soften the edges of shadows of the Sun: near them, the visible share of its disc is found by rays to 12 of its points.

    A penumbra without any hit in full shadow or without any in full light is not found, such as that of a thin rod.

    Parameters
    ----------
    hits : first facets that rays meet, with the sunlight on each, shadows having sharp edges
    surfaces : the surfaces of all targets, each in its own axes
    truth : where the surfaces are
    pixel_rad : angle of a pixel [rad], which decides how many pixels are near an edge
    threads : number of threads (None: one for each core). The result is the same to the bit

    Returns
    -------
    The hits with soft edges in `sunlight_per_sr`.
    """
    if hits.sunlight_per_sr is None or not len(hits.ray):
        return hits
    surfaces, sunlight = tuple(surfaces), hits.sunlight_per_sr.copy()
    number, facet = number_facets(hits, surfaces)
    direction = hits.rays.direction[hits.ray]
    dark = np.flatnonzero(sunlight <= 0.0)
    shaded = dark[_face_sun(surfaces, truth, number[dark], facet[dark], direction[dark])]
    reach_m = SUN_RADIUS_RAD * _farthest_shade_m(surfaces, truth)
    near = np.flatnonzero(_find_shadow_edges(hits, sunlight, shaded, reach_m, pixel_rad))

    def soften(k: int, some: np.ndarray) -> None:
        on = near[some]
        points = localize_points(surfaces, k, truth, direction[on], facet[on], hits.range_m[on])
        sunlight[on] = compute_sunlight(points, _find_visible_share)

    run_in_threads(threads, lambda piece: soften(*piece), split_by_surface(number[near], len(surfaces), BAND_RAYS))
    return replace(hits, sunlight_per_sr=sunlight)


def _farthest_shade_m(surfaces: Sequence[Surface], truth: Truth) -> float:
    """Return the greatest distance from which one surface may shade another or itself [m]."""
    centres = []
    for surface in surfaces:
        origin, turn = truth.poses.place("lidar", surface.name)
        centre, radius = surface.sphere
        centres.append((origin + rotate_vectors(turn, centre), radius))
    return max(float(np.linalg.norm(a - b)) + radius_a + radius_b for a, radius_a in centres for b, radius_b in centres)


def _face_sun(
    surfaces: Sequence[Surface], truth: Truth, number: np.ndarray, facet: np.ndarray, direction: np.ndarray
) -> np.ndarray:
    """Return whether the side of each facet that is seen is the one toward the Sun (hit)."""
    toward_sun = np.zeros(len(number), bool)
    sun = np.asarray(truth.sun_direction, dtype=float)
    for k, surface in enumerate(surfaces):
        on = np.flatnonzero(number == k)
        normal = surface.planes[:3, facet[on]]
        along = rotate(truth.poses.place(surface.name, "lidar"), direction[on].T)
        to_sun = rotate_vectors(truth.poses.place(surface.name, ROOT)[1], sun)
        toward_sun[on] = dot(normal, along) * (to_sun @ normal) < 0.0
    return toward_sun


def _find_shadow_edges(
    hits: Hits, sunlight: np.ndarray, shaded: np.ndarray, reach_m: float, pixel_rad: float
) -> np.ndarray:
    """Find the hits (hit) that may be in a penumbra: those near both a sunlit hit and one in shadow.

    Parameters
    ----------
    shaded : (hit) numbers of those in shadow
    reach_m : half the greatest width of a penumbra [m]
    """
    from scipy.ndimage import maximum_filter

    width = 2 * int(min(np.ceil(reach_m / (float(hits.range_m.min()) * pixel_rad)) + 1.0, max(hits.rays.shape))) + 1
    is_lit, is_dark = np.zeros((2, *hits.rays.shape), np.uint8)
    is_lit.ravel()[hits.pixel[sunlight > 0.0]] = 1
    is_dark.ravel()[hits.pixel[shaded]] = 1
    near: np.ndarray = (maximum_filter(is_lit, width) & maximum_filter(is_dark, width)).ravel()[hits.pixel] > 0
    return near


def _find_visible_share(hits: LocalHits, up: np.ndarray, disc: np.ndarray) -> np.ndarray:
    """Find the share (hit) of the Sun's disc that no surface hides; 0 for hits that are not `up`.

    Three points of the outer ring come first. Where they agree, the others are not asked.

    Parameters
    ----------
    up : (hit) hits on the Sun's side of their facet
    disc : (point, xyz) points of equal weight on the disc, the outer ring last
    """
    reach_m, hidden = np.full(len(up), np.inf), np.zeros((len(disc), len(up)), dtype=bool)

    def ask(point: int, asked: np.ndarray) -> None:
        toward = np.repeat(disc[point][:, None], len(up), axis=1)
        hidden[point, find_shadowed(hits, asked, toward, reach_m)] = True

    first = range(len(disc) // 2, len(disc), 2)
    for point in first:
        ask(point, up)
    count = hidden[list(first)].sum(axis=0)
    is_mixed = up & (count > 0) & (count < len(first))
    for point in set(range(len(disc))) - set(first):
        ask(point, is_mixed)
    share = np.where(is_mixed, 1.0 - hidden.mean(axis=0), count == 0)
    return np.where(up, share, 0.0)
