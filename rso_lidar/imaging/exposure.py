"""An exposure: the light of a scene over the time that each row is exposed, and the image that the sensor makes of it.

Light is computed at several instants of the exposure where the scene moves by more than a quarter of a pixel. Positions and
attitudes are extrapolated from the flash with constant rates. The error is half the relative acceleration times the squared
time: in low orbit at 100 m 0.2 mm after 1 s (3/2 n² r t², by Clohessy and Wiltshire).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from rso_lidar import optics, sampling, scene, units
from rso_lidar.imaging.camera import AutoExposure, Band, Camera, CameraLens
from rso_lidar.imaging.stars import image_stars, spread_stars
from rso_lidar.optics import Laser
from rso_lidar.pose import ROOT, cross, length
from rso_lidar.records import CameraImage, CameraLabels, Hits, Truth
from rso_lidar.scene import Surface

_SMEAR_STEP = 0.25  # pixels that the scene moves from one instant to the next
_MOST_INSTANTS = 31
_SPARSE_SIDE = 3  # of the largest grid of rays that only pixels on edges get; who asks for more wants exact light
_LEAST_RAYS = 1024.0  # over the bounds of a target, for the light of a body that no pixel resolves
_MOST_RAYS = 2.0**18  # over the bounds of all targets, where there would be fewer without that
_ASSUMED_ALBEDO = 0.30  # of the Earth's image where the world gives none: the Bond albedo


@dataclass(frozen=True, eq=False)
class NaturalLight:
    """Light about a camera.

    `earth_albedo` is None where the Earth lights no target. `moon_m` is the position of the Moon (xyz) in root axes [m],
    None without one. `has_earth` tells whether the root is the centre of the Earth.
    """

    earth_albedo: float | None
    moon_m: np.ndarray | None
    has_earth: bool


@dataclass(frozen=True, eq=False)
class Flash:
    """Light of the lidar's pulses: the laser with their mean energy, their number, and the surfaces at its wavelength."""

    laser: Laser
    pulses: int
    surfaces: Sequence[Surface]


class _SceneLight(NamedTuple):
    """Light on the pixels at one instant, over the Sun's irradiance (row, col, band) [m²], and the hits of the rays."""

    image_m2: np.ndarray
    hits: Hits


def take_image(
    camera: Camera,
    truth: Truth,
    surfaces: Sequence[Sequence[Surface]],
    natural: NaturalLight,
    flash: Flash | None,
    rng: np.random.Generator,
    threads: int | None = None,
) -> tuple[CameraImage, CameraLabels]:
    """Take the image of one camera about a laser flash.

    Parameters
    ----------
    camera : the camera, whose axes are in the truth under its name
    truth : poses of all bodies at the flash
    surfaces : for each band, the surfaces of all targets at its wavelength
    natural : Earth and Moon
    flash : the lidar's light; None for none
    rng : source of the noise of this image
    threads : number of threads (None: one per core). The result is the same to the bit

    Returns
    -------
    The image, and what was there at the middle of the exposure.
    """
    view = truth.view_from(camera.name)
    start_s, exposure_s = camera.start_ms * units.MS, camera.exposure_ms * units.MS
    per_m2_s = np.array([_sun_electrons_per_m2_s(band) for band in camera.bands])
    light: _SceneLight | None = None
    if camera.auto_exposure is not None:
        light = _gather_light(camera, view.extrapolate(start_s), surfaces, natural, threads)
        exposure_s = _choose_exposure_s(camera, camera.auto_exposure, light.image_m2 * per_m2_s)
    window_s = exposure_s + camera.rows_s
    instants = _count_instants(camera, view, surfaces[0], window_s)
    if instants > 1 or light is None:
        light, image_m2 = _expose(camera, view, surfaces, natural, threads, start_s, window_s, exposure_s, instants)
    else:
        image_m2 = light.image_m2
    electrons = image_m2 * (per_m2_s * exposure_s)
    if flash is not None:
        electrons = electrons + _gather_flash(camera, truth, view, flash, light.hits, start_s, exposure_s, threads)
    labels = _label(light.hits, electrons)
    return read_image(camera, labels.electrons, exposure_s, rng), labels


def read_image(camera: Camera, electrons: np.ndarray, exposure_s: float, rng: np.random.Generator) -> CameraImage:
    """Draw the image that the sensor of a camera makes of the light in its pixels.

    Parameters
    ----------
    camera : the camera
    electrons : (row, col, band), expected electrons of each pixel, as labels hold them
    exposure_s : time for which each row was exposed [s]
    rng : source of the noise of this image

    Returns
    -------
    CameraImage
    """
    counts = camera.sensor.expose(electrons, exposure_s, (camera.pattern_seed, *camera.name.encode()), rng)
    return CameraImage(intensity_counts=counts, exposure_s=np.asarray(exposure_s))


