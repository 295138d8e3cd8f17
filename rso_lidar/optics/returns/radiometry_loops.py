"""What `radiometry` does to each hit and to each pixel's returns, as loops."""

import math

import numpy as np

from rso_lidar import units
from rso_lidar.arithmetic import loop
from rso_lidar.optics.returns.blur_loops import sort_by
from rso_lidar.optics.returns.radiometry import CIRCLE, SQUARE

LIGHT = units.SPEED_OF_LIGHT_M_S
RANGE_PER_DELAY = units.RANGE_PER_DELAY_M_S


@loop
def returned(
    ray: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    z: np.ndarray,
    weight: np.ndarray,
    seen: np.ndarray,
    range_m: np.ndarray,
    cos_incidence: np.ndarray,
    brdf: np.ndarray,
    footprint: int,
    half_width: float,
    density: float,
    gathered: float,
    ifov: float,
    cells: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return delay [s], photons, depth spread [s], coherence cells and whether it is lit, for each hit.

    `footprint` is SQUARE, CIRCLE or GAUSSIAN; `density` its photons per unit area on the axis.
    """
    n = len(ray)
    delay_s, photons, spread_s, coherence_cells = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    lit = np.empty(n, np.bool_)
    for k in range(n):
        r, distance, cosine = ray[k], range_m[k], cos_incidence[k]
        across, down, cos_axis = x[r], y[r], z[r]
        edge = half_width * cos_axis
        if footprint == SQUARE:
            b = density if abs(across) <= edge and abs(down) <= edge else 0.0
        elif footprint == CIRCLE:
            b = density if across * across + down * down <= edge * edge else 0.0
        else:
            b = density * math.exp(-2.0 * (across * across + down * down) / (edge * edge))
        delay_s[k] = 2.0 * distance / LIGHT
        photons[k] = b * seen[k] * brdf[k] * cosine * cos_axis / (distance * distance) * gathered
        steep = max(cosine, 1e-3)
        tangent_share = math.sqrt(weight[k] * max(1.0 - steep * steep, 0.0)) / steep
        spread_s[k] = distance * (ifov / RANGE_PER_DELAY) * tangent_share if cosine > 0.0 else 0.0
        coherence_cells[k] = seen[k] * (cells * cos_axis * cos_axis * cos_axis)
        lit[k] = b > 0.0 and cosine > 0.0
    return delay_s, photons, spread_s, coherence_cells, lit


@loop
def clusters(
    pixel: np.ndarray, delay_s: np.ndarray, depth_spread_s: np.ndarray, gap_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the cluster of each return and the pixel of each cluster: only pixels wider than the gap are sorted."""
    n = len(pixel)
    cluster, cluster_pixel = np.empty(n, np.int32), np.empty(n, np.int32)
    order, sorted_s = np.empty(n, np.int64), np.empty(n)
    spare = np.empty(n, np.int64), np.empty(n)
    found, start = 0, 0
    while start < n:
        stop, near, far = start, delay_s[start], delay_s[start]
        while stop < n and pixel[stop] == pixel[start]:
            near, far = min(near, delay_s[stop]), max(far, delay_s[stop])
            stop += 1
        cluster_pixel[found] = pixel[start]
        if far - near <= gap_s:
            cluster[start:stop] = found
        else:
            for k in range(start, stop):
                order[k], sorted_s[k] = k, delay_s[k]
            sort_by(sorted_s, order, spare, start, stop)
            cluster[order[start]] = found
            for k in range(start + 1, stop):
                before, this = order[k - 1], order[k]
                bridged = min(depth_spread_s[before], depth_spread_s[this])
                if (delay_s[this] - delay_s[before]) - bridged > gap_s:
                    found += 1
                    cluster_pixel[found] = pixel[start]
                cluster[this] = found
        found += 1
        start = stop
    return cluster, cluster_pixel[:found].copy()
