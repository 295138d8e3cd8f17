"""Rays meet facets: embree finds which, float64 says where, materials say how bright.

Embree works in float32, so rays are moved into each target's axes, cast from a point near the target, and the range is
taken from the facet's plane in float64. Rays are cast in bands on threads; what a band gives does not depend on how many
there are.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from rso_lidar.parallel import run_in_threads
from rso_lidar.records import Hits, Rays, Truth
from rso_lidar.scene.casting.bands import BAND_RAYS
from rso_lidar.scene.casting.first_hits import find_first_hits, split_by_surface
from rso_lidar.scene.casting.light import compute_laser_light, compute_sunlight
from rso_lidar.scene.casting.local_hits import localize_hits
from rso_lidar.scene.embree.engine import engine
from rso_lidar.scene.surfaces.surface import Surface


def cast(
    rays: Rays,
    surfaces: Sequence[Surface],
    truth: Truth,
    threads: int | None = None,
    *,
    laser_from_m: ArrayLike | None = None,
    sun: bool = False,
    aperture_m: float = 0.0,
) -> Hits:
    """Return the first facet that each ray meets, over the surfaces of all targets.

    `threads` is the number of bands cast at once (None: one for each core); it does not change the result.
    `laser_from_m` (xyz) is where the laser is, in lidar axes [m]; None, or zeros, is in the lens. Beside it, incidence is
    the laser's, 0 in shadow, and the BRDF takes both directions. `sun` asks for the sunlight too. Lobes narrower than the
    lens are averaged over its diameter `aperture_m` [m].
    """
    first = find_first_hits(rays, surfaces, truth, threads, engine())
    number, facet = first.number, first.facet
    hits = Hits(
        rays=rays,
        ray=first.ray,
        pixel=first.pixel,
        weight=first.weight,
        target=first.target,
        facet=first.source_facet,
        part=first.part,
        range_m=first.range_m,
        cos_incidence=first.cosine,
        brdf_per_sr=first.brdf_per_sr,
    )
    laser = np.zeros(3) if laser_from_m is None else np.asarray(laser_from_m, dtype=float)
    if sun or laser.any() or any(surface.has_own_normals for surface in surfaces):
        hits = _relight(hits, number, facet, surfaces, truth, threads, laser, sun=sun)
    return _average_over_lens(hits, number, facet, surfaces, laser, aperture_m)


def _average_over_lens(
    hits: Hits,
    number: np.ndarray,
    facet: np.ndarray,
    surfaces: Sequence[Surface],
    laser_from_m: np.ndarray,
    aperture_m: float,
) -> Hits:
    """Return the hits with the lobes of retro-reflectors averaged over the lens."""
    retros = [(n, k, m) for n, one in enumerate(surfaces) for k, m in enumerate(one.materials) if m.is_retro]
    if not retros:
        return hits
    brdf = hits.brdf_per_sr.copy()
    for k, of, material in retros:
        on = np.flatnonzero(number == k)
        on = on[surfaces[k].finish[facet[on]] == of]
        direction, range_m = hits.rays.direction[hits.ray[on]], hits.range_m[on]
        brdf[on] = material.average_over_lens(brdf[on], direction, range_m, laser_from_m, aperture_m)
    return replace(hits, brdf_per_sr=brdf)


def _relight(
    hits: Hits,
    number: np.ndarray,
    facet: np.ndarray,
    surfaces: Sequence[Surface],
    truth: Truth,
    threads: int | None,
    laser_from_m: np.ndarray,
    *,
    sun: bool,
) -> Hits:
    """Return the hits in the light of a laser beside the lens and of the Sun, curved parts shaded as curved."""
    cosine, brdf = hits.cos_incidence.copy(), hits.brdf_per_sr.copy()
    sunlight = np.zeros(len(facet)) if sun else None

    def light(k: int, on: np.ndarray) -> None:
        surface, direction = surfaces[k], hits.rays.direction[hits.ray[on]]
        here = localize_hits(surfaces, k, truth, direction, facet[on], hits.range_m[on], cosine[on])
        if laser_from_m.any():
            cosine[on], brdf[on] = compute_laser_light(here, laser_from_m)
        elif surface.has_own_normals:
            cosine[on], brdf[on] = here.base_cos_out, here.own_brdf_per_sr()
        if sunlight is not None:
            sunlight[on] = compute_sunlight(here)

    pieces = []
    for k, of_surface in split_by_surface(number, len(surfaces)):
        pieces += [(k, of_surface[start : start + BAND_RAYS]) for start in range(0, len(of_surface), BAND_RAYS)]
    run_in_threads(threads, lambda piece: light(*piece), pieces)
    return replace(hits, cos_incidence=cosine, brdf_per_sr=brdf, sunlight_per_sr=sunlight)