def _expose(
    camera: Camera,
    view: Truth,
    surfaces: Sequence[Sequence[Surface]],
    natural: NaturalLight,
    threads: int | None,
    start_s: float,
    window_s: float,
    exposure_s: float,
    instants: int,
) -> tuple[_SceneLight, np.ndarray]:
    """Average the light over the exposure of each row.

    Parameters
    ----------
    start_s, window_s : start of the first row's exposure after the flash, and time from there to the last row's end [s]
    exposure_s : of each row [s]

    Returns
    -------
    The light at the middle of the exposure, and its mean over each row's exposure (row, col, band) [m²].
    """
    share = _share_instants(camera, window_s, exposure_s, instants)
    total = np.zeros(camera.shape)
    middle: _SceneLight | None = None
    for k in range(instants):
        at_s = start_s + (k + 0.5) * window_s / instants
        light = _gather_light(camera, view.extrapolate(at_s), surfaces, natural, threads)
        total += share[:, k, None, None] * light.image_m2
        if k == instants // 2:
            middle = light
    assert middle is not None
    return middle, total


def _share_instants(camera: Camera, window_s: float, exposure_s: float, instants: int) -> np.ndarray:
    """Return the share of each row's exposure for which each instant stands (row, instant)."""
    begin = np.arange(camera.lens.n_rows)[:, None] * (camera.row_delay_us * units.US)
    edge = np.linspace(0.0, window_s, instants + 1)
    overlap = np.minimum(begin + exposure_s, edge[1:]) - np.maximum(begin, edge[:-1])
    overlap = np.maximum(overlap, 0.0)
    share: np.ndarray = overlap / overlap.sum(axis=1, keepdims=True)
    return share


def _count_instants(camera: Camera, view: Truth, surfaces: Sequence[Surface], window_s: float) -> int:
    """Return at how many instants of the exposure the scene is to be cast: at every quarter of a pixel that it moves.

    The number is odd, so that one instant is the middle, of which the labels are.
    """
    rates = [float(length(view.poses.link(ROOT, "lidar").angular_velocity_rad_s))] if camera.sky else []
    for surface in surfaces:
        link = view.poses.link("lidar", surface.name)
        range_m = float(length(link.translation_m))
        across = float(length(cross(link.translation_m, link.velocity_m_s))) / max(range_m, 1e-9)
        turn = float(length(link.angular_velocity_rad_s)) * surface.radius_m
        rates.append((across + turn) / max(range_m - surface.radius_m, surface.radius_m))
    smear = max(rates, default=0.0) * window_s / camera.lens.pixel_tangent
    return int(np.clip(math.ceil(smear / _SMEAR_STEP), 1, _MOST_INSTANTS)) | 1


def _gather_light(
    camera: Camera,
    view: Truth,
    surfaces: Sequence[Sequence[Surface]],
    natural: NaturalLight,
    threads: int | None,
) -> _SceneLight:
    """Gather the light of targets and sky at one instant."""
    lens, image = camera.lens, np.empty(camera.shape)
    first = _cast(lens, surfaces[0], view, threads)
    sky = _image_bodies(camera, view, natural)
    stars = _find_stars(camera, view, surfaces[0], natural)
    free = np.clip(1.0 - _sum_pixels(first, first.weight), 0.0, 1.0)
    behind = np.flatnonzero(sky * free)
    if camera.has_penumbra:
        first = scene.soften_shadows(first, surfaces[0], view, lens.pixel_tangent, threads)
    colored = scene.recolor_sunlight(first, surfaces, view, threads)
    for number, (band, of_band, hits) in enumerate(zip(camera.bands, surfaces, colored, strict=True)):
        if natural.earth_albedo is not None and natural.has_earth:
            hits = scene.add_earthshine(hits, of_band, view, natural.earth_albedo, threads)
        plane = optics.image_sunlight(hits, lens, band.wavelength_m)
        if len(behind):
            seen = (sky * free).ravel()[behind]
            if lens.psf is None:
                plane.ravel()[behind] += seen
            else:
                half = np.full(len(behind), 0.5)
                plane = plane + optics.blur_steady_light(behind, seen, (half, half), 1, lens, band.wavelength_m)
        if stars is not None:
            plane = plane + spread_stars(stars, lens, band.wavelength_m)
        if lens.glare is not None:
            plane = plane + _image_veil(camera, view, of_band, natural)
        image[..., number] = plane
    return _SceneLight(image, first)


