"""Sunlight on hits: edges of shadows as soft as the Sun's disc makes them, and the same light in another band."""

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

_GOLDEN_RAD = np.pi * (3.0 - np.sqrt(5.0))
_RIM, _RIM_POINTS = 0.97, 6  # over the Sun's radius: where hits in a penumbra are told from others
_DISC_POINTS = 24  # of a hit in a penumbra; each hit turns them, so that those of a pixel do not err alike


def soften_shadows(
    hits: Hits, surfaces: Sequence[Surface], truth: Truth, pixel_rad: float, threads: int | None = None
) -> Hits:
    """Soften the edges of shadows of the Sun.

    Near them, rays go to 6 points of the rim of its disc. Where these differ, rays to 24 points of the disc give its visible
    share. A penumbra without any hit in full shadow or without any in full light is not found, such as that of a thin rod.

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
        sunlight[on] = compute_sunlight(points, lambda local, up, disc: _find_visible_share(local, up, disc, on))

    run_in_threads(threads, lambda piece: soften(*piece), split_by_surface(number[near], len(surfaces), BAND_RAYS))
    return replace(hits, sunlight_per_sr=sunlight)


def recolor_sunlight(
    hits: Hits, before: Sequence[Surface], after: Sequence[Surface], truth: Truth, threads: int | None = None
) -> Hits:
    """Return hits in the sunlight of another band: shadows stay, and other materials reflect.

    Parameters
    ----------
    hits : first facets that rays meet, with the sunlight on each
    before, after : the surfaces of all targets in the band of that sunlight and in the other; they differ in materials alone
    truth : where the surfaces are
    threads : number of threads (None: one for each core). The result is the same to the bit

    Returns
    -------
    The hits with the sunlight of the other band.
    """
    assert hits.sunlight_per_sr is not None
    before, after, sunlight = tuple(before), tuple(after), hits.sunlight_per_sr.copy()
    number, facet = number_facets(hits, before)
    direction = hits.rays.direction[hits.ray]

    def recolor(k: int, on: np.ndarray) -> None:
        old, new = (
            localize_points(surfaces, k, truth, direction[on], facet[on], hits.range_m[on])
            for surfaces in (before, after)
        )
        bright, brighter = (compute_sunlight(points, _see_all) for points in (old, new))
        sunlight[on] *= np.divide(brighter, bright, out=np.zeros(len(on)), where=bright > 0.0)
        black = np.flatnonzero((bright <= 0.0) & (brighter > 0.0))  # its shadows are not known
        if len(black):
            sunlight[on[black]] = compute_sunlight(new.only(black))

    run_in_threads(threads, lambda piece: recolor(*piece), split_by_surface(number, len(before), BAND_RAYS))
    return replace(hits, sunlight_per_sr=sunlight)


def _see_all(hits: LocalHits, up: np.ndarray, disc: np.ndarray) -> np.ndarray:
    """Return 1 for hits on the Sun's side of their facet: nothing is in shadow (hit)."""
    return up.astype(float)


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


def _find_visible_share(hits: LocalHits, up: np.ndarray, disc: np.ndarray, number: np.ndarray) -> np.ndarray:
    """Find the share (hit) of the Sun's disc that no surface hides; 0 for hits that are not `up`.

    Points on the rim of the disc come first. Where they agree, no others are asked.

    Parameters
    ----------
    up : (hit) hits on the Sun's side of their facet
    disc : (point, xyz) points of equal weight on the disc
    number : (hit) numbers that differ from hit to hit
    """
    to_sun = disc.sum(axis=0)
    to_sun /= np.linalg.norm(to_sun)
    upward = np.cross(to_sun, disc[0])
    upward /= np.linalg.norm(upward)
    across, reach_m = np.cross(upward, to_sun), np.full(len(up), np.inf)

    def count(radius: np.ndarray, angle: np.ndarray, asked: np.ndarray) -> np.ndarray:
        """Count the points (hit) that something hides, at a share of the Sun's radius (point) and an angle (point) [rad]."""
        hidden = np.zeros(len(up))
        for sine, at in zip(radius * SUN_RADIUS_RAD, angle, strict=True):
            turned = at + _GOLDEN_RAD * number
            toward = to_sun[:, None] + sine * (np.cos(turned) * across[:, None] + np.sin(turned) * upward[:, None])
            hidden[find_shadowed(hits, asked, toward / np.sqrt(dot(toward, toward)), reach_m)] += 1.0
        return hidden

    of_rim = count(np.full(_RIM_POINTS, _RIM), np.arange(_RIM_POINTS) * (2.0 * np.pi / _RIM_POINTS), up)
    is_mixed = up & (of_rim > 0.0) & (of_rim < _RIM_POINTS)
    order = np.arange(_DISC_POINTS)
    of_disc = count(np.sqrt((order + 0.5) / _DISC_POINTS), order * _GOLDEN_RAD, is_mixed)
    visible = np.where(is_mixed, 1.0 - of_disc / _DISC_POINTS, of_rim == 0.0)
    return np.where(up, visible, 0.0)
