"""How many photons come back: the seed's eq. 7, ray by ray, with the factor 4 that conserves energy."""

import numpy as np

from rso_lidar import units
from rso_lidar.optics.laser import Laser
from rso_lidar.optics.receiver import Receiver
from rso_lidar.records import Hits, Photons


def collect(hits: Hits, laser: Laser, receiver: Receiver) -> Photons:
    """Return the photons that each hit sends back to its pixel.

    N = b · w · (p/f)² · ρ · cos α · A · cos θ · η / R²: b photons per unit area of the tangent plane, w the ray's share
    of its pixel, p/f the pixel's side in the tangent plane, ρ the BRDF, α the incidence, A the aperture's area, θ the
    angle from the boresight (the aperture is seen foreshortened), η the transmission, R the slant range. On the axis
    this is the seed's eq. 7 with the factor 4 of a square footprint.
    """
    x, y, cos_axis = (component[hits.ray] for component in hits.rays.direction.T)
    density = laser.density(x / cos_axis, y / cos_axis)
    gathered = receiver.pixel_tangent**2 * receiver.aperture_area_m2 * receiver.transmission
    photons = density * hits.weight * hits.brdf_per_sr * hits.cos_incidence * cos_axis / hits.range_m**2 * gathered
    delay_s = hits.range_m / units.RANGE_PER_DELAY_M_S
    depth_spread_s = _depth_spread_s(hits, delay_s, receiver)
    cluster, cluster_pixel = _clusters(hits.pixel, delay_s, depth_spread_s, laser.pulse_fwhm_s)
    return Photons(
        shape=hits.rays.shape,
        pulse_fwhm_s=laser.pulse_fwhm_s,
        pixel=hits.pixel,
        delay_s=delay_s,
        photons=photons,
        depth_spread_s=depth_spread_s,
        cluster=cluster,
        cluster_pixel=cluster_pixel,
    )


def _depth_spread_s(hits: Hits, delay_s: np.ndarray, receiver: Receiver) -> np.ndarray:
    """Return the two-way delay from near to far edge of what a ray stands for: 2 R δ tan α / c, δ its angle."""
    cosine = np.maximum(hits.cos_incidence, 1e-3)  # nearer to edge-on the product only has to stay finite
    tangent = np.sqrt(np.maximum(1.0 - cosine**2, 0.0)) / cosine
    spread: np.ndarray = delay_s * np.sqrt(hits.weight) * receiver.ifov_rad * tangent
    return spread


def _clusters(
    pixel: np.ndarray, delay_s: np.ndarray, depth_spread_s: np.ndarray, gap_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the cluster of each return and the pixel of each cluster.

    Returns of a pixel, in order of delay, part where two neighbours are more than `gap_s` apart, beyond what the less
    steep of the two surfaces bridges by its own depth spread: a tilted surface is one cluster, however far apart its rays
    land, and a rim before a wall is not. Clusters are numbered by pixel, then from near to far. `pixel` never falls.
    """
    if not len(pixel):
        return np.zeros(0, dtype=np.int32), np.zeros(0, dtype=np.int32)
    first = np.flatnonzero(np.diff(pixel, prepend=-1))  # first return of each pixel that has any
    group_sizes = np.diff(first, append=len(pixel))
    group = np.repeat(np.arange(len(first)), group_sizes)
    wide = np.maximum.reduceat(delay_s, first) - np.minimum.reduceat(delay_s, first) > gap_s
    within = np.zeros(len(pixel), dtype=np.int32)  # cluster of a return within its pixel
    count = np.ones(len(first), dtype=np.int32)
    if wide.any():
        some = np.flatnonzero(wide[group])
        some = some[np.lexsort((delay_s[some], group[some]))]
        new_pixel = np.diff(group[some], prepend=-1) != 0
        steep_s = depth_spread_s[some]
        bridged_s = np.minimum(steep_s, np.roll(steep_s, 1))
        parts = (np.diff(delay_s[some], prepend=0.0) - bridged_s > gap_s) & ~new_pixel
        running = np.cumsum(parts)
        within[some] = running - np.repeat(running[new_pixel], group_sizes[wide])
        count[wide] += np.add.reduceat(parts, np.flatnonzero(new_pixel)).astype(np.int32)
    offset = np.cumsum(count) - count
    return (offset[group] + within).astype(np.int32), np.repeat(pixel[first], count)
