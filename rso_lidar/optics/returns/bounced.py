"""Light that meets two surfaces or more: photons of further bounces, added to those of the first."""

import numpy as np

from rso_lidar import units
from rso_lidar.kernels import kernel, packed
from rso_lidar.optics.laser import Laser
from rso_lidar.optics.receiver import Receiver
from rso_lidar.optics.returns.blur import Light
from rso_lidar.records import Bounces, Hits

LEAST_COSINE = 1e-3  # nearer to edge-on the depth spread only has to stay finite


def add_bounced_light(
    light: Light, direct: np.ndarray, hits: Hits, bounces: Bounces, laser: Laser, receiver: Receiver
) -> Light:
    """Add the light of further bounces to that of the hits.

    Inward light of a path arrives in the pixel of its hit, as `collect` computes it: the irradiance is that at the path's
    end. Outward light is the beam's light on the share of the hit's area for which the path stands. It arrives in
    the pixel that sees the end. A path of pixel share w from a hit at R₁, with the irradiances E₁ and E₂ across the
    beam, brings

        inward   N = m w (p/f)² cos³θ₁ · E₂ · inward_per_sr · A cos θ₁ η,
        outward  N = m w (p/f)² cos³θ₁ R₁² · E₁ · outward_per_sr · A cos θ₂ η / R₂².

    Each is weighted by m, the density with which the path is drawn from the hit over the sum of that and the density with
    which it is drawn from its end. The latter is zero where no ray goes to that point.

    Parameters
    ----------
    direct : (hit) photons of each hit, lit or not
    hits : first facets that rays meet
    bounces : paths from these hits to their ends

    Returns
    -------
    All light, ordered by pixel; in a pixel that of the hits comes first.
    """
    if not len(bounces.hit):
        return light
    hit = bounces.hit
    ray = hits.rays.direction[hits.ray[hit]]
    x, y, cos_axis = ray.T
    first_per_m2, first_m = _irradiance(ray * hits.range_m[hit][:, None], laser)
    second_per_m2, second_m = _irradiance(bounces.direction * bounces.range_m[:, None], laser)
    pixel = _find_pixels(bounces.direction, receiver)
    n_pixels = receiver.n_rows * receiver.n_cols
    near = find_near_hits(
        packed(pixel, np.int64),
        packed(bounces.direction.T),
        np.searchsorted(hits.pixel, np.arange(n_pixels + 1)),
        packed(hits.ray),
        packed(hits.rays.direction.T),
    )
    has_ray = near >= 0
    if laser.offset is None:  # rays end where the beam does
        has_ray &= second_per_m2 > 0.0
        second_per_m2 = np.where(first_per_m2 > 0.0, second_per_m2, 0.0)
    own = 1.0 / (1.0 + np.where(has_ray, bounces.reverse_density, 0.0))
    area = np.full(len(hit), bounces.pixel_share)
    if receiver.distortion is not None:
        area *= receiver.distortion.area_at_direction(x / cos_axis, y / cos_axis)
    solid_angle = area * receiver.pixel_tangent**2 * cos_axis**3
    lens_m2 = own * solid_angle * receiver.aperture_area_m2 * receiver.transmission
    inward = lens_m2 * cos_axis * bounces.inward_per_sr * second_per_m2
    spreading = (hits.range_m[hit] / bounces.range_m) ** 2
    outward = lens_m2 * bounces.direction[:, 2] * bounces.outward_per_sr * first_per_m2 * spreading
    outward[pixel < 0] = 0.0
    cells = solid_angle * (receiver.aperture_area_m2 / laser.wavelength_m**2)
    beside = np.where(has_ray, near, hit)
    parts = [light]
    for into, at, photons, path_m in (
        (hits.pixel[hit], hit, inward, second_m + bounces.between_m + hits.range_m[hit]),
        (pixel, beside, outward, first_m + bounces.between_m + bounces.range_m),
    ):
        some = np.flatnonzero(photons > 0.0)
        at, photons = at[some].astype(np.int32), photons[some]
        beneath = direct[at] * (bounces.pixel_share / hits.weight[at])
        parts.append(
            Light(
                pixel=into[some].astype(np.int32),
                delay_s=path_m[some] / units.SPEED_OF_LIGHT_M_S,
                photons=photons,
                depth_spread_s=_depth_spread_s(hits, at, bounces.pixel_share, receiver),
                # A speckle pattern of its own adds as many cells as its share of the light from there.
                coherence_cells=cells[some] * photons / (photons + beneath),
                hit=at,
            )
        )
    order = np.argsort(np.concatenate([part.pixel for part in parts]), kind="stable")
    return Light(
        *(np.concatenate([getattr(part, name) for part in parts])[order] for name in Light.__dataclass_fields__)
    )


