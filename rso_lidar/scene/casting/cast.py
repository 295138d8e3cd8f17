"""Casting: which facet each ray hits, where, and how bright it is there.

Embree works in float32. Rays are therefore moved into each target's axes and cast from a point near the target. The range
is computed on the facet's plane in float64. Rays are cast in bands on threads, and the hits of a band do not depend on the
number of bands.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from rso_lidar.parallel import run_in_threads
from rso_lidar.records import Hits, Rays, Truth
from rso_lidar.scene.casting.first_hits import BAND_RAYS, find_first_hits, split_by_surface
from rso_lidar.scene.casting.illumination import compute_laser_light, compute_sunlight
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
    """Cast rays and find the first facet that each of them hits, over the surfaces of all targets.

    Parameters
    ----------
    rays : the rays of one flash, in lidar axes
    surfaces : the surfaces of all targets, each in its own axes
    truth : where the surfaces are, and the direction of the Sun
    threads : number of bands cast in parallel (None: one for each core). The result is the same to the bit

    Other Parameters
    ----------------
    laser_from_m : (xyz), position of the laser in lidar axes [m]; None or zeros is in the lens. With the laser beside the
        lens the incidence is the laser's (0 in shadow), and the BRDF takes both directions
    sun : whether to compute the sunlight that the hits reflect toward the lidar
    aperture_m : diameter of the lens [m], over which lobes narrower than the lens are averaged

    Returns
    -------
    The hits, in the order of the rays. A ray that hits nothing has no row.
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
    """Average the lobes of retro-reflectors over the lens.

    Parameters
    ----------
    number, facet : (hit) number of the surface, and of its facet
    laser_from_m : (xyz) position of the laser in lidar axes [m]
    aperture_m : diameter of the lens [m]

    Returns
    -------
    the hits with that BRDF.
    """
    retros = [(n, k, m) for n, surface in enumerate(surfaces) for k, m in enumerate(surface.materials) if m.is_retro]
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
    """Compute incidence and BRDF for a laser beside the lens, for sunlight, and for interpolated or tilted normals.

    Parameters
    ----------
    number, facet : (hit) number of the surface, and of its facet
    threads : number of threads (None: one for each core)
    laser_from_m : (xyz) position of the laser in lidar axes [m]
    sun : whether sunlight is computed

    Returns
    -------
    the hits with those values.
    """
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
