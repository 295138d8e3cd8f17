"""The point spread function at work: light of one direction spread over pixels.

It acts on the light of single rays, before that is summed to pixels. It acts in narrow bins of delay, so that two
depths that meet in a pixel stay two returns. No light is lost but what falls beside the focal plane. Twice the light in is
twice the light out, however faint.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rso_lidar.kernels import packed
from rso_lidar.optics.laser import Laser
from rso_lidar.optics.lens.psf import FieldDependentPsf, find_reach, pixel_shares
from rso_lidar.optics.receiver import Receiver
from rso_lidar.optics.returns.spread import (
    gather_returns,
    group_by_delay,
    locate_rays,
    place_light,
    spread_groups,
    spread_steady_light,
)
from rso_lidar.records import Hits
from rso_lidar.ties import find_first_greatest

BIN_FWHM = 0.1  # of the pulse: light of one pixel within so short a delay is spread as one group
SLAB_FWHM = 0.25  # of the pulse: resolution in delay of light that lands far from its pixel
ZONES = 8  # along each side of the focal plane; a PSF that changes over the field is constant within one
_MISSED = 1e-3  # share of the light beyond the reach of a kernel; it is shared among the pixels within
_MISSED_OF_HALO = 1e-6  # a halo is faint and wide, and it matters beside a bright glint
_MOST_SUBCELLS = 8  # along each side of a pixel; between their middles the kernel is interpolated
_CORE, _MOST_CORE = 2, 6  # pixels to each side that get each ray's own kernel; others share one kernel by a transform
_MOST_MISPLACED = 0.01  # share of a ray's light for which the one kernel may differ from the ray's own
_ROUNDING = 1e-12  # of all light in a slab: a transform rounds to 1e-16, and less is no light


@dataclass(frozen=True, eq=False)
class Light:
    """Light on the focal plane, ordered by pixel (return): the fields that `Photons` takes over."""

    pixel: np.ndarray
    delay_s: np.ndarray
    photons: np.ndarray
    depth_spread_s: np.ndarray
    coherence_cells: np.ndarray
    hit: np.ndarray

    def only(self, some: np.ndarray) -> "Light":
        """Return a selection of the returns."""
        return Light(*(getattr(self, name)[some] for name in Light.__dataclass_fields__))


def blur_light(hits: Hits, light: Light, receiver: Receiver, wavelength_m: float, pulse_fwhm_s: float) -> Light:
    """Spread light over pixels by the receiver's point spread function.

    Parameters
    ----------
    hits : the hits that send the light

    Returns
    -------
    Light behind the lens, ordered by pixel and delay.
    """
    if not len(light.pixel):
        return light
    side, shape = count_subcells(hits), receiver.shape
    order, starts = group_by_delay(packed(light.pixel), packed(light.delay_s), BIN_FWHM * pulse_fwhm_s)
    zones, zone_of_pixel = _zones(receiver)
    used = np.unique(zone_of_pixel[light.pixel]) if zones > 1 else np.zeros(1, np.int64)
    cores, beyond, fars = _build_kernels(receiver, wavelength_m, side, tuple(used.tolist()))
    zone = np.zeros(zones * zones, np.int64)  # index of each zone among those used
    zone[used] = np.arange(len(used))
    at, brightest, width_s, (away, down, across), near = spread_groups(
        packed(light.pixel),
        packed(light.delay_s),
        packed(light.photons),
        packed(light.depth_spread_s),
        packed(light.coherence_cells),
        packed(light.hit),
        order,
        starts,
        _place_in_pixel(hits, receiver),
        zone,
        zones,
        cores,
        beyond,
        *shape,
    )
    mean_s = near[1][:, near[1].shape[1] // 2]
    far_light = [Light(*(np.zeros(0, values.dtype) for values in (at, mean_s, away, width_s, away, brightest)))]
    for number, far in zip(used, fars, strict=True):
        if far is not None:
            of = np.flatnonzero((zone_of_pixel[at] == number) & (away > 0.0))
            sources = Light(at[of], mean_s[of], away[of], width_s[of], np.zeros(len(of)), brightest[of])
            far_light += spread_far_light(sources, (down[of], across[of]), far, receiver, SLAB_FWHM * pulse_fwhm_s)
    from_far = tuple(
        np.concatenate([getattr(part, name) for part in far_light]).astype(getattr(far_light[0], name).dtype)
        for name in Light.__dataclass_fields__
    )
    return Light(*gather_returns(at, brightest, width_s, near, from_far, *shape))  # type: ignore[arg-type]


def blur_sunlight(hits: Hits, rate_per_s: np.ndarray, receiver: Receiver, wavelength_m: float) -> np.ndarray:
    """Spread the sunlight of hits over pixels by the receiver's point spread function, as `blur_light` spreads a pulse.

    Parameters
    ----------
    rate_per_s : (hit) photons per second of each

    Returns
    -------
    (row, col) photons per second on each pixel.
    """
    if not len(rate_per_s):
        return np.zeros(receiver.shape)
    place = _place_in_pixel(hits, receiver)
    return blur_steady_light(hits.pixel, rate_per_s, place, count_subcells(hits), receiver, wavelength_m)


def blur_steady_light(
    pixel: np.ndarray,
    rate_per_s: np.ndarray,
    place: tuple[np.ndarray, np.ndarray],
    side: int,
    receiver: Receiver,
    wavelength_m: float,
) -> np.ndarray:
    """Spread light without a delay over pixels by the receiver's point spread function.

    Parameters
    ----------
    pixel, rate_per_s : (source) pixel, and photons per second
    place : (source) where in its pixel each source is, from the upper edge and from the left one [pixels]
    side : sub-cells along each side of a pixel
    receiver : the lens with its point spread function, and the focal plane
    wavelength_m : of the light [m]

    Returns
    -------
    (row, col) photons per second on each pixel. Only light that falls beside the focal plane is lost.
    """
    from scipy.signal import fftconvolve

    zones, zone_of_pixel = _zones(receiver)
    used = np.unique(zone_of_pixel[pixel]) if zones > 1 else np.zeros(1, np.int64)
    cores, beyond, fars = _build_kernels(receiver, wavelength_m, side, tuple(used.tolist()))
    zone = np.zeros(zones * zones, np.int64)  # index of each zone among those used
    zone[used] = np.arange(len(used))
    given = packed(pixel.astype(np.int32)), packed(rate_per_s.astype(float)), (packed(place[0]), packed(place[1]))
    spread, away = spread_steady_light(*given, zone, zones, cores, beyond, *receiver.shape)
    for leaving, far in zip(away, fars, strict=True):
        if far is not None:
            spread = spread + np.maximum(fftconvolve(leaving, far, mode="same"), 0.0)
    return spread


def blur_variance(variance: np.ndarray | None, receiver: Receiver, wavelength_m: float) -> np.ndarray | None:
    """Return the variance of pixels' photons behind the lens, whose errors are independent before it.

    Parameters
    ----------
    variance : (row, col) before the lens; None if unknown
    """
    if variance is None or receiver.psf is None:
        return variance
    from scipy.signal import fftconvolve

    # The middle of the field stands for all of it.
    zone = ZONES // 2 * (ZONES + 1) if isinstance(receiver.psf, FieldDependentPsf) else 0
    share = zone_shares(receiver, wavelength_m, 1, zone)[1, 1]
    spread: np.ndarray = np.maximum(fftconvolve(variance, share**2, mode="same"), 0.0)
    return spread


def count_subcells(hits: Hits) -> int:
    """Return into how many sub-cells a pixel's side is cut: as finely as its finest ray, up to a limit."""
    return int(np.clip(np.rint(hits.weight.min() ** -0.5), 1, _MOST_SUBCELLS))


