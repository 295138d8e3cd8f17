"""Lobes: where a material scatters most of its light, so that directions can be sampled there."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rso_lidar.kernels import kernel

NO_EXPONENT = -1.0  # the lobe is one of half vectors
MOST_SHARE = 0.95  # of the directions are drawn from a lobe; the rest finds what the lobe leaves out


class Lobe(NamedTuple):
    """A lobe about the mirror direction, from which directions are drawn; it need not equal the BRDF, only resemble it.

    `share` is that of the directions that are drawn from the lobe, the others are drawn by the cosine. With `exponent` n at
    least 0, their density is (n + 1)/(2π) cosⁿφ about the mirror direction. Otherwise half vectors are drawn from the GGX
    distribution of that `roughness` (Walter et al., EGSR 2007, eqs. 35 and 36).
    """

    share: float
    exponent: float = NO_EXPONENT
    roughness: float = 1.0


def check_lobe(lobe: object) -> str | None:
    """Return what is wrong with the lobe of a user-defined material, and what to do; None for a lobe that can be used."""
    if lobe is None:
        return None
    if not isinstance(lobe, Lobe):
        return f"is {lobe!r:.40}; make it a Lobe, or None"
    for name, value, least, most in (
        ("share", lobe.share, 0.0, 1.0),
        ("exponent", lobe.exponent, NO_EXPONENT, 1e9),
        ("roughness", lobe.roughness, 1e-4, 1.0),
    ):
        if not (isinstance(value, int | float) and least <= value <= most):
            return f"has the {name} {value!r:.40}; make it a number from {least:g} to {most:g}"
    return None


@kernel
def draw_directions(
    uniform: np.ndarray, lobe: np.ndarray, base: np.ndarray, normal: np.ndarray, viewer: np.ndarray
) -> np.ndarray:
    """Draw a direction for each path: from its lobe, or else by the cosine.

    Parameters
    ----------
    uniform : (3, path) numbers from 0 to 1: two for the direction, and one that chooses between lobe and cosine
    lobe : (path, 3) `Lobe` of each path
    base : (xyz, path) normal about which directions are drawn by the cosine
    normal : (xyz, path) normal of the lobe
    viewer : (xyz, path) direction whose mirror image the lobe is about

    Returns
    -------
    (xyz, path) unit vectors; one drawn from a lobe may point below the surface.
    """
    n = uniform.shape[1]
    drawn = np.empty((3, n))
    for k in range(n):
        u, v = uniform[0, k], uniform[1, k]
        share, exponent, roughness = lobe[k, 0], lobe[k, 1], lobe[k, 2]
        turn = 2.0 * math.pi * v
        of_lobe = uniform[2, k] < share
        if not of_lobe:
            x, y, z = base[0, k], base[1, k], base[2, k]
            cosine = math.sqrt(1.0 - u)
        else:
            x, y, z = normal[0, k], normal[1, k], normal[2, k]
            if exponent >= 0.0:
                c = 2.0 * (x * viewer[0, k] + y * viewer[1, k] + z * viewer[2, k])
                x, y, z = c * x - viewer[0, k], c * y - viewer[1, k], c * z - viewer[2, k]
                cosine = (1.0 - u) ** (1.0 / (exponent + 1.0))
            else:
                cosine = math.sqrt((1.0 - u) / (1.0 + (roughness * roughness - 1.0) * u))
        # Two axes across (x, y, z): Duff et al., "Building an orthonormal basis, revisited", JCGT 2017.
        sign = 1.0 if z >= 0.0 else -1.0
        a = -1.0 / (sign + z)
        b = x * y * a
        sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
        p, q = sine * math.cos(turn), sine * math.sin(turn)
        dx = p * (1.0 + sign * x * x * a) + q * b + cosine * x
        dy = p * sign * b + q * (sign + y * y * a) + cosine * y
        dz = -p * sign * x - q * y + cosine * z
        if of_lobe and exponent < 0.0:  # the half vector mirrors the viewer
            c = 2.0 * (dx * viewer[0, k] + dy * viewer[1, k] + dz * viewer[2, k])
            dx, dy, dz = c * dx - viewer[0, k], c * dy - viewer[1, k], c * dz - viewer[2, k]
        drawn[0, k], drawn[1, k], drawn[2, k] = dx, dy, dz
    return drawn


@kernel
def direction_density(
    direction: np.ndarray, lobe: np.ndarray, base: np.ndarray, normal: np.ndarray, viewer: np.ndarray
) -> np.ndarray:
    """Return the density [1/sr] (path) with which `draw_directions` draws directions.

    Parameters
    ----------
    direction : (xyz, path) unit vectors
    lobe, base, normal, viewer : as in `draw_directions`
    """
    n = direction.shape[1]
    density = np.empty(n)
    for k in range(n):
        x, y, z = direction[0, k], direction[1, k], direction[2, k]
        share, exponent, roughness = lobe[k, 0], lobe[k, 1], lobe[k, 2]
        cosine = base[0, k] * x + base[1, k] * y + base[2, k] * z
        density[k] = (1.0 - share) * max(cosine, 0.0) / math.pi
        if share == 0.0:
            continue
        vx, vy, vz = viewer[0, k], viewer[1, k], viewer[2, k]
        nx, ny, nz = normal[0, k], normal[1, k], normal[2, k]
        phase = x * vx + y * vy + z * vz
        met, left = nx * x + ny * y + nz * z, nx * vx + ny * vy + nz * vz
        if exponent >= 0.0:
            cos_mirror = 2.0 * met * left - phase
            if cos_mirror > 0.0:
                density[k] += share * (exponent + 1.0) / (2.0 * math.pi) * cos_mirror**exponent
        else:
            length = math.sqrt(max(2.0 + 2.0 * phase, 1e-30))
            cos_half, cos_facet = abs(met + left) / length, 0.5 * length
            if met + left > 0.0:
                alpha2 = roughness * roughness
                spread = 1.0 - (1.0 - alpha2) * min(cos_half, 1.0) ** 2
                facets = alpha2 / (math.pi * spread * spread)
                density[k] += share * facets * cos_half / (4.0 * cos_facet)
    return density
