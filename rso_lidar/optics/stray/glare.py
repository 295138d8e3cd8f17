"""Sun, Earth and Moon in the image: their own images, and the veil of light that the lens scatters over the field."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from rso_lidar import units
from rso_lidar.kernels import kernel, packed
from rso_lidar.optics.laser import Laser
from rso_lidar.optics.lens.surface_scatter import Glare
from rso_lidar.optics.receiver import Receiver
from rso_lidar.optics.returns.blur import blur_steady_light
from rso_lidar.optics.stray.ghosts import add_ghosts, copy_image
from rso_lidar.optics.stray.sources import EARTH, STRAY_BODIES, SkyBodies, locate_bodies
from rso_lidar.optics.sunlight import sun_photons_per_s_m2
from rso_lidar.records import Hits, Photons, Sky, Truth

_PER_RADIUS = 16  # points of a pixel across the radius of a disc in it ...
_FEWEST, _MOST = 4, 64  # ... and their limits along a pixel's side
_EARTH_POINTS = 3  # along a pixel's side
_PER_KNEE = 4  # pixels at which the veil is computed, along the angle of the scatter's knee
_WIDEST = 8  # pixels from one of them to the next


def see_sky(
    laser: Laser, receiver: Receiver, truth: Truth, moon_m: np.ndarray | None = None, *, has_earth: bool = True
) -> Sky | None:
    """Return Sun, lit Earth and Moon as the lens sees them; None without glare.

    Parameters
    ----------
    laser : gives the wavelength
    receiver : the lens, its filter and its glare
    truth : one epoch, with the lidar in it
    moon_m : (xyz) position of the Moon in root axes [m]; None without a Moon
    has_earth : whether the root's origin is the centre of the Earth

    Returns
    -------
    Images and elements of the bodies, without what targets hide.
    """
    glare = receiver.glare
    if glare is None:
        return None
    bodies = locate_bodies(truth, moon_m, glare.earth_albedo, has_earth=has_earth)
    per_m2 = band_photons_per_s_m2(laser, receiver)
    wanted = tuple(STRAY_BODIES.index(name) for name in sorted(set(glare.sources), key=STRAY_BODIES.index))
    elements = [bodies.elements(body, _half_field_rad(receiver), _knee_rad(glare)) for body in wanted]
    directions, light, radius = (np.concatenate(columns) for columns in zip(*elements, strict=True))
    number = np.repeat(wanted, [len(body_elements[1]) for body_elements in elements])
    image = per_m2 * _image_sky(bodies, wanted, receiver)
    return Sky(image, directions, per_m2 * receiver.aperture_area_m2 * light, radius, number)


def image_sky(
    receiver: Receiver,
    truth: Truth,
    moon_m: np.ndarray | None,
    earth_albedo: float,
    *,
    sources: tuple[str, ...] = STRAY_BODIES,
    has_earth: bool = True,
) -> np.ndarray:
    """Return the image of Sun, lit Earth and Moon before a lens without blur, over the irradiance of the Sun.

    Parameters
    ----------
    receiver : the lens and the focal plane
    truth : one epoch, with the viewer in it as "lidar"
    moon_m : (xyz) position of the Moon in root axes [m]; None without a Moon
    earth_albedo : of the Earth

    Other Parameters
    ----------------
    sources : bodies whose light is wanted, of `STRAY_BODIES`; the others are dark, but hide what is behind them
    has_earth : whether the root's origin is the centre of the Earth

    Returns
    -------
    (row, col) [m²], without what targets hide. Times photons/s/m² of the Sun these are photons/s.
    """
    bodies = locate_bodies(truth, moon_m, earth_albedo, has_earth=has_earth)
    return _image_sky(bodies, tuple(STRAY_BODIES.index(name) for name in sources), receiver)


def band_photons_per_s_m2(laser: Laser, receiver: Receiver) -> float:
    """Return the Sun's photons per second and square metre in the band of the filter."""
    assert receiver.filter_width_nm is not None
    return sun_photons_per_s_m2(laser.wavelength_m, receiver.filter_width_nm * units.NM)


def add_stray_light(
    photons: Photons,
    hits: Hits,
    laser: Laser,
    receiver: Receiver,
    sky: Sky | None = None,
    hidden: np.ndarray | None = None,
    pulses: int = 1,
) -> Photons:
    """Add ghosts, the images of Sun, Earth and Moon, and the veil that the lens scatters of them.

    The images pass the point spread function, and ghosts copy them. The veil is smooth, and neither is done to it.

    Parameters
    ----------
    photons : light of the targets behind the lens
    hits : where rays met targets, which hide the sky
    laser : gives the wavelength
    receiver : the lens with its stray light
    sky : the bodies; None without them
    hidden : (element) elements of the sky that targets hide from the lens; None for none
    pulses : number of pulses of the frame

    Returns
    -------
    The light with stray light: ghosts as further returns, all steady light in the background.
    """
    background = photons.background_photons_per_s
    if sky is not None:
        seen = _image_with_targets(sky, hits, laser, receiver)
        background = seen if background is None else background + seen
    if background is not None and receiver.ghosts:
        background = background + sum(copy_image(background, ghost, receiver) for ghost in receiver.ghosts)
    if sky is not None and background is not None:
        background = background + veil(sky, receiver, hidden)
    return replace(add_ghosts(photons, receiver, pulses), background_photons_per_s=background)


