"""Sunlight on hits: edges of shadows as soft as the Sun's disc makes them, and the same light in another band."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from rso_lidar.parallel import run_in_threads
from rso_lidar.pose import ROOT, rotate_vectors
from rso_lidar.records import Hits, Truth
from rso_lidar.scene.bounces.path_starts import number_facets
from rso_lidar.scene.bounces.scattering import localize_points
from rso_lidar.scene.casting.cast import compute_sunlight
from rso_lidar.scene.casting.first_hits import BAND_RAYS, split_by_surface
from rso_lidar.scene.casting.local_hits import LocalHits, dot
from rso_lidar.scene.casting.shadows import find_occluders_m, find_shadowed
from rso_lidar.scene.materials.scatterer import SUN_RADIUS_RAD
from rso_lidar.scene.surfaces.surface import Surface

_GOLDEN_RAD = np.pi * (3.0 - np.sqrt(5.0))
# Radius over the Sun's, and number, of the points that tell hits in a penumbra from others. Between two of them a straight
# edge may hide up to 4 % of the disc unseen. These are choices of sampling, as the number of points on the disc.
_RIM, _RIM_POINTS = 0.97, 6
_LEAST_COSINE = 0.01  # of the Sun's incidence: nearer to the surface, penumbrae are taken to be no wider
_LEAST_WIDTH = 0.5  # of the way between rays, on each side of an edge: rays do not resolve narrower penumbrae
_DISC_POINTS = 24  # of a hit in a penumbra; each hit turns them, so that those of a pixel do not err alike


def soften_shadows(
    hits: Hits, surfaces: Sequence[Surface], truth: Truth, pixel_rad: float, threads: int | None = None
) -> Hits:
    """Soften the edges of shadows of the Sun.

    From hits beside an edge, rays go to 6 points of the rim of the Sun's disc. Where these differ, rays to 24 points of the
    disc give its visible share, and the hits around are asked too, as far as the penumbra reaches. An edge stays sharp where
    its penumbra is narrower than the way between two rays, because what casts the shadow is near. A penumbra without any hit
    in full shadow or without any in full light is not found, such as that of a thin rod.

    Parameters
    ----------
    hits : first facets that rays meet, with the sunlight on each, shadows having sharp edges
    surfaces : the surfaces of all targets, each in its own axes
    truth : where the surfaces are
    pixel_rad : angle of a pixel [rad]
    threads : number of threads (None: one for each core). The result is the same to the bit

    Returns
    -------
    The hits with soft edges in `sunlight_per_sr`.
    """
    if hits.sunlight_per_sr is None or not len(hits.ray):
        return hits
    surfaces, sunlight = tuple(surfaces), hits.sunlight_per_sr.copy()
    number, facet = number_facets(hits, surfaces)
    width_m, visible = np.zeros(len(sunlight)), np.zeros(len(sunlight))

    def localize(k: int, on: np.ndarray) -> LocalHits:
        return localize_points(surfaces, k, truth, hits.rays.direction[hits.ray[on]], facet[on], hits.range_m[on])

    def measure(k: int, on: np.ndarray) -> None:
        width_m[on] = _measure_penumbrae_m(localize(k, on))

    def soften(k: int, on: np.ndarray) -> None:
        points = localize(k, on)
        visible[on] = _find_visible_share(points, on)
        was_dark = np.flatnonzero((sunlight[on] <= 0.0) & (visible[on] > 0.0))
        sunlight[on] *= visible[on]
        sunlight[on[was_dark]] = compute_sunlight(points.only(was_dark), visible[on[was_dark]])

    def run(work: Callable[[int, np.ndarray], None], on: np.ndarray) -> None:
        pieces = [(k, on[some]) for k, some in split_by_surface(number[on], len(surfaces), BAND_RAYS)]
        run_in_threads(threads, lambda piece: work(*piece), pieces)

    lit = _mark(hits, sunlight > 0.0)
    run(measure, np.flatnonzero((sunlight <= 0.0) & _widen(lit).ravel()[hits.pixel]))
    spacing_m = np.sqrt(float(hits.weight.min())) * pixel_rad * hits.range_m
    shaded, is_open = _mark(hits, width_m > _LEAST_WIDTH * spacing_m), np.ones(len(sunlight), bool)
    near = (lit & _widen(shaded)) | (shaded & _widen(lit))
    while len(on := np.flatnonzero(is_open & near.ravel()[hits.pixel])):
        is_open[on] = False
        run(soften, on)
        partly = on[(visible[on] > 0.0) & (visible[on] < 1.0)]
        near = _widen(_mark(hits, partly))
    return replace(hits, sunlight_per_sr=sunlight)


def recolor_sunlight(
    hits: Hits, bands: Sequence[Sequence[Surface]], truth: Truth, threads: int | None = None
) -> list[Hits]:
    """Return hits in the sunlight of each band: shadows stay, and other materials reflect.

    Parameters
    ----------
    hits : first facets that rays meet, with the sunlight of the first band on each
    bands : for each band, the surfaces of all targets, which differ in what their materials reflect alone
    truth : where the surfaces are
    threads : number of threads (None: one for each core). The result is the same to the bit

    Returns
    -------
    The hits with the sunlight of each band, the given ones first.
    """
    surfaces, *others = (tuple(band) for band in bands)
    number, facet = number_facets(hits, surfaces)
    first = hits.sunlight_per_sr
    assert first is not None
    sunlight = [first.copy() for _ in others]

    def recolor(k: int, on: np.ndarray) -> None:
        if all(of_band[k] is surfaces[k] for of_band in others):
            return
        points = localize_points(surfaces, k, truth, hits.rays.direction[hits.ray[on]], facet[on], hits.range_m[on])
        every = np.ones(len(on))
        bright = compute_sunlight(points, every)
        visible = np.divide(first[on], bright, out=np.zeros(len(on)), where=bright > 0.0)
        for of_band, light in zip(others, sunlight, strict=True):
            if of_band[k] is surfaces[k]:
                continue
            other = replace(points, surfaces=of_band)
            brighter = compute_sunlight(other, every)
            black = np.flatnonzero((bright <= 0.0) & (brighter > 0.0))  # its shadows are not known
            light[on] = visible * brighter
            light[on[black]] = compute_sunlight(other.only(black))

    if others:
        pieces = split_by_surface(number, len(surfaces), BAND_RAYS)
        run_in_threads(threads, lambda piece: recolor(*piece), pieces)
    return [hits, *(replace(hits, sunlight_per_sr=light) for light in sunlight)]


def _find_sun(points: LocalHits) -> np.ndarray:
    """Return the unit vector to the Sun (xyz) in the surface's axes."""
    sun = np.asarray(points.truth.sun_direction, dtype=float)
    to_sun: np.ndarray = rotate_vectors(
        points.truth.poses.place(points.surface.name, ROOT)[1], sun / np.linalg.norm(sun)
    )
    return to_sun


