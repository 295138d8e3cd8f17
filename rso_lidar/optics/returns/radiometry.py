"""How many photons come back: eq. 7 of Fuller et al., ray by ray, with the factor 4 that conserves energy."""

import numpy as np

from rso_lidar import units
from rso_lidar.arithmetic import compiled, packed
from rso_lidar.optics.laser import Laser
from rso_lidar.optics.receiver import Receiver
from rso_lidar.optics.returns.blur import Light, blurred
from rso_lidar.optics.sunlight import sun_photons_per_s_m2
from rso_lidar.records import Hits, Photons

SQUARE, CIRCLE, GAUSSIAN = range(3)  # footprints that a loop knows
FOOTPRINTS = {"square": SQUARE, "as_printed": SQUARE, "circle": CIRCLE, "gaussian": GAUSSIAN}


def collect(hits: Hits, laser: Laser, receiver: Receiver, late_s: float = 0.0) -> Photons:
    """Return the photons that each lit hit sends back to its pixel, of a pulse that left `late_s` [s] late.

    N = b · w · (p/f)² · ρ · cos α · A · cos θ · η / R²: b photons per unit area of the tangent plane, w the ray's share
    of its pixel, p/f the pixel's side in the tangent plane, ρ the BRDF, α the incidence, A the aperture's area, θ the
    angle from the boresight (the aperture is seen foreshortened), η the transmission, R the slant range. On the axis
    this is eq. 7 of Fuller et al. with the factor 4 of a square footprint.

    A laser beside the lens lights a facet from its own place: with R′ and θ′ from there, R becomes R′ and cos θ becomes
    cos⁴ θ / cos³ θ′, and the light's path is R + R′. A lens that distorts sees the solid angle that its pixels have.
    """
    light, lit = (_looped if _plain(laser) else _returned)(hits, laser, receiver)
    filled, background = None, _background(hits, light, laser, receiver)
    if laser.offset is not None or receiver.filter_width_nm is not None:  # then some rays meet what is not lit
        light = light if lit.all() else light.only(np.flatnonzero(lit))
        n_pixels = receiver.n_rows * receiver.n_cols
        filled = np.bincount(light.pixel, hits.weight[light.hit], n_pixels).reshape(receiver.shape)
    if receiver.psf is not None:
        light = blurred(hits, light, receiver, laser.wavelength_m, laser.pulse_fwhm_s)
    cluster, cluster_pixel = _clusters(light.pixel, light.delay_s, light.depth_spread_s, laser.pulse_fwhm_s)
    step_s, power = laser.pulse
    return Photons(
        shape=hits.rays.shape,
        pulse_fwhm_s=laser.pulse_fwhm_s,
        pulse_step_s=step_s,
        late_s=late_s,
        pulse_power_per_s=power,
        pixel=light.pixel,
        delay_s=light.delay_s,
        photons=light.photons,
        depth_spread_s=light.depth_spread_s,
        coherence_cells=light.coherence_cells,
        hit=light.hit,
        cluster=cluster,
        cluster_pixel=cluster_pixel,
        filled_fraction=filled,
        background_photons_per_s=background,
    )


def _plain(laser: Laser) -> bool:
    """Return whether a loop works out the light of this laser: it stands in the lens, and its beam has a formula."""
    return compiled() and laser.offset is None and laser.footprint in FOOTPRINTS


def _looped(hits: Hits, laser: Laser, receiver: Receiver) -> tuple[Light, np.ndarray]:
    """Return the light of each hit, and which hits are lit, as `_returned` does."""
    from rso_lidar.optics.returns.radiometry_loops import returned

    seen = hits.weight
    if receiver.distortion is not None:
        toward = hits.rays.direction[hits.ray]
        seen = seen * receiver.distortion.area_seen(toward[:, 0] / toward[:, 2], toward[:, 1] / toward[:, 2])
    x, y, z = hits.rays.direction.T
    delay_s, photons, spread_s, cells, lit = returned(
        packed(hits.ray),
        packed(x),
        packed(y),
        packed(z),
        packed(hits.weight),
        packed(seen),
        packed(hits.range_m),
        packed(hits.cos_incidence),
        packed(hits.brdf_per_sr),
        FOOTPRINTS[laser.footprint],
        laser.half_width_tangent,
        laser.density_on_axis,
        _gathered(receiver),
        receiver.ifov_rad,
        _cells_per_share(laser, receiver),
    )
    return Light(hits.pixel, delay_s, photons, spread_s, cells, np.arange(len(hits.ray), dtype=np.int32)), lit


