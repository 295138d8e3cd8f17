"""Scattering from any direction into any other, at points of one surface."""

from __future__ import annotations

import numpy as np

from rso_lidar.records import Truth
from rso_lidar.scene.casting.local_hits import LocalHits, dot, localize_hits, rotate
from rso_lidar.scene.materials.crinkle import masking_shadowing
from rso_lidar.scene.materials.lobe import MOST_SHARE, Lobe
from rso_lidar.scene.surfaces.surface import Surface

LEAST_COSINE = 1e-9


def localize_points(
    surfaces: tuple[Surface, ...],
    number: int,
    truth: Truth,
    direction: np.ndarray,
    facet: np.ndarray,
    range_m: np.ndarray,
) -> LocalHits:
    """Express points on one surface in its own axes.

    Parameters
    ----------
    direction : (path, xyz), unit vectors from the lidar to the points, in lidar axes
    facet : (path), number of the facet
    range_m : (path), distance from the lidar [m]
    """
    turned = rotate(truth.poses.place(surfaces[number].name, "lidar"), direction.T)
    plane = surfaces[number].planes[:3, facet]
    return localize_hits(surfaces, number, truth, direction, facet, range_m, np.abs(dot(plane, turned)))


def find_lobes(points: LocalHits) -> np.ndarray:
    """Return the `Lobe` of the material at each point (path, 3)."""
    materials = points.surface.materials
    table = np.array([material.lobe or Lobe(0.0) for material in materials], dtype=float)
    table[:, 0] = np.minimum(table[:, 0], MOST_SHARE)
    lobes: np.ndarray = table[points.surface.finish[points.facet]]
    return lobes


def scatter_per_sr(points: LocalHits, light: np.ndarray, viewer: np.ndarray) -> np.ndarray:
    """Return the BRDF [1/sr] (path) for light from one direction, seen from another; 0 where either is behind the facet.

    On crinkled foil it contains the areas of the cell and the shadows of its neighbours, as for the light of the laser.

    Parameters
    ----------
    light, viewer : (xyz, path), unit vectors from the points, in the surface's axes
    """
    above = (dot(points.facing, light) > 0.0) & (dot(points.facing, viewer) > 0.0)
    cos_in, cos_out = (np.clip(dot(points.normal, direction), 0.0, 1.0) for direction in (light, viewer))
    phase = np.clip(dot(light, viewer), -1.0, 1.0)
    brdf = points.surface.brdf_per_sr(points.facet, cos_in, cos_out, phase)
    on = points.crinkled
    if len(on):
        base = points.base[:, on]
        base_in, base_out = (np.clip(dot(base, direction[:, on]), LEAST_COSINE, 1.0) for direction in (light, viewer))
        cos_tilt = dot(points.normal[:, on], base)
        brdf[on] *= cos_in[on] * cos_out[on] / (base_in * base_out * cos_tilt)
        brdf[on] *= masking_shadowing(base_in, base_out, phase[on], points.slope[on])
    return np.where(above, brdf, 0.0)