def veil(sky: Sky, receiver: Receiver, hidden: np.ndarray | None = None) -> np.ndarray:
    """Return the scattered light of the sky on each pixel (row, col) [photons/s].

    It is computed at some pixels and interpolated by cubic splines, as finely as the knee of the scatter demands.

    Parameters
    ----------
    sky : the bodies, from `see_sky`
    receiver : the lens with its glare
    hidden : (element) elements that targets hide from the lens; None for none
    """
    glare = receiver.glare
    assert glare is not None
    free = np.full(len(sky.body), True) if hidden is None else ~hidden
    if not free.any():
        return np.zeros(receiver.shape)
    rows, cols, sight, gathered = _nodes(receiver)
    strength = packed(lens_light(sky, receiver)[free])
    toward = packed(sky.direction[free, :2])
    scattered = sum_scatter(
        packed(sight.reshape(-1, 3)[:, :2]),
        toward,
        strength,
        packed(0.5 * sky.radius_rad[free] ** 2),
        glare.surfaces * glare.peak_per_sr,
        glare.knee_sine,
        glare.slope,
    ).reshape(sight.shape[:2])
    if len(rows) < receiver.n_rows or len(cols) < receiver.n_cols:
        from scipy.interpolate import RectBivariateSpline

        scattered = np.asarray(
            RectBivariateSpline(rows, cols, scattered)(np.arange(receiver.n_rows), np.arange(receiver.n_cols))
        )
    light: np.ndarray = np.maximum(scattered, 0.0) * gathered
    return light


def veil_on_axis(sky: Sky, receiver: Receiver, hidden: np.ndarray | None = None) -> np.ndarray:
    """Return the scattered light of each body in a pixel on the boresight (body) [photons/s], in order of `STRAY_BODIES`.

    Parameters
    ----------
    sky : the bodies, from `see_sky`
    receiver : the lens with its glare
    hidden : (element) elements of the bodies that targets hide from the lens (None: none)
    """
    glare = receiver.glare
    assert glare is not None
    shift = np.sqrt(np.sum(sky.direction[:, :2] ** 2, axis=1) + 0.5 * sky.radius_rad**2)
    light = lens_light(sky, receiver) * glare.scatter_per_sr(shift)
    if hidden is not None:
        light = np.where(hidden, 0.0, light)
    gathered = receiver.pixel_tangent**2 * receiver.transmission
    return np.bincount(sky.body, gathered * light, len(STRAY_BODIES))


def lens_light(sky: Sky, receiver: Receiver) -> np.ndarray:
    """Return the light (element) of the sky on the aperture, behind its baffle [photons/s]."""
    glare = receiver.glare
    cosine = np.maximum(sky.direction[:, 2], 0.0)
    light: np.ndarray = sky.photons_per_s * cosine
    if glare is not None and glare.baffle is not None:
        light = light * glare.baffle.lit_fraction(np.arccos(np.minimum(cosine, 1.0)), receiver.aperture_m)
    return light


@kernel
def sum_scatter(
    sight: np.ndarray,
    toward: np.ndarray,
    strength: np.ndarray,
    blur: np.ndarray,
    peak: float,
    knee: float,
    slope: float,
) -> np.ndarray:
    """Sum the scatter of all elements in some directions: Σ E b₀ (1 + (|β − β₀|² + a²/2) / L²)^(s/2).

    a²/2 is the mean square distance from the middle of an element's disc.

    Parameters
    ----------
    sight : (node, xy) direction cosines β of the directions
    toward : (element, xy) direction cosines β₀ of the elements
    strength : (element) light E on the aperture
    blur : (element) a²/2

    Returns
    -------
    (node) scattered radiant intensity.
    """
    scatter = np.zeros(len(sight))
    per_knee2, half = 1.0 / (knee * knee), 0.5 * slope
    for i in range(len(sight)):
        total = 0.0
        for k in range(len(toward)):
            x, y = sight[i, 0] - toward[k, 0], sight[i, 1] - toward[k, 1]
            total += strength[k] * (1.0 + (x * x + y * y + blur[k]) * per_knee2) ** half
        scatter[i] = peak * total
    return scatter


def _half_field_rad(receiver: Receiver) -> float:
    """Return half the diagonal of the field of view [rad]."""
    return math.atan(math.hypot(*receiver.field_edge))


def _knee_rad(glare: Glare) -> float:
    """Return the angle of the scatter's knee [rad]."""
    return math.asin(glare.knee_sine)


