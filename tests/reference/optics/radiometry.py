"""NumPy oracle of `rso_lidar.optics.returns.radiometry` for a laser at the lens: same signature, same returns."""

import numpy as np

from rso_lidar import units
from rso_lidar.optics import sun_photons_per_s_m2
from rso_lidar.optics.returns.blur import Light
from rso_lidar.records import Photons
from tests.reference.optics.blur import blur_light


def collect(hits, laser, receiver, late_s=0.0):
    """Return the photons that each lit hit sends back to its pixel."""
    light, lit = _light_of_hits(hits, laser, receiver)
    filled, background = None, None
    n_pixels = receiver.n_rows * receiver.n_cols
    if receiver.filter_width_nm is not None:
        if hits.sunlight_per_sr is not None:
            per_m2 = sun_photons_per_s_m2(laser.wavelength_m, receiver.filter_width_nm * units.NM)
            per_cell = per_m2 * laser.wavelength_m**2 * receiver.transmission
            rate = per_cell * hits.sunlight_per_sr * light.coherence_cells * hits.rays.direction[:, 2][hits.ray]
            background = np.bincount(hits.pixel, rate, n_pixels).reshape(receiver.shape)
        light = light.only(np.flatnonzero(lit))
        filled = np.bincount(light.pixel, hits.weight[light.hit], n_pixels).reshape(receiver.shape)
    if receiver.psf is not None:
        light = blur_light(hits, light, receiver, laser.wavelength_m, laser.pulse_fwhm_s)
    cluster, cluster_pixel = find_clusters(light.pixel, light.delay_s, light.depth_spread_s, laser.pulse_fwhm_s)
    step_s, power = laser.pulse
    return Photons(
        shape=hits.rays.shape,
        pulse_fwhm_s=laser.pulse_fwhm_s,
        pulse_step_s=step_s,
        late_s=late_s,
        pulse_power_per_s=power,
        **vars(light),
        cluster=cluster,
        cluster_pixel=cluster_pixel,
        filled_fraction=filled,
        background_photons_per_s=background,
    )


def _light_of_hits(hits, laser, receiver):
    """Return the light of each hit, and which hits are lit."""
    x, y, cos_axis = (component[hits.ray] for component in hits.rays.direction.T)
    seen = hits.weight
    if receiver.distortion is not None:
        seen = seen * receiver.distortion.area_at_direction(x / cos_axis, y / cos_axis)
    density = laser.density(x / cos_axis, y / cos_axis)
    toward = cos_axis / hits.range_m**2
    path_m = 2.0 * hits.range_m
    photons = (
        density
        * seen
        * hits.brdf_per_sr
        * hits.cos_incidence
        * toward
        * receiver.pixel_tangent**2
        * receiver.aperture_area_m2
        * receiver.transmission
    )
    delay_s = path_m / units.SPEED_OF_LIGHT_M_S
    spread_s = _depth_spread_s(hits, 0.5 * path_m, receiver)
    cells = seen * (
        receiver.pixel_tangent**2 * receiver.aperture_area_m2 / laser.wavelength_m**2 * cos_axis * cos_axis * cos_axis
    )
    light = Light(hits.pixel, delay_s, photons, spread_s, cells, np.arange(len(hits.ray), dtype=np.int32))
    return light, (density > 0.0) & (hits.cos_incidence > 0.0)


def _depth_spread_s(hits, range_m, receiver):
    """Return how long light returns from one ray's footprint [s]: 2 R δ tan α / c, δ the side of the footprint."""
    cosine = np.maximum(hits.cos_incidence, 1e-3)  # nearer to edge-on the product only has to stay finite
    tangent = np.sqrt(np.maximum(1.0 - cosine**2, 0.0)) / cosine
    side = np.sqrt(hits.weight) if hits.rays.side is None else hits.rays.side[hits.ray]
    spread = range_m / units.RANGE_PER_DELAY_M_S * side * receiver.ifov_rad * tangent
    return np.where(hits.cos_incidence > 0.0, spread, 0.0)


def find_clusters(pixel, delay_s, depth_spread_s, gap_s):
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
