"""How many photons come back from each hit: Fuller et al., eq. 7, with the factor 4 that conserves energy."""

import math

import numpy as np

from rso_lidar import units
from rso_lidar.kernels import kernel, packed
from rso_lidar.optics.laser import Laser
from rso_lidar.optics.receiver import Receiver
from rso_lidar.optics.returns.blur import Light, blur_light, blur_sunlight, blur_variance
from rso_lidar.optics.returns.bounced import LEAST_COSINE, add_bounced_light
from rso_lidar.optics.returns.clusters import find_clusters
from rso_lidar.optics.sunlight import sun_photons_per_s_m2
from rso_lidar.records import Bounces, Hits, Oversampled, Photons

SQUARE, CIRCLE, GAUSSIAN = range(3)  # footprints with a formula
FOOTPRINTS = {"square": SQUARE, "as_printed": SQUARE, "circle": CIRCLE, "gaussian": GAUSSIAN}


def collect(
    hits: Hits, laser: Laser, receiver: Receiver, late_s: float = 0.0, bounces: Bounces | None = None
) -> Photons:
    """Collect the photons that each lit hit sends back to its pixel.

    N = b · w · (p/f)² · ρ · cos α · A · cos θ · η / R². Here b is photons per unit area of the tangent plane. w is the
    ray's share of its pixel, p/f the pixel's side in the tangent plane. ρ is the BRDF, α the incidence, A the
    aperture's area and θ the angle from the boresight, at which the aperture is foreshortened. η is the transmission
    and R the slant range. On the axis this is Fuller et al., eq. 7, with the factor 4 of a square footprint.

    A laser beside the lens lights a facet from its own position. With R′ and θ′ from there, R becomes R′, cos θ becomes
    cos⁴ θ / cos³ θ′, and the light's path is R + R′. A lens that distorts changes the solid angles of its pixels.

    Parameters
    ----------
    hits : first facets that rays meet
    laser : the laser of this pulse
    receiver : the lens and the focal plane
    late_s : how late the pulse left, against the receiver's clock [s]
    bounces : paths from these hits to further points (None: light that meets two surfaces or more is left out)

    Returns
    -------
    Expected photons: one return for each lit hit, up to two for each path, or more behind a lens with a point spread
    function.
    """
    light, is_lit = _light_before_lens(hits, laser, receiver)
    filled, background, direct = None, _sunlight(hits, laser, receiver), light.photons
    if laser.offset is not None or receiver.filter_width_nm is not None:  # then some rays meet unlit surfaces
        light = light if is_lit.all() else light.only(np.flatnonzero(is_lit))
        n_pixels = receiver.n_rows * receiver.n_cols
        filled = np.bincount(light.pixel, hits.weight[light.hit], n_pixels).reshape(receiver.shape)
    pulse_fwhm_s, (step_s, power) = laser.pulse_fwhm_s, laser.pulse
    if bounces is not None:
        light = add_bounced_light(light, direct, hits, bounces, laser, receiver)
    if receiver.psf is not None:
        light = blur_light(hits, light, receiver, laser.wavelength_m, pulse_fwhm_s)
    cluster, cluster_pixel = find_clusters(
        packed(light.pixel), packed(light.delay_s), packed(light.depth_spread_s), pulse_fwhm_s
    )
    return Photons(
        shape=hits.rays.shape,
        pulse_fwhm_s=pulse_fwhm_s,
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
        photons_variance=blur_variance(hits.photons_variance, receiver, laser.wavelength_m),
    )


def pixel_photons(hits: Hits, laser: Laser, receiver: Receiver) -> np.ndarray:
    """Return the photons (hit) that a whole pixel would send back, if all of it were as bright as the hit.

    Parameters
    ----------
    hits : the hits
    laser, receiver : the instrument
    """
    light, is_lit = _light_before_lens(hits, laser, receiver)
    photons: np.ndarray = np.where(is_lit, light.photons / hits.weight, 0.0)
    return photons


def _light_before_lens(hits: Hits, laser: Laser, receiver: Receiver) -> tuple[Light, np.ndarray]:
    """Return the light of each hit before the lens spreads it, and which hits are lit."""
    has_formula = laser.offset is None and laser.footprint in FOOTPRINTS
    return (_light_of_beam if has_formula else _light_of_any_laser)(hits, laser, receiver)


