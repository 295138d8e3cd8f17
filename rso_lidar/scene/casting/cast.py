"""Casting: which facet each ray hits, where, and how bright it is there.

Embree works in float32. Rays are therefore moved into each target's axes and cast from a point near the target. The range
is computed on the facet's plane in float64. Rays are cast in bands on threads, and the hits of a band do not depend on the
number of bands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from rso_lidar.parallel import run_in_threads
from rso_lidar.pose import ROOT, rotate_vectors
from rso_lidar.records import Hits, Rays, Truth
from rso_lidar.scene.casting.first_hits import BAND_RAYS, find_first_hits, split_by_surface
from rso_lidar.scene.casting.local_hits import LocalHits, dot, localize_hits
from rso_lidar.scene.casting.shadows import find_shadowed
from rso_lidar.scene.embree.engine import engine
from rso_lidar.scene.materials.crinkle import masking_shadowing
from rso_lidar.scene.materials.scatterer import SUN_RADIUS_RAD, Scatterer
from rso_lidar.scene.surfaces.surface import Surface

_TIE = 1e-6  # components of a direction that differ by less count as equal, so that rounding decides nothing


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
    """
    cosine, brdf = hits.cos_incidence.copy(), hits.brdf_per_sr.copy()
    sunlight = np.zeros(len(facet)) if sun else None

    def light(k: int, on: np.ndarray) -> None:
        surface, direction = surfaces[k], hits.rays.direction[hits.ray[on]]
        here = localize_hits(surfaces, k, truth, direction, facet[on], hits.range_m[on], cosine[on])
        if laser_from_m.any():
            cosine[on], brdf[on] = _compute_laser_light(here, laser_from_m)
        elif surface.has_own_normals:
            cosine[on], brdf[on] = here.base_cos_out, here.own_brdf_per_sr()
        if sunlight is not None:
            sunlight[on] = compute_sunlight(here)

    pieces = split_by_surface(number, len(surfaces), BAND_RAYS)
    run_in_threads(threads, lambda piece: light(*piece), pieces)
    return replace(hits, cos_incidence=cosine, brdf_per_sr=brdf, sunlight_per_sr=sunlight)


def _compute_laser_light(hits: LocalHits, laser_from_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute cos α and BRDF [1/sr] of hits lit by a laser at `laser_from_m` [m] in lidar axes.

    cos α is 0 where the laser is on the far side of the facet, or in shadow. Cube corners get the BRDF toward the laser,
    which `RetroReflector.average_over_lens` averages over the lens.
    """
    (origin, turn) = hits.target_from_lidar
    laser = (origin + rotate_vectors(turn, laser_from_m))[:, None] - hits.point
    distance_m = np.sqrt(dot(laser, laser))
    to_laser = laser / distance_m
    lit = dot(hits.facing, to_laser) > 0.0
    cos_in = np.where(lit, np.clip(dot(hits.base, to_laser), 0.0, 1.0), 0.0)
    cos_in[find_shadowed(hits, cos_in > 0.0, to_laser, distance_m)] = 0.0
    cos_phase = np.clip(dot(to_laser, hits.to_viewer), -1.0, 1.0)
    on = hits.crinkled
    met = cos_in.copy()  # cosine of incidence on the cell, where foil is crinkled
    met[on] = np.where(cos_in[on] > 0.0, np.clip(dot(hits.normal[:, on], to_laser[:, on]), 0.0, 1.0), 0.0)
    lobe = np.where(hits.surface.is_retro[hits.facet], 1.0, cos_phase)
    brdf = hits.surface.brdf_per_sr(hits.facet, met, hits.cos_out, lobe)
    brdf[on] *= met[on] / np.maximum(cos_in[on], 1e-9) * hits.projected_area[on]
    brdf[on] *= masking_shadowing(cos_in[on], hits.base_cos_out[on], cos_phase[on], hits.slope[on])
    return cos_in, brdf


def compute_sunlight(hits: LocalHits, visible: np.ndarray | None = None) -> np.ndarray:
    """Compute BRDF times cosine of incidence [1/sr] of sunlight toward the lidar, times the sunlit share of the Sun's disc.

    A lobe that changes within the disc is averaged over two rings of six points. This is Gauss quadrature in the square
    of the radius, exact for polynomials of degree five in the offset. It is good to a few per cent for lobes down to half
    the disc.

    Parameters
    ----------
    hits : hits on one surface
    visible : share (hit) of the disc that no surface hides. None for shadows with a sharp edge: a ray goes to the centre of
        the disc
    """
    lit = np.zeros(len(hits.facet))
    sun = np.asarray(hits.truth.sun_direction, dtype=float)
    share = float(np.asarray(hits.truth.sunlit.get(hits.surface.body, 1.0)))
    if not np.all(np.isfinite(sun)) or share <= 0.0 or not len(lit):
        return lit
    to_sun = rotate_vectors(hits.truth.poses.place(hits.surface.name, ROOT)[1], sun / np.linalg.norm(sun))
    up = (dot(hits.facing, to_sun) > 0.0) & (hits.cos_out > 0.0)
    if visible is None:
        visible = up.astype(float)
        toward = np.repeat(to_sun[:, None], len(lit), axis=1)
        visible[find_shadowed(hits, up, toward, np.full(len(up), np.inf))] = 0.0
    on = np.flatnonzero(up & (visible > 0.0))
    cos_in, cos_out = np.clip(dot(hits.normal, to_sun), 0.0, 1.0)[on], hits.cos_out[on]
    cos_phase = np.clip(dot(hits.to_viewer, to_sun), -1.0, 1.0)[on]
    ring = _disc(to_sun) if any(material.is_narrow for material in hits.surface.materials) else to_sun[None]

    def ask(material: Scatterer, of: np.ndarray) -> np.ndarray:
        if material.is_narrow:
            normal, to_viewer, total = hits.normal[:, on[of]], hits.to_viewer[:, on[of]], np.zeros(len(of))
            for point in ring:
                met, phase = np.clip(dot(normal, point), 0.0, 1.0), np.clip(dot(to_viewer, point), -1.0, 1.0)
                total += met * material.sunlight_brdf_per_sr(met, cos_out[of], phase)
        else:
            total = cos_in[of] * material.sunlight_brdf_per_sr(cos_in[of], cos_out[of], cos_phase[of])
        if material.rms_slope > 0.0:
            at = on[of]
            base_in = dot(hits.base[:, at], to_sun)
            total *= hits.projected_area[at] * masking_shadowing(
                base_in, hits.base_cos_out[at], dot(hits.to_viewer[:, at], to_sun), hits.slope[at]
            )
        return total / len(ring) if material.is_narrow else total

    lit[on] = share * visible[on] * hits.surface.evaluate_by_material(hits.facet[on], ask)
    return lit


def _disc(to_sun: np.ndarray) -> np.ndarray:
    """Return unit vectors (point, xyz) to points of equal weight on the Sun's disc."""
    slant = np.abs(to_sun)
    across = np.cross(to_sun, np.eye(3)[np.argmax(slant < slant.min() + _TIE)])
    across /= np.linalg.norm(across)
    upward = np.cross(to_sun, across)
    radius = np.repeat(np.sqrt(0.5 + np.array([-1.0, 1.0]) / np.sqrt(12.0)), 6) * SUN_RADIUS_RAD
    angle = (np.arange(12) + 0.5 * (np.arange(12) // 6)) * np.pi / 3.0
    points = to_sun + np.tan(radius)[:, None] * (np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * upward)
    disc: np.ndarray = points / np.linalg.norm(points, axis=1, keepdims=True)
    return disc