def _measure_penumbrae_m(points: LocalHits) -> np.ndarray:
    """Measure half the width on the surface of penumbrae at points in shadow (hit) [m]; 0 for points that face away."""
    to_sun = _find_sun(points)
    cosine = np.maximum(dot(points.facing, to_sun), 0.0)
    occluder_m = find_occluders_m(points, cosine > 0.0, np.repeat(to_sun[:, None], len(cosine), axis=1))
    reach_m = SUN_RADIUS_RAD * np.where(np.isfinite(occluder_m), occluder_m, 0.0)
    width_m: np.ndarray = reach_m / np.maximum(cosine, _LEAST_COSINE)
    return width_m


def _mark(hits: Hits, some: np.ndarray) -> np.ndarray:
    """Mark the pixels (row, col) of some hits, a mask or numbers."""
    mask = np.zeros(hits.rays.shape, bool)
    mask.ravel()[hits.pixel[some]] = True
    return mask


def _widen(mask: np.ndarray) -> np.ndarray:
    """Return the pixels (row, col) of a mask and those beside them."""
    wide = mask.copy()
    wide[:, 1:] |= mask[:, :-1]
    wide[:, :-1] |= mask[:, 1:]
    wider = wide.copy()
    wider[1:] |= wide[:-1]
    wider[:-1] |= wide[1:]
    return wider


def _find_visible_share(hits: LocalHits, number: np.ndarray) -> np.ndarray:
    """Find the share (hit) of the Sun's disc that no surface hides; 0 for hits that face away from its centre.

    Points on the rim of the disc come first. Where they agree, no others are asked.

    Parameters
    ----------
    number : (hit) numbers that differ from hit to hit
    """
    to_sun = _find_sun(hits)
    across = np.cross(to_sun, np.eye(3)[int(np.argmin(np.abs(to_sun)))])
    across /= np.linalg.norm(across)
    upward = np.cross(to_sun, across)

    def count(radius: np.ndarray, angle: np.ndarray, asked: np.ndarray) -> np.ndarray:
        """Count the points (hit) that something hides, at a share of the Sun's radius (point) and an angle (point) [rad]."""
        sine, turned = radius * SUN_RADIUS_RAD, (_GOLDEN_RAD * number[asked])[:, None] + angle
        toward = np.empty((3, turned.size))
        aside, above = (sine * np.cos(turned)).ravel(), (sine * np.sin(turned)).ravel()
        for axis in range(3):
            toward[axis] = to_sun[axis] + aside * across[axis] + above * upward[axis]
        toward /= np.sqrt(1.0 + np.tile(sine * sine, len(asked)))
        hidden, every = np.zeros(turned.size), np.ones(turned.size, bool)
        point, facing = (np.repeat(of_hit[:, asked], len(angle), axis=1) for of_hit in (hits.point, hits.facing))
        starts = replace(hits, point=point, facing=facing)  # a shadow ray needs no more of a hit
        hidden[find_shadowed(starts, every, toward, np.full(turned.size, np.inf))] = 1.0
        total: np.ndarray = hidden.reshape(turned.shape).sum(axis=1)
        return total

    visible, up = np.zeros(len(number)), np.flatnonzero((dot(hits.facing, to_sun) > 0.0) & (hits.cos_out > 0.0))
    of_rim = count(np.full(_RIM_POINTS, _RIM), np.arange(_RIM_POINTS) * (2.0 * np.pi / _RIM_POINTS), up)
    visible[up] = of_rim == 0.0
    mixed = up[(of_rim > 0.0) & (of_rim < _RIM_POINTS)]
    order = np.arange(_DISC_POINTS)
    of_disc = count(np.sqrt((order + 0.5) / _DISC_POINTS), order * _GOLDEN_RAD, mixed)
    visible[mixed] = 1.0 - of_disc / _DISC_POINTS
    return visible