def _cast(lens: CameraLens, surfaces: Sequence[Surface], view: Truth, threads: int | None) -> Hits:
    """Cast the rays of an image, with as many per pixel as the smallest target in it needs.

    A target smaller than a few pixels would get a ray or two, and the light of those places would stand for all of it.
    """
    extent, edge = scene.extent(surfaces, view), lens.field_edge
    size = extent.high - extent.low
    is_inside = np.all((extent.high > -edge) & (extent.low < edge) & (size > 0.0) & np.isfinite(size), axis=1)
    sides = size[is_inside] / lens.pixel_tangent
    per_pixel = 0.0
    if len(sides):
        wanted = _LEAST_RAYS / max(float(sides.prod(axis=1).min()), 1e-12)
        per_pixel = min(wanted, _MOST_RAYS / float(np.sum(np.prod(sides + 1.0, axis=1))))
    if per_pixel <= lens.rays_per_side**2:
        cast = sampling.cast_image if lens.rays_per_side <= _SPARSE_SIDE else sampling.cast_pixels
        return cast(lens, lens.even_light, surfaces, view, threads)
    # Not `replace`, which refuses grids that would be too many rays in all pixels.
    fine = lens.model_copy(update={"rays_per_pixel": math.ceil(math.sqrt(per_pixel)) ** 2})
    return sampling.cast_pixels(fine, lens.even_light, surfaces, view, threads)


def _image_bodies(camera: Camera, view: Truth, natural: NaturalLight) -> np.ndarray:
    """Return the image of Sun, Earth and Moon (row, col) [m²], before the lens spreads it and without targets."""
    sources = tuple(name for name in optics.STRAY_BODIES if name in camera.sky)
    albedo = _ASSUMED_ALBEDO if natural.earth_albedo is None else natural.earth_albedo
    has_earth = natural.has_earth
    return optics.image_sky(camera.lens, view, natural.moon_m, albedo, sources=sources, has_earth=has_earth)


def _image_veil(camera: Camera, view: Truth, surfaces: Sequence[Surface], natural: NaturalLight) -> np.ndarray:
    """Return the light of Sun, Earth and Moon that the lens scatters over the image (row, col) [m²]."""
    lens = camera.lens
    sky = optics.see_sky(lens.even_light, lens, view, natural.moon_m, has_earth=natural.has_earth)
    assert sky is not None
    hidden = scene.find_hidden(sky.direction, surfaces, view)
    per_m2 = optics.sun_photons_per_s_m2(lens.even_light.wavelength_m, lens.filter_width_nm * units.NM)
    return optics.veil(sky, lens, hidden) / per_m2


