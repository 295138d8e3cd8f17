"""Ghost images at work: copies of the light on the focal plane, turned or shifted, out of focus, and late.

The copy is made of light behind the lens, so what the point spread function spreads is spread in the ghost too. All light of
a copy lands on the focal plane or beside it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.kernels import packed
from rso_lidar.optics.lens.internal_reflections import Ghost
from rso_lidar.optics.receiver import Receiver
from rso_lidar.optics.returns.blur import SLAB_FWHM, Light
from rso_lidar.optics.returns.clusters import find_clusters
from rso_lidar.records import Photons

LEAST_PHOTONS = 0.01  # in all pulses of a frame; a fainter return of a ghost is left out
_POINTS_PER_PIXEL = 8  # along each side: how finely the disc of a ghost out of focus is sampled
_MOST_POINTS = 1024  # across the disc


def add_ghosts(photons: Photons, receiver: Receiver, pulses: int = 1) -> Photons:
    """Add the ghosts of all laser light on the focal plane as further returns.

    Light of one pixel that arrives within a quarter of the pulse's width is copied as one return. Returns of less than 0.01
    photons in all pulses of the frame are left out.

    Returns
    -------
    The light with its ghosts, ordered by pixel and delay. The hit of a ghost's return is the hit that it is a copy of, or
    the brightest of the copied light where the ghost is out of focus.
    """
    if not receiver.ghosts or not len(photons.pixel):
        return photons
    light = Light(*(getattr(photons, name) for name in Light.__dataclass_fields__))
    sources, slab = _merge_by_slab(light, SLAB_FWHM * photons.pulse_fwhm_s, receiver.n_rows * receiver.n_cols)
    copies = [
        copy
        for ghost in receiver.ghosts
        for copy in _copy_light(sources, slab, ghost, receiver, LEAST_PHOTONS / pulses)
    ]
    if not copies:
        return photons
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(light, name), *(getattr(copy, name) for copy in copies)]).astype(
            getattr(light, name).dtype
        )
        for name in Light.__dataclass_fields__
    }
    order = np.lexsort((columns["delay_s"], columns["pixel"]))
    columns = {name: values[order] for name, values in columns.items()}
    cluster, cluster_pixel = find_clusters(
        packed(columns["pixel"]), packed(columns["delay_s"]), packed(columns["depth_spread_s"]), photons.pulse_fwhm_s
    )
    return replace(photons, **columns, cluster=cluster, cluster_pixel=cluster_pixel)


def copy_image(image: np.ndarray, ghost: Ghost, receiver: Receiver) -> np.ndarray:
    """Return the ghost (row, col) of an image (row, col) of steady light, in the unit of the image."""
    kernel, shift = _kernel(ghost, receiver)
    return ghost.fraction * _displace(image[::-1, ::-1] if ghost.is_turned else image, kernel, shift)


def _merge_by_slab(light: Light, slab_s: float, n_pixels: int) -> tuple[Light, np.ndarray]:
    """Merge the light of each pixel that arrives in one slab of delay; also return the slab of each.

    Parameters
    ----------
    slab_s : width of a slab of delay [s]
    n_pixels : number of pixels
    """
    slab = ((light.delay_s - light.delay_s.min()) / slab_s).astype(np.int64)
    key = slab * n_pixels + light.pixel
    order = np.lexsort((-light.photons, key))  # the brightest of each group first
    starts = np.flatnonzero(np.diff(key[order], prepend=-1))
    first = order[starts]
    weight = np.maximum(light.photons, 1e-300)[order]

    def mean(values: np.ndarray) -> np.ndarray:
        total: np.ndarray = np.add.reduceat(weight * values, starts) / np.add.reduceat(weight, starts)
        return total

    apart_s = light.delay_s[order] - np.repeat(light.delay_s[first], np.diff(starts, append=len(order)))
    middle_s = mean(apart_s)
    variance = np.maximum(mean(apart_s**2 + light.depth_spread_s[order] ** 2 / 12.0) - middle_s**2, 0.0)
    merged = Light(
        light.pixel[first],
        light.delay_s[first] + middle_s,
        np.add.reduceat(light.photons[order], starts),
        np.sqrt(12.0 * variance),
        np.add.reduceat(light.coherence_cells[order], starts),
        light.hit[first],
    )
    return merged, slab[first]


def _copy_light(sources: Light, slab: np.ndarray, ghost: Ghost, receiver: Receiver, least: float) -> list[Light]:
    """Return the returns of one ghost, slab by slab.

    Parameters
    ----------
    slab : (return) slab of delay of each
    least : photons of the faintest return that is made
    """
    kernel, shift = _kernel(ghost, receiver)
    late_s = ghost.extra_path_m / units.SPEED_OF_LIGHT_M_S
    shape, copies = receiver.shape, []
    most = np.zeros(int(slab.max()) + 1)
    np.add.at(most, slab, sources.photons)
    for number in np.flatnonzero(most * (ghost.fraction * float(kernel.max())) >= least):
        of = np.flatnonzero(slab == number)
        start_s = float(sources.delay_s[of].min())

        def lay(values: np.ndarray, of: np.ndarray = of) -> np.ndarray:
            image = np.bincount(sources.pixel[of], values, shape[0] * shape[1]).reshape(shape)
            return ghost.fraction * _displace(image[::-1, ::-1] if ghost.is_turned else image, kernel, shift).ravel()

        light = sources.photons[of]
        landed = lay(light)
        pixel = np.flatnonzero(landed >= least)
        if not len(pixel):
            continue
        photons = landed[pixel]
        mean_s = lay(light * (sources.delay_s[of] - start_s))[pixel] / photons
        spread_s = lay(light * sources.depth_spread_s[of])[pixel] / photons
        cells = lay(sources.coherence_cells[of])[pixel] / ghost.fraction
        hit = _find_sources(sources.only(of), pixel, ghost.is_turned, shift, shape)
        copies.append(Light(pixel, start_s + mean_s + late_s, photons, spread_s, cells, hit))
    return copies


def _find_sources(
    sources: Light, pixel: np.ndarray, is_turned: bool, shift: tuple[float, float], shape: tuple[int, int]
) -> np.ndarray:
    """Return the hit (pixel) whose copy each pixel is: that of the pixel it comes from, or the brightest one.

    Parameters
    ----------
    pixel : pixels on which the copy lands
    is_turned : whether the copy is turned by 180 degrees
    shift : of the copy, down and right [pixels]
    """
    hit = np.full(shape[0] * shape[1] + 1, -1, np.int64)
    hit[sources.pixel] = sources.hit
    row = pixel // shape[1] - int(np.rint(shift[0]))
    col = pixel % shape[1] - int(np.rint(shift[1]))
    if is_turned:
        row, col = shape[0] - 1 - row, shape[1] - 1 - col
    inside = (row >= 0) & (row < shape[0]) & (col >= 0) & (col < shape[1])
    source_hit = hit[np.where(inside, row * shape[1] + col, -1)]
    return np.where(source_hit >= 0, source_hit, sources.hit[int(np.argmax(sources.photons))])


def _kernel(ghost: Ghost, receiver: Receiver) -> tuple[np.ndarray, tuple[float, float]]:
    """Return the kernel of a ghost, and its shift down and right [pixels], of which it contains the part below a pixel."""
    shift = ghost.shift_pixels(receiver.shape)
    part = shift[0] - math.floor(shift[0]), shift[1] - math.floor(shift[1])
    return _disc_kernel(ghost.defocus_um / receiver.pixel_pitch_um, *part), shift


@lru_cache(maxsize=64)
def _disc_kernel(radius: float, down: float, right: float) -> np.ndarray:
    """Return the shares (row, col) of a pixel's light on a disc: a pixel's square moved to each point of the disc.

    Parameters
    ----------
    radius : of the disc [pixels]
    down, right : shift of the disc's centre from that of the pixel in the middle, from 0 to below 1 [pixels]
    """
    reach = math.ceil(radius) + 1
    n = min(max(math.ceil(2.0 * radius * _POINTS_PER_PIXEL), 1), _MOST_POINTS)
    line = ((np.arange(n) + 0.5) / n - 0.5) * 2.0 * radius
    y, x = (values.ravel() for values in np.meshgrid(line, line, indexing="ij"))
    inside = x * x + y * y <= radius * radius
    at_row, at_col = y[inside] + down + reach, x[inside] + right + reach
    row, col = np.floor(at_row).astype(np.int64), np.floor(at_col).astype(np.int64)
    v, u = at_row - row, at_col - col
    size = 2 * reach + 2
    kernel = np.zeros(size * size)
    for step_down, step_right, share in (
        (0, 0, (1 - v) * (1 - u)),
        (0, 1, (1 - v) * u),
        (1, 0, v * (1 - u)),
        (1, 1, v * u),
    ):
        kernel += np.bincount((row + step_down) * size + col + step_right, share, size * size)
    kernel /= kernel.sum()
    kernel.flags.writeable = False
    return kernel.reshape(size, size)


def _displace(image: np.ndarray, kernel: np.ndarray, shift: tuple[float, float]) -> np.ndarray:
    """Return an image spread by a kernel and shifted by whole pixels; what lands beside the focal plane is lost.

    Parameters
    ----------
    image : (row, col) light
    kernel : as `_disc_kernel` returns it, the part of the shift below a pixel included
    shift : down and right [pixels]
    """
    from scipy.signal import fftconvolve

    rows, cols = image.shape
    reach = kernel.shape[0] // 2 - 1
    spread = np.zeros((rows + kernel.shape[0] - 1, cols + kernel.shape[1] - 1))
    if reach <= 1:  # a few shares: exact, without the rounding of a transform
        for i, j in np.argwhere(kernel > 0.0):
            spread[i : i + rows, j : j + cols] += kernel[i, j] * image
    else:
        spread = np.maximum(fftconvolve(image, kernel, mode="full"), 0.0)
    first_row, first_col = reach - math.floor(shift[0]), reach - math.floor(shift[1])
    landed = np.zeros_like(image)
    row_low, row_high = max(0, -first_row), min(rows, spread.shape[0] - first_row)
    col_low, col_high = max(0, -first_col), min(cols, spread.shape[1] - first_col)
    if row_low < row_high and col_low < col_high:
        landed[row_low:row_high, col_low:col_high] = spread[
            row_low + first_row : row_high + first_row, col_low + first_col : col_high + first_col
        ]
    return landed