def _place_in_pixel(hits: Hits, receiver: Receiver) -> tuple[np.ndarray, np.ndarray]:
    """Locate where in its pixel each ray goes through (hit), from the upper edge and from the left one [pixels]."""
    if receiver.distortion is None:
        direction = packed(hits.rays.direction.T)
        down, across = locate_rays(packed(hits.ray), direction, receiver.pixel_tangent, *receiver.shape)
        return packed(down), packed(across)
    toward = hits.rays.direction[hits.ray]
    col, row = receiver.image_of(toward[:, 0] / toward[:, 2], toward[:, 1] / toward[:, 2])
    return packed(row - np.floor(row)), packed(col - np.floor(col))


def _zones(receiver: Receiver) -> tuple[int, np.ndarray]:
    """Return the zones along each side of the focal plane, and the zone of each pixel (pixel)."""
    n_rows, n_cols = receiver.shape
    zones = ZONES if isinstance(receiver.psf, FieldDependentPsf) else 1
    return zones, (np.arange(n_rows)[:, None] * zones // n_rows * zones + np.arange(n_cols) * zones // n_cols).ravel()


@lru_cache(maxsize=64)
def _build_kernels(
    receiver: Receiver, wavelength_m: float, side: int, zones: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray | None, ...]]:
    """Build the kernels of light near its pixel and far from it, for some zones of the field.

    Cores that reach differently far become equally wide: what one does not reach gets nothing.

    Parameters
    ----------
    receiver : one with a `psf`
    wavelength_m : of the laser [m]
    side : number n of the n x n sub-cells of a pixel, 1 or more
    zones : indices of the zones to compute, from 0

    Returns
    -------
    Shares near a ray's pixel (zone, sub-cell, offset), `beyond` of `split_core_and_far` (zone, sub-cell, 3), and the far
    kernel (row, col) of each zone, None for none.
    """
    parts = [split_core_and_far(zone_shares(receiver, wavelength_m, side, zone)) for zone in zones]
    widest, cells = max(core.shape[-1] for core, _, _ in parts), (side + 2) ** 2
    cores = np.zeros((len(parts), cells, widest, widest))
    for zone, (core, _, _) in enumerate(parts):
        edge = (widest - core.shape[-1]) // 2
        cores[zone, :, edge : widest - edge, edge : widest - edge] = core.reshape(cells, *core.shape[2:])
    beyond = np.stack([beyond.reshape(cells, 3) for _, beyond, _ in parts])
    return packed(cores.reshape(len(parts), cells, -1)), packed(beyond), tuple(far for _, _, far in parts)