def _find_stars(
    camera: Camera, view: Truth, surfaces: Sequence[Surface], natural: NaturalLight
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None:
    """Find the stars that the camera sees; None without stars."""
    if "stars" not in camera.sky or not natural.has_earth:
        return None
    to_root, turn = view.poses.place("lidar", ROOT)
    bodies = [(np.asarray(to_root), units.EARTH_RADIUS_M)]
    if natural.moon_m is not None:
        bodies.append((to_root + turn @ natural.moon_m, units.MOON_RADIUS_M))
    return image_stars(camera.lens, view, surfaces, bodies)


def _gather_flash(
    camera: Camera,
    truth: Truth,
    view: Truth,
    flash: Flash,
    hits: Hits,
    start_s: float,
    exposure_s: float,
    threads: int | None,
) -> np.ndarray:
    """Gather the electrons of the laser's light (row, col, band), in rows that are exposed when it returns."""
    electrons = np.zeros(camera.shape)
    bands = [number for number, band in enumerate(camera.bands) if band.contains(flash.laser.wavelength_nm)]
    if not bands or not len(hits.ray):
        return electrons
    lidar_from_camera = truth.poses.place("lidar", camera.name)
    origin, turn = truth.poses.place(camera.name, "lidar")
    laser_from_m = origin + turn @ np.array(flash.laser.offset_m)
    lit = scene.cast(
        hits.rays, flash.surfaces, view, threads, laser_from_m=laser_from_m, aperture_m=camera.lens.aperture_m
    )
    delay_s = 2.0 * lit.range_m / units.SPEED_OF_LIGHT_M_S
    begin_s = start_s + (lit.pixel // camera.lens.n_cols) * (camera.row_delay_us * units.US)
    is_exposed = (begin_s <= delay_s) & (delay_s < begin_s + exposure_s)
    seen = replace(lit, brdf_per_sr=np.where(is_exposed, lit.brdf_per_sr, 0.0))
    photons = optics.image_flash(seen, flash.laser, lidar_from_camera, camera.lens) * flash.pulses
    for number in bands:
        electrons[..., number] = photons * camera.bands[number].quantum_efficiency
    return electrons


def _sun_electrons_per_m2_s(band: Band) -> float:
    """Return the electrons per second that sunlight on a square metre of the aperture makes in a band [1/(s m²)]."""
    width_m = band.width_nm * units.NM
    return band.quantum_efficiency * optics.sun_photons_per_s_m2(band.wavelength_m, width_m)


def _choose_exposure_s(camera: Camera, auto: AutoExposure, electrons_per_s: np.ndarray) -> float:
    """Choose the exposure [s] with which the brightest pixels fill their wells as far as wanted."""
    rates = np.sort(electrons_per_s.max(axis=-1).ravel())
    bright = float(rates[max(len(rates) - 1 - auto.brighter_pixels, 0)])
    wanted_s = auto.fill_fraction * camera.sensor.full_well_electrons / bright if bright > 0.0 else math.inf
    return min(max(wanted_s, auto.min_ms * units.MS), auto.max_ms * units.MS)


def _sum_pixels(hits: Hits, values: np.ndarray) -> np.ndarray:
    """Sum values of hits (hit) over pixels (row, col)."""
    rows, cols = hits.rays.shape
    return np.bincount(hits.pixel, values, rows * cols).reshape(rows, cols)


def _label(hits: Hits, electrons: np.ndarray) -> CameraLabels:
    """Label pixels by the part that covers most of each."""
    shape = hits.rays.shape
    target, part = np.full(shape, -1, np.int16), np.full(shape, -1, np.int16)
    range_m, facet = np.full(shape, np.nan), np.full(shape, -1, np.int32)
    if len(hits.ray):
        most_parts = int(hits.part.max()) + 1
        piece = hits.target.astype(np.int64) * most_parts + hits.part
        first = np.flatnonzero(np.diff(hits.pixel, prepend=-1))  # hit of each pixel
        pixel, of = hits.pixel[first], np.maximum.reduceat(piece, first)
        area, moment_m = np.add.reduceat(hits.weight, first), np.add.reduceat(hits.weight * hits.range_m, first)
        of_facet = np.maximum.reduceat(hits.facet, first)
        is_mixed = (np.minimum.reduceat(piece, first) < of) | (np.minimum.reduceat(hits.facet, first) < of_facet)
        if is_mixed.any():
            mixed = np.repeat(is_mixed, np.diff(first, append=len(piece)))
            of[is_mixed], area[is_mixed], moment_m[is_mixed], of_facet[is_mixed] = _choose_pieces(
                hits.pixel[mixed], piece[mixed], hits.weight[mixed], hits.range_m[mixed], hits.facet[mixed]
            )
        target.ravel()[pixel], part.ravel()[pixel] = of // most_parts, of % most_parts
        range_m.ravel()[pixel], facet.ravel()[pixel] = moment_m / area, of_facet
    filled = np.minimum(_sum_pixels(hits, hits.weight), 1.0)
    return CameraLabels(
        electrons=electrons.astype(np.float32),
        target=target,
        part=part,
        range_m=range_m,
        filled_fraction=filled.astype(np.float32),
        facet=facet,
    )


def _choose_pieces(
    pixel: np.ndarray, piece: np.ndarray, weight: np.ndarray, range_m: np.ndarray, facet: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Choose the piece that covers most of each pixel; of equal ones, the first.

    Parameters
    ----------
    pixel : (hit), never falling
    piece : (hit) number of the target's part
    weight : (hit) share of the pixel's area
    range_m : (hit) [m]
    facet : (hit) index of the facet

    Returns
    -------
    The piece (pixel), its share of the pixel, its mean range times that share [m], and its facet with the largest area.
    """
    pieces = int(piece.max()) + 1
    keys, inverse = np.unique(pixel.astype(np.int64) * pieces + piece, return_inverse=True)
    area, moment_m = np.bincount(inverse, weight), np.bincount(inverse, weight * range_m)
    order = np.lexsort((-area, keys // pieces))
    most = order[np.unique(keys[order] // pieces, return_index=True)[1]]
    largest = _find_largest_facets(inverse, weight, facet)
    return keys[most] % pieces, area[most], moment_m[most], largest[most]


def _find_largest_facets(group: np.ndarray, weight: np.ndarray, facet: np.ndarray) -> np.ndarray:
    """Return for each group of hits (group) its facet with the largest area; of equal ones the first in the file.

    Parameters
    ----------
    group : (hit), number of the group
    weight : (hit) share of the pixel's area
    facet : (hit) index of the facet
    """
    most_facets = int(facet.max()) + 1
    keys, inverse = np.unique(group * np.int64(most_facets) + facet, return_inverse=True)
    area = np.round(np.bincount(inverse, weight), 9)
    order = np.lexsort((-area, keys // most_facets))
    largest: np.ndarray = keys[order[np.unique(keys[order] // most_facets, return_index=True)[1]]] % most_facets
    return largest