def _irradiance(point: np.ndarray, laser: Laser) -> tuple[np.ndarray, np.ndarray]:
    """Return the photons per square metre across the beam at points, b / (R² cos³θ), and their distance from the laser [m].

    Parameters
    ----------
    point : (path, xyz) in lidar axes [m]
    """
    x, y, z = (point - np.asarray(laser.offset_m)).T
    distance_m = np.sqrt(x * x + y * y + z * z)
    is_ahead = z > 0.0
    depth = np.where(is_ahead, z, 1.0)
    density = np.where(is_ahead, laser.density(x / depth, y / depth), 0.0)
    return density * distance_m / depth**3, distance_m


def _find_pixels(direction: np.ndarray, receiver: Receiver) -> np.ndarray:
    """Return the pixel (path) that the lens images directions (path, xyz) to; -1 outside the focal plane.

    Parameters
    ----------
    direction : unit vectors in lidar axes
    """
    pixel = np.full(len(direction), -1, np.int64)
    x, y, z = direction.T
    edge = receiver.field_edge
    ahead = np.flatnonzero((z > 0.0) & (np.abs(x) <= edge[0] * z) & (np.abs(y) <= edge[1] * z))
    col, row = (np.floor(at) for at in receiver.image_of(x[ahead] / z[ahead], y[ahead] / z[ahead]))
    inside = (col >= 0) & (col < receiver.n_cols) & (row >= 0) & (row < receiver.n_rows)
    pixel[ahead[inside]] = (row * receiver.n_cols + col)[inside]
    return pixel


@kernel
def find_near_hits(
    pixel: np.ndarray, direction: np.ndarray, begins: np.ndarray, ray: np.ndarray, along: np.ndarray
) -> np.ndarray:
    """Find, for each direction, the hit of its pixel whose ray is nearest to it.

    Parameters
    ----------
    pixel : (path) i8, -1 for a direction that no pixel sees
    direction : (xyz, path) unit vectors
    begins : (pixel + 1) where the hits of each pixel begin
    ray : (hit) index of the ray
    along : (xyz, ray) unit vectors

    Returns
    -------
    (path) i8, number of the hit, or -1 where the pixel has none.
    """
    nearest_hit = np.full(len(pixel), -1, np.int64)
    for k in range(len(pixel)):
        if pixel[k] < 0:
            continue
        nearest = np.inf
        for h in range(begins[pixel[k]], begins[pixel[k] + 1]):
            x, y, z = (
                along[0, ray[h]] - direction[0, k],
                along[1, ray[h]] - direction[1, k],
                along[2, ray[h]] - direction[2, k],
            )
            apart = x * x + y * y + z * z
            if apart < nearest:
                nearest, nearest_hit[k] = apart, h
    return nearest_hit


def _depth_spread_s(hits: Hits, at: np.ndarray, share: float, receiver: Receiver) -> np.ndarray:
    """Return how long light of one path returns from the footprint [s] that its share of a pixel has: R δ tan α / c.

    It is half that of a ray, because only the way to the lens is tilted by the facet's slope.

    Parameters
    ----------
    at : (path) the hit that sends the light
    """
    cosine = np.maximum(hits.cos_incidence[at], LEAST_COSINE)
    tangent = np.sqrt(np.maximum(1.0 - cosine**2, 0.0)) / cosine
    spread: np.ndarray = hits.range_m[at] * (share**0.5 * receiver.ifov_rad / units.SPEED_OF_LIGHT_M_S) * tangent
    return spread
