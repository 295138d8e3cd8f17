"""Openings: on which side of a facet anything lies that its light could meet."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from rso_lidar.kernels import kernel
from rso_lidar.records import Truth
from rso_lidar.scene.surfaces.surface import Surface

_FLAT = 1e-6  # of the surface's size: what stands out less is the facet's own plane, rounded
_BLOCK = 4096  # facets at once


def find_openings(surfaces: Sequence[Surface], number: int, truth: Truth) -> np.ndarray:
    """Find the sides of facets in front of which anything lies: another part of the surface, or another surface.

    A facet of a convex body lights nothing, so no path begins there. Other surfaces count by their bounding sphere.

    Parameters
    ----------
    truth : where the surfaces are

    Returns
    -------
    (2, facet) whether anything lies in front of the side to which the plane's normal points, and of the other side.
    """
    surface = surfaces[number]
    opening = _own_openings(surface).copy()
    x, y, z, offset = surface.planes
    for k, other in enumerate(surfaces):
        if k != number:
            centre, radius = other.sphere
            place, turn = truth.poses.place(surface.name, other.name)
            a, b, c = place + turn @ centre
            ahead = a * x + b * y + c * z - offset
            opening[0] |= ahead + radius > 0.0
            opening[1] |= ahead - radius < 0.0
    return opening


@lru_cache(maxsize=64)
def _own_openings(surface: Surface) -> np.ndarray:
    """Return the openings (2, facet) of a surface that is alone."""
    normal, offset = surface.planes[:3], surface.planes[3]
    opening = np.empty((2, len(offset)), bool)
    flat = _FLAT * (surface.sphere[1] + float(np.linalg.norm(surface.sphere[0])))
    for start in range(0, len(offset), _BLOCK):
        block = slice(start, start + _BLOCK)
        ahead = normal[:, block].T @ surface.outline.T - offset[block, None]
        opening[0, block] = ahead.max(axis=1) > flat
        opening[1, block] = ahead.min(axis=1) < -flat
    return opening


@kernel
def mark_open(
    direction: np.ndarray, facet: np.ndarray, turn: np.ndarray, planes: np.ndarray, openings: np.ndarray
) -> np.ndarray:
    """Return whether anything lies in front of the side of its facet that each ray meets (hit).

    Parameters
    ----------
    direction : (xyz, hit) unit vectors of the rays, in lidar axes
    facet : (hit) number of the facet
    turn : (xyz, xyz) rotation body_from_lidar
    planes : (4, facet) planes of the facets
    openings : (2, facet) as `find_openings` returns them
    """
    is_open = np.empty(len(facet), np.bool_)
    for k in range(len(facet)):
        f = facet[k]
        toward = 0.0
        for axis in range(3):
            row = turn[axis]
            along = row[0] * direction[0, k] + row[1] * direction[1, k] + row[2] * direction[2, k]
            toward += planes[axis, f] * along
        is_open[k] = openings[1, f] if toward > 0.0 else openings[0, f]
    return is_open
