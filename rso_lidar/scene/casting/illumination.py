"""Light that does not come from the lens: a laser beside it, and the Sun."""

from __future__ import annotations

import numpy as np

from rso_lidar.pose import ROOT, rotate_vectors
from rso_lidar.scene.casting.local_hits import LocalHits, dot
from rso_lidar.scene.casting.shadows import find_shadowed
from rso_lidar.scene.materials.crinkle import masking_shadowing
from rso_lidar.scene.materials.scatterer import SUN_RADIUS_RAD, Scatterer

_TIE = 1e-6  # components of a direction that differ by less count as equal, so that rounding decides nothing


def compute_laser_light(hits: LocalHits, laser_from_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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


def compute_sunlight(hits: LocalHits) -> np.ndarray:
    """Compute BRDF times cosine of incidence [1/sr] of sunlight toward the lidar, times the sunlit share of the Sun's disc.

    A lobe that changes within the disc is averaged over two rings of six points. This is Gauss quadrature in the square
    of the radius, exact for polynomials of degree five in the offset. It is good to a few per cent for lobes down to half
    the disc. Shadows have a sharp edge: the shadow ray goes to the centre of the disc.
    """
    lit = np.zeros(len(hits.facet))
    sun = np.asarray(hits.truth.sun_direction, dtype=float)
    share = float(np.asarray(hits.truth.sunlit.get(hits.surface.body, 1.0)))
    if not np.all(np.isfinite(sun)) or share <= 0.0 or not len(lit):
        return lit
    to_sun = rotate_vectors(hits.truth.poses.place(hits.surface.name, ROOT)[1], sun / np.linalg.norm(sun))
    toward = np.repeat(to_sun[:, None], len(lit), axis=1)
    up = (dot(hits.facing, toward) > 0.0) & (hits.cos_out > 0.0)
    up[find_shadowed(hits, up, toward, np.full(len(up), np.inf))] = False
    on = np.flatnonzero(up)
    ring = _disc(to_sun)

    def ask(material: Scatterer, of: np.ndarray) -> np.ndarray:
        normal, to_viewer, cos_out = hits.normal[:, on[of]], hits.to_viewer[:, on[of]], hits.cos_out[on[of]]
        points = ring if material.is_narrow else to_sun[None]
        total = np.zeros(len(of))
        for point in points:
            cos_in = np.clip(dot(normal, point), 0.0, 1.0)
            cos_phase = np.clip(dot(to_viewer, point), -1.0, 1.0)
            total += cos_in * material.sunlight_brdf_per_sr(cos_in, cos_out, cos_phase)
        slope = hits.slope[on[of]]
        if material.rms_slope > 0.0:
            cos_in, cos_phase = dot(hits.base[:, on[of]], to_sun), dot(to_viewer, to_sun)
            total *= hits.projected_area[on[of]] * masking_shadowing(
                cos_in, hits.base_cos_out[on[of]], cos_phase, slope
            )
        return total / len(points)

    lit[on] = share * hits.surface.evaluate_by_material(hits.facet[on], ask)
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