def _image_with_targets(sky: Sky, hits: Hits, laser: Laser, receiver: Receiver) -> np.ndarray:
    """Return the image of the sky (row, col) [photons/s], hidden by targets and behind the point spread function.

    Parameters
    ----------
    sky, hits, laser, receiver : as for `add_stray_light`
    """
    n_pixels = receiver.n_rows * receiver.n_cols
    free = np.clip(1.0 - np.bincount(hits.pixel, hits.weight, n_pixels), 0.0, 1.0)
    image: np.ndarray = sky.image_photons_per_s.ravel() * free
    lit = np.flatnonzero(image)
    if receiver.psf is None or not len(lit):
        return image.reshape(receiver.shape)
    middle = np.full(len(lit), 0.5)  # the kernel of a whole pixel, evenly lit
    return blur_steady_light(lit, image[lit], (middle, middle), 1, receiver, laser.wavelength_m)


def _image_sky(bodies: SkyBodies, wanted: tuple[int, ...], receiver: Receiver) -> np.ndarray:
    """Return what each pixel gathers (row, col) [m²] of the bodies' light, over the irradiance of the Sun.

    Parameters
    ----------
    wanted : numbers of the bodies whose light is included
    """
    image = np.zeros(receiver.n_rows * receiver.n_cols)
    reach = 0.71 * receiver.ifov_rad * (1.0 + math.hypot(*receiver.field_edge))
    for body, place, radius in (
        (body, (bodies.sun, bodies.earth, bodies.moon)[body], radius)
        for body, radius in enumerate((bodies.sun_radius_rad, bodies.earth_radius_rad, bodies.moon_radius_rad))
        if body in wanted
    ):
        if place is None:
            continue
        ahead = place / np.linalg.norm(place)
        if math.acos(min(max(ahead[2], -1.0), 1.0)) > radius + 2.0 * reach + _half_field_rad(receiver):
            continue
        apart = np.arccos(np.clip(receiver.line_of_sight.reshape(-1, 3) @ ahead, -1.0, 1.0))
        pixel = np.flatnonzero(apart <= radius + 2.0 * reach)
        if not len(pixel):
            continue
        per_side = int(np.clip(math.ceil(_PER_RADIUS * receiver.ifov_rad / max(radius, 1e-12)), _FEWEST, _MOST))
        if body == EARTH and per_side == _FEWEST:  # off its limb the radiance hardly changes within a pixel
            is_inside = apart[pixel] < radius - 2.0 * reach
            inner, pixel, per_side = pixel[is_inside], pixel[~is_inside], _EARTH_POINTS
            image[inner] += _gather(bodies, body, inner, 1, receiver)
        image[pixel] += _gather(bodies, body, pixel, per_side, receiver)
    return image.reshape(receiver.shape)


def _gather(bodies: SkyBodies, body: int, pixel: np.ndarray, per_side: int, receiver: Receiver) -> np.ndarray:
    """Return what some pixels (pixel) gather of one body's light over the irradiance of the Sun [m²].

    Parameters
    ----------
    pixel : pixels to compute
    """
    total = np.zeros(len(pixel))
    row, col = pixel // receiver.n_cols, pixel % receiver.n_cols
    for point in range(per_side * per_side):
        down, right = (point // per_side + 0.5) / per_side, (point % per_side + 0.5) / per_side
        x, y = receiver.tangents_at(col + right, row + down)
        cosine = 1.0 / np.sqrt(1.0 + x * x + y * y)
        direction = np.stack([x * cosine, y * cosine, cosine], axis=-1)
        area = 1.0 if receiver.distortion is None else receiver.distortion.area_at_direction(x, y)
        if body == EARTH and per_side == 1:  # nothing is before it
            radiance = bodies.earth_light(direction)
        else:
            radiance = bodies.radiance(direction, (body,), receiver.pixel_tangent / per_side * cosine)
        total += radiance * area * cosine**4
    scale = receiver.pixel_tangent**2 * receiver.aperture_area_m2 * receiver.transmission
    gathered: np.ndarray = total * (scale / per_side**2)
    return gathered


@lru_cache(maxsize=8)
def _nodes(receiver: Receiver) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return rows and columns of the pixels at which the veil is computed, and what pixels gather of a radiance.

    Returns
    -------
    Rows, columns, unit vectors (row, col, xyz) of their lines of sight, and the solid angle times cos θ and transmission
    of all pixels (row, col) [sr].
    """
    assert receiver.glare is not None
    knee = _knee_rad(receiver.glare) / receiver.pixel_tangent
    step = int(np.clip(math.floor(knee / _PER_KNEE), 1, _WIDEST))
    rows, cols = (_node_lines(n, step) for n in receiver.shape)
    if len(rows) < 4 or len(cols) < 4:  # too few for cubic splines
        rows, cols = (np.arange(n) for n in receiver.shape)
    sight = receiver.line_of_sight
    area = np.ones(receiver.shape)
    if receiver.distortion is not None:
        area = receiver.distortion.area_at_direction(sight[..., 0] / sight[..., 2], sight[..., 1] / sight[..., 2])
    scale = receiver.pixel_tangent**2 * receiver.transmission
    return rows, cols, np.ascontiguousarray(sight[np.ix_(rows, cols)]), scale * area * sight[..., 2] ** 4


def _node_lines(n: int, step: int) -> np.ndarray:
    """Return about every `step`th of n rows or columns, evenly, the first and the last included."""
    count = min(n, math.ceil((n - 1) / step) + 1)
    return np.unique(np.rint(np.linspace(0, n - 1, count)).astype(np.int64))