def split_core_and_far(shares: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Split the shares of sub-cells into those near the pixel and one kernel for all that lands farther.

    Parameters
    ----------
    shares : (sub row, sub col, row offset, col offset)

    Returns
    -------
    The shares near the pixel. What lands farther (sub row, sub col, 3): its share, and that share times the place, down and
    across from the pixel's middle [pixels], where the far kernel puts its centroid right. The far kernel (row, col) of sum
    1; None if nothing lands farther.
    """
    reach, mean = shares.shape[-1] // 2, shares.mean(axis=(0, 1))
    offset = np.arange(-reach, reach + 1)
    ring = np.maximum(np.abs(offset)[:, None], np.abs(offset))
    misplaced = np.abs(shares - mean)
    core = _CORE
    while core < min(reach, _MOST_CORE) and misplaced[:, :, ring > core].sum(axis=2).max() > _MOST_MISPLACED:
        core += 1
    if reach <= core:
        return shares, np.zeros((*shares.shape[:2], 3)), None
    far, middle = np.where(ring > core, mean, 0.0), slice(reach - core, reach + core + 1)
    far /= far.sum()
    outside = np.where(ring > core, shares, 0.0)
    share = outside.sum(axis=(2, 3))
    down = np.einsum("ijkl,k->ij", outside, offset) - share * (far.sum(axis=1) @ offset)
    across = np.einsum("ijkl,l->ij", outside, offset) - share * (far.sum(axis=0) @ offset)
    return shares[:, :, middle, middle], np.stack([share, down, across], axis=-1), far


def spread_far_light(
    sources: Light, place: tuple[np.ndarray, np.ndarray], far: np.ndarray, receiver: Receiver, slab_s: float
) -> list[Light]:
    """Spread light that lands far from its pixel, one slab of delay after another, by a Fourier transform.

    Parameters
    ----------
    sources : light that leaves its pixels
    place : (source) where it is to be placed, down and across from the middle of its pixel [pixels]
    far : (row, col) kernel, of sum 1
    slab_s : width of a slab of delay [s]

    Returns
    -------
    The light that lands, by slab.
    """
    from scipy.signal import fftconvolve

    if not len(sources.pixel):
        return []
    slab = ((sources.delay_s - sources.delay_s.min()) / slab_s).astype(np.int64)
    landed = []
    for number in np.unique(slab):
        of = np.flatnonzero(slab == number)
        total = float(sources.photons[of].sum())
        pixels, down, across, photons = (packed(values[of]) for values in (sources.pixel, *place, sources.photons))
        image = place_light(pixels, down, across, photons, *receiver.shape)
        blurred = fftconvolve(image, far, mode="same").ravel()
        pixel = np.flatnonzero(blurred > _ROUNDING * total)
        delay_s = float((sources.photons[of] * sources.delay_s[of]).sum()) / total
        same = np.ones(len(pixel))
        brightest = of[find_first_greatest(sources.photons[of])]
        coherence_cells = np.full(len(pixel), 1e3)  # light from many pixels: its speckle averages out
        hit = np.full(len(pixel), sources.hit[brightest])
        landed.append(Light(pixel, delay_s * same, blurred[pixel], slab_s * same, coherence_cells, hit))
    return landed


def zone_shares(receiver: Receiver, wavelength_m: float, side: int, zone: int) -> np.ndarray:
    """Return the shares of a ray's light in the middle of a zone of the field, or in all of it, by sub-cell with a margin.

    Parameters
    ----------
    side : sub-cells along each side of a pixel
    zone : number of the zone; 0 where the PSF is the same over the field
    """
    if not isinstance(receiver.psf, FieldDependentPsf):
        return _shares(receiver, wavelength_m, side, 0.0, 0.0)
    x = ((zone % ZONES + 0.5) / ZONES - 0.5) * receiver.n_cols * receiver.pixel_tangent
    y = ((zone // ZONES + 0.5) / ZONES - 0.5) * receiver.n_rows * receiver.pixel_tangent
    return _shares(receiver, wavelength_m, side, float(np.arctan(np.hypot(x, y))), float(np.arctan2(y, x)))


@lru_cache(maxsize=256)
def _shares(receiver: Receiver, wavelength_m: float, side: int, field_rad: float, azimuth_rad: float) -> np.ndarray:
    """Return the shares of a ray's light at one position in the field.

    Parameters
    ----------
    side : sub-cells along each side of a pixel

    Returns
    -------
    (sub row, sub col, row offset, col offset), with a margin of one sub-cell. A share that is too small to matter is left in
    the middle: all of these together are less than what lies beyond the reach.
    """
    assert receiver.psf is not None
    optics = {
        "pitch_m": receiver.pixel_pitch_m,
        "wavelength_m": wavelength_m,
        "f_number": receiver.focal_length_m / receiver.aperture_m,
        "field_rad": field_rad,
        "azimuth_rad": azimuth_rad,
    }
    kernels = (
        [entry.psf for entry in receiver.psf.fields] if isinstance(receiver.psf, FieldDependentPsf) else [receiver.psf]
    )
    has_halo = any(kernel.halo_fraction > 0.0 for kernel in kernels)
    missed = _MISSED_OF_HALO if has_halo else _MISSED
    reach = find_reach(receiver.psf, missed=missed, **optics)
    shares = pixel_shares(receiver.psf, sub=side, reach=reach, margin=1, **optics).copy()
    small = shares < missed / (2 * reach + 1) ** 2
    shares[:, :, reach, reach] += np.where(small, shares, 0.0).sum(axis=(2, 3))
    shares[small] = 0.0
    return shares


def read_files(laser: Laser, receiver: Receiver) -> None:
    """Read all files that laser and receiver name, so that an error in one is raised before the first flash.

    Parameters
    ----------
    laser : with its pattern or measured pulse
    receiver : with its distortion and point spread function
    """
    laser.density(np.zeros(1), np.zeros(1))
    _ = laser.pulse
    if receiver.distortion is not None:
        _ = receiver.line_of_sight
        half = 0.5 * receiver.pixel_tangent
        receiver.distortion.check(half * receiver.n_cols, half * receiver.n_rows)
    if receiver.psf is not None:
        zone_shares(receiver, laser.wavelength_m, 1, 0)