def _returned(hits: Hits, laser: Laser, receiver: Receiver) -> tuple[Light, np.ndarray]:
    """Return the light of each hit, and which hits are lit."""
    x, y, cos_axis = (component[hits.ray] for component in hits.rays.direction.T)
    seen = hits.weight
    if receiver.distortion is not None:
        seen = seen * receiver.distortion.area_seen(x / cos_axis, y / cos_axis)
    if laser.offset is None:
        density = laser.density(x / cos_axis, y / cos_axis)
        toward = cos_axis / hits.range_m**2
        path_m = 2.0 * hits.range_m
    else:
        density, laser_range_m = _from_aside(hits, laser, x, y, cos_axis)
        toward = cos_axis**4 / laser_range_m**2
        path_m = hits.range_m + laser_range_m
    photons = density * seen * hits.brdf_per_sr * hits.cos_incidence * toward * _gathered(receiver)
    delay_s = path_m / units.SPEED_OF_LIGHT_M_S
    spread_s = _depth_spread_s(hits, 0.5 * path_m, receiver)
    cells = seen * (_cells_per_share(laser, receiver) * cos_axis * cos_axis * cos_axis)
    light = Light(hits.pixel, delay_s, photons, spread_s, cells, np.arange(len(hits.ray), dtype=np.int32))
    return light, (density > 0.0) & (hits.cos_incidence > 0.0)


def _gathered(receiver: Receiver) -> float:
    """Return (p/f)² A η: what of the light in front of the lens a whole pixel on the axis gathers [m²]."""
    return receiver.pixel_tangent**2 * receiver.aperture_area_m2 * receiver.transmission


def _cells_per_share(laser: Laser, receiver: Receiver) -> float:
    """Return the cells of coherence of a whole pixel on the axis: its solid angle times the aperture over λ²."""
    return receiver.pixel_tangent**2 * receiver.aperture_area_m2 / laser.wavelength_m**2


def _from_aside(
    hits: Hits, laser: Laser, x: np.ndarray, y: np.ndarray, cos_axis: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return density / cos³ θ′ of the laser's light at each hit, and the hit's distance [m] from the laser."""
    from_laser = np.stack([x, y, cos_axis]) * hits.range_m - np.array(laser.offset_m)[:, None]
    laser_range_m = np.sqrt(np.sum(from_laser**2, axis=0))
    before = from_laser[2] > 0.0
    cosine = np.where(before, from_laser[2] / laser_range_m, 1.0)
    depth = np.where(before, from_laser[2], 1.0)
    density = np.where(before, laser.density(from_laser[0] / depth, from_laser[1] / depth), 0.0)
    return density / cosine**3, laser_range_m


def _background(hits: Hits, light: Light, laser: Laser, receiver: Receiver) -> np.ndarray | None:
    """Return the sunlight [photons/s] on each pixel (row, col) that passes the filter; None without one.

    `light` is that of each hit, whose cells of coherence are the solid angle times A / λ². Sunlight is spread by no PSF,
    and weakened by the whole `transmission`, though it passes the lens only once: what the laser's own optics cost is not
    told apart. Both are assumed.
    """
    if receiver.filter_width_nm is None or hits.sunlight_per_sr is None:
        return None
    per_m2 = sun_photons_per_s_m2(laser.wavelength_m, receiver.filter_width_nm * units.NM)
    per_cell = per_m2 * laser.wavelength_m**2 * receiver.transmission
    rate = per_cell * hits.sunlight_per_sr * light.coherence_cells * hits.rays.direction[:, 2][hits.ray]
    n_pixels = receiver.n_rows * receiver.n_cols
    return np.bincount(hits.pixel, rate, n_pixels).reshape(receiver.shape)


def _depth_spread_s(hits: Hits, range_m: np.ndarray, receiver: Receiver) -> np.ndarray:
    """Return how long light returns from one ray's footprint [s]: 2 R δ tan α / c, δ the side of the footprint."""
    cosine = np.maximum(hits.cos_incidence, 1e-3)  # nearer to edge-on the product only has to stay finite
    tangent = np.sqrt(np.maximum(1.0 - cosine**2, 0.0)) / cosine
    spread = range_m / units.RANGE_PER_DELAY_M_S * np.sqrt(hits.weight) * receiver.ifov_rad * tangent
    return np.where(hits.cos_incidence > 0.0, spread, 0.0)


def _clusters(
    pixel: np.ndarray, delay_s: np.ndarray, depth_spread_s: np.ndarray, gap_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the cluster of each return and the pixel of each cluster.

    Returns of a pixel, in order of delay, part where two neighbours are more than `gap_s` apart, beyond what the less
    steep of the two surfaces bridges by its own depth spread: a tilted surface is one cluster, however far apart its rays
    land, and a rim before a wall is not. Clusters are numbered by pixel, then from near to far. `pixel` never falls.
    """
    if compiled():
        from rso_lidar.optics.returns.radiometry_loops import clusters

        return clusters(packed(pixel), packed(delay_s), packed(depth_spread_s), gap_s)
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