def _light_of_beam(hits: Hits, laser: Laser, receiver: Receiver) -> tuple[Light, np.ndarray]:
    """Return the light of each hit, and which hits are lit, for a laser at the lens whose beam has a formula."""
    area = hits.weight
    if receiver.distortion is not None:
        toward = hits.rays.direction[hits.ray]
        area = area * receiver.distortion.area_at_direction(toward[:, 0] / toward[:, 2], toward[:, 1] / toward[:, 2])
    delay_s, photons, spread_s, cells, hit, is_lit = return_light(
        packed(hits.ray),
        packed(hits.rays.direction.T),
        packed(_sides(hits)),
        packed(area),
        packed(hits.range_m),
        packed(hits.cos_incidence),
        packed(hits.brdf_per_sr),
        FOOTPRINTS[laser.footprint],
        laser.half_width_tangent,
        laser.density_on_axis,
        _gathering_area_m2(receiver),
        receiver.ifov_rad,
        _cells_per_pixel(laser, receiver),
    )
    return Light(hits.pixel, delay_s, photons, spread_s, cells, hit), is_lit


@kernel
def return_light(
    ray: np.ndarray,
    direction: np.ndarray,
    side: np.ndarray,
    area: np.ndarray,
    range_m: np.ndarray,
    cos_incidence: np.ndarray,
    brdf_per_sr: np.ndarray,
    footprint: int,
    half_width: float,
    density: float,
    gathering_m2: float,
    ifov_rad: float,
    cells_per_pixel: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return what each hit sends back: a laser at the lens, whose beam has a formula.

    Parameters
    ----------
    ray, range_m, cos_incidence, brdf_per_sr : (hit) fields of `Hits`
    side : (hit) side of each ray's share of its pixel
    direction : (xyz, ray) unit vectors of all rays
    area : (hit) area that each ray covers in the tangent plane, in pixels
    half_width : tangent of half the beam's full angle
    density : photons per unit area of the tangent plane, on the axis
    cells_per_pixel : cells of coherence of a pixel on the axis

    Returns
    -------
    Delay [s], photons, depth spread [s], cells of coherence, number of the hit and whether it is lit (hit).
    """
    n = len(ray)
    delay_s, photons, spread_s, coherence_cells = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    hit, is_lit, cosines = np.empty(n, np.int32), np.empty(n, np.bool_), np.empty(n)
    for k in range(n):
        across, down, cos_axis = direction[0, ray[k]], direction[1, ray[k]], direction[2, ray[k]]
        edge = half_width * cos_axis
        if footprint == SQUARE:
            b = density if abs(across) <= edge and abs(down) <= edge else 0.0
        elif footprint == CIRCLE:
            b = density if across * across + down * down <= edge * edge else 0.0
        else:
            b = density * math.exp(-2.0 * (across * across + down * down) / (edge * edge))
        photons[k], cosines[k] = b, cos_axis
    for k in range(n):  # apart from the lookups above, so that it is vectorised
        b, cos_axis, distance, cosine = photons[k], cosines[k], range_m[k], cos_incidence[k]
        delay_s[k] = 2.0 * distance / units.SPEED_OF_LIGHT_M_S
        photons[k] = b * area[k] * brdf_per_sr[k] * cosine * cos_axis / (distance * distance) * gathering_m2
        steep = max(cosine, LEAST_COSINE)
        tangent_share = side[k] * math.sqrt(max(1.0 - steep * steep, 0.0)) / steep
        spread_s[k] = distance * (ifov_rad / units.RANGE_PER_DELAY_M_S) * tangent_share if cosine > 0.0 else 0.0
        coherence_cells[k] = area[k] * (cells_per_pixel * cos_axis * cos_axis * cos_axis)
        hit[k], is_lit[k] = k, b > 0.0 and cosine > 0.0
    return delay_s, photons, spread_s, coherence_cells, hit, is_lit


def _light_of_any_laser(hits: Hits, laser: Laser, receiver: Receiver) -> tuple[Light, np.ndarray]:
    """Return the light of each hit, and which hits are lit, for a measured pattern or a laser beside the lens."""
    x, y, cos_axis = (component[hits.ray] for component in hits.rays.direction.T)
    area = hits.weight
    if receiver.distortion is not None:
        area = area * receiver.distortion.area_at_direction(x / cos_axis, y / cos_axis)
    if laser.offset is None:
        density = laser.density(x / cos_axis, y / cos_axis)
        toward = cos_axis / hits.range_m**2
        path_m = 2.0 * hits.range_m
    else:
        density, laser_range_m = _density_at(np.stack([x, y, cos_axis]) * hits.range_m, laser)
        toward = cos_axis**4 / laser_range_m**2
        path_m = hits.range_m + laser_range_m
    photons = density * area * hits.brdf_per_sr * hits.cos_incidence * toward * _gathering_area_m2(receiver)
    delay_s = path_m / units.SPEED_OF_LIGHT_M_S
    spread_s = _depth_spread_s(hits, 0.5 * path_m, receiver)
    cells = area * (_cells_per_pixel(laser, receiver) * cos_axis * cos_axis * cos_axis)
    light = Light(hits.pixel, delay_s, photons, spread_s, cells, np.arange(len(hits.ray), dtype=np.int32))
    return light, (density > 0.0) & (hits.cos_incidence > 0.0)


def _gathering_area_m2(receiver: Receiver) -> float:
    """Return (p/f)² A η: what of the light in front of the lens a whole pixel on the axis gathers [m²]."""
    return receiver.pixel_tangent**2 * receiver.aperture_area_m2 * receiver.transmission


def _cells_per_pixel(laser: Laser, receiver: Receiver) -> float:
    """Return the cells of coherence of a whole pixel on the axis: its solid angle times the aperture over λ²."""
    return receiver.pixel_tangent**2 * receiver.aperture_area_m2 / laser.wavelength_m**2


def _density_at(point_m: np.ndarray, laser: Laser) -> tuple[np.ndarray, np.ndarray]:
    """Return the density of a laser's light over cos³ θ′ (hit) at points, and their distance from the laser (hit) [m].

    Parameters
    ----------
    point_m : (xyz, hit) the points in lidar axes [m]
    """
    from_laser = point_m - np.array(laser.offset_m)[:, None]
    laser_range_m = np.sqrt(np.sum(from_laser**2, axis=0))
    is_ahead = from_laser[2] > 0.0
    cosine = np.where(is_ahead, from_laser[2] / laser_range_m, 1.0)
    depth = np.where(is_ahead, from_laser[2], 1.0)
    density = np.where(is_ahead, laser.density(from_laser[0] / depth, from_laser[1] / depth), 0.0)
    return density / cosine**3, laser_range_m


def _sunlight(hits: Hits, laser: Laser, receiver: Receiver) -> np.ndarray | None:
    """Return the sunlight on each pixel (row, col) that passes the filter [photons/s]; None without a filter.

    It is weakened by the whole `transmission` although it passes the lens once: the losses of the laser's own optics are not
    stated apart. That is assumed.
    """
    if receiver.filter_width_nm is None or hits.sunlight_per_sr is None:
        return None
    per_m2 = sun_photons_per_s_m2(laser.wavelength_m, receiver.filter_width_nm * units.NM)
    return per_m2 * image_sunlight(hits, receiver, laser.wavelength_m)


def image_sunlight(hits: Hits, receiver: Receiver, wavelength_m: float) -> np.ndarray:
    """Return the light of Sun and Earth that targets reflect onto each pixel, over the irradiance of the Sun.

    L · w · (p/f)² · A · cos⁴ θ · η, summed over the hits: L is `Hits.sunlight_per_sr`, w the ray's share of its pixel, p/f
    the pixel's side in the tangent plane, A the area of the aperture, θ the angle from the boresight and η the transmission.

    Parameters
    ----------
    hits : first facets that rays meet, with the sunlight on each
    receiver : the lens and the focal plane
    wavelength_m : of the light [m], for the point spread function

    Returns
    -------
    (row, col) [m²], behind the lens. Times photons/s/m² of the Sun these are photons/s.
    """
    assert hits.sunlight_per_sr is not None
    light = hits.sunlight_per_sr * _area_of_rays(hits, receiver)
    return _image_light(hits, light * hits.rays.direction[hits.ray, 2] ** 4, receiver, wavelength_m)


def image_flash(
    hits: Hits, laser: Laser, lidar_from_camera: tuple[np.ndarray, np.ndarray], receiver: Receiver
) -> np.ndarray:
    """Return the photons of one laser pulse that targets reflect onto each pixel of a camera beside the lidar.

    ρ · cos α · b / (R′² cos³ θ′) · w · (p/f)² · A · cos⁴ θ · η, summed over the hits: ρ is the BRDF and α the incidence of
    the laser's light. b is photons per unit area of the tangent plane, R′ the distance and θ′ the angle from the laser.
    The other quantities are those of `image_sunlight`.

    Parameters
    ----------
    hits : first facets that rays of the camera meet, cast with the laser at its place
    laser : the laser of this pulse
    lidar_from_camera : position [m] and rotation matrix
    receiver : lens and focal plane of the camera

    Returns
    -------
    (row, col) photons, behind the lens.
    """
    origin_m, turn = lidar_from_camera
    point_m = np.einsum("ij,hj->ih", turn, hits.rays.direction[hits.ray] * hits.range_m[:, None]) + origin_m[:, None]
    density, laser_range_m = _density_at(point_m, laser)
    light = density / laser_range_m**2 * hits.brdf_per_sr * hits.cos_incidence * _area_of_rays(hits, receiver)
    return _image_light(hits, light * hits.rays.direction[hits.ray, 2] ** 4, receiver, laser.wavelength_m)


def _area_of_rays(hits: Hits, receiver: Receiver) -> np.ndarray:
    """Return what each ray gathers of a radiance on the axis (hit) [m²]: its share of w · (p/f)² A η."""
    area = hits.weight * _gathering_area_m2(receiver)
    if receiver.distortion is not None:
        x, y, cos_axis = (component[hits.ray] for component in hits.rays.direction.T)
        area = area * receiver.distortion.area_at_direction(x / cos_axis, y / cos_axis)
    return area


def _image_light(hits: Hits, light: np.ndarray, receiver: Receiver, wavelength_m: float) -> np.ndarray:
    """Sum the light of hits (hit) over pixels (row, col), behind the point spread function if there is one."""
    if receiver.psf is not None:
        return blur_sunlight(hits, light, receiver, wavelength_m)
    counted = np.bincount(hits.pixel, light, receiver.n_rows * receiver.n_cols)
    return counted.astype(float).reshape(receiver.shape)  # numpy counts whole numbers where there is no hit


def _sides(hits: Hits) -> np.ndarray:
    """Return the side (hit) of each ray's share of its pixel, over the pixel's side."""
    side: np.ndarray = np.sqrt(hits.weight) if hits.rays.side is None else hits.rays.side[hits.ray]
    return side


def _depth_spread_s(hits: Hits, range_m: np.ndarray, receiver: Receiver) -> np.ndarray:
    """Return how long light returns from one ray's footprint [s]: 2 R δ tan α / c.

    Parameters
    ----------
    hits : the hits, with cos α and the rays' shares of their pixels
    range_m : (hit) half the light's path
    receiver : gives δ, the angle that a ray's footprint spans
    """
    cosine = np.maximum(hits.cos_incidence, LEAST_COSINE)
    tangent = np.sqrt(np.maximum(1.0 - cosine**2, 0.0)) / cosine
    spread = range_m / units.RANGE_PER_DELAY_M_S * _sides(hits) * receiver.ifov_rad * tangent
    return np.where(hits.cos_incidence > 0.0, spread, 0.0)


def oversample(hits: Hits, laser: Laser, receiver: Receiver) -> Oversampled:
    """Draw the range and the photon image of one flash on the grid of rays, k x k cells to a pixel, before any PSF.

    Where rays are finer than cells their photons add, and the nearest gives the range.

    Parameters
    ----------
    hits : the hits of the flash
    laser, receiver : the instrument

    Returns
    -------
    Both images (fine_row, fine_col).
    """
    photons = collect(hits, laser, receiver.replace(psf=None))
    k = receiver.rays_per_side
    n_rows, n_cols = receiver.n_rows * k, receiver.n_cols * k
    direction = hits.rays.direction[hits.ray]
    col, row = receiver.image_of(direction[:, 0] / direction[:, 2], direction[:, 1] / direction[:, 2])
    fine_row = np.clip((row * k).astype(np.int64), 0, n_rows - 1)
    fine_col = np.clip((col * k).astype(np.int64), 0, n_cols - 1)
    cell = fine_row * n_cols + fine_col
    sent = np.bincount(photons.hit, photons.photons, len(hits.ray))
    image = np.bincount(cell, sent, n_rows * n_cols)
    range_m = np.full(n_rows * n_cols, np.inf)
    np.minimum.at(range_m, cell, hits.range_m)
    range_m[np.isinf(range_m)] = np.nan
    return Oversampled(range_m.reshape(n_rows, n_cols), image.reshape(n_rows, n_cols))
