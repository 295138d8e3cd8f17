"""What a real lens does to the image: light of one direction spread over pixels.

The spread acts on the oversampled image, before light is binned to pixels, and in narrow bins of delay, so that two depths
which meet in a pixel stay two returns. No light is lost but what falls beside the focal plane.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rso_lidar.arithmetic import compiled, packed
from rso_lidar.optics.laser import Laser
from rso_lidar.optics.lens.psf import FieldDependentPsf, pixel_shares, reach_of
from rso_lidar.optics.receiver import Receiver
from rso_lidar.records import Hits
from rso_lidar.ties import first_greatest, first_greatest_of_each

_MISSED = 1e-3  # of the light may lie beyond the pixels that are looked at; it is shared among them
_MISSED_OF_HALO = 1e-6  # a halo is faint and wide, and beside a bright glint it is what counts
_FINEST = 8  # places of a ray along each side of its pixel that its light is told apart by
_ZONES = 8  # along each side of the focal plane, in which a PSF that changes over the field is taken as one
_BIN_FWHM = 0.1  # of the pulse: light of one pixel that comes so close together is spread as one
# So many pixels about its own get a ray's light by its place in the pixel; farther, the pixel's middle decides.
_CORE = 2
_SLAB_FWHM = 0.25  # of the pulse: light that goes farther is told apart in depth so finely
_LEAST_PHOTONS = 0.3  # a return of less is not made: its light is shared among the others


@dataclass(frozen=True, eq=False)
class Light:
    """Light on the focal plane, ordered by pixel (return): what `Photons` holds of it."""

    pixel: np.ndarray
    delay_s: np.ndarray
    photons: np.ndarray
    depth_spread_s: np.ndarray
    coherence_cells: np.ndarray
    hit: np.ndarray

    def only(self, some: np.ndarray) -> "Light":
        """Return some of the returns."""
        return Light(*(getattr(self, name)[some] for name in Light.__dataclass_fields__))


def blurred(hits: Hits, light: Light, receiver: Receiver, wavelength_m: float, pulse_fwhm_s: float) -> Light:
    """Return light behind the lens from light that arrives, one return for each lit hit, in their order."""
    if not len(light.pixel):
        return light
    sub = _sub(hits)
    if compiled():
        return _blurred_by_loops(hits, light, receiver, wavelength_m, pulse_fwhm_s, sub)
    place = _place_in_pixel(hits, receiver, sub)[light.hit]
    group = _groups(light, _BIN_FWHM * pulse_fwhm_s)
    zone = np.zeros(len(light.pixel), np.int64)
    if isinstance(receiver.psf, FieldDependentPsf):
        row, col = light.pixel // receiver.n_cols, light.pixel % receiver.n_cols
        zone = row * _ZONES // receiver.n_rows * _ZONES + col * _ZONES // receiver.n_cols
    parts = []
    for number in np.unique(zone):
        shares = _zone_shares(receiver, wavelength_m, sub, int(number))
        of = np.flatnonzero(zone[group.order] == number)
        parts += _spread(light, group.only(of), place, shares, receiver, pulse_fwhm_s)
    made = Light(*(np.concatenate([getattr(part, name) for part in parts]) for name in Light.__dataclass_fields__))
    order = np.lexsort((made.delay_s, made.pixel))
    return made.only(order)


def _blurred_by_loops(
    hits: Hits, light: Light, receiver: Receiver, wavelength_m: float, pulse_fwhm_s: float, sub: int
) -> Light:
    """Return what `blurred` does: same light, same order."""
    from rso_lidar.optics.returns.blur_loops import gathered, grouped, places, spread

    n_rows, n_cols = receiver.shape
    if receiver.distortion is None:
        x, y, z = map(packed, hits.rays.direction.T)
        place = places(packed(hits.ray), x, y, z, receiver.pixel_tangent, n_rows, n_cols, sub)
    else:
        place = _place_in_pixel(hits, receiver, sub)
    zones = _ZONES if isinstance(receiver.psf, FieldDependentPsf) else 1
    zone_of = np.arange(n_rows)[:, None] * zones // n_rows * zones + np.arange(n_cols) * zones // n_cols
    zone_of_light = zone_of.ravel()[light.pixel] if zones > 1 else np.zeros(1, np.int64)
    numbers = np.unique(zone_of_light)
    cores, fars = _cores_and_fars(receiver, wavelength_m, sub, tuple(numbers.tolist()))
    number = np.zeros(zones * zones, np.int64)
    number[numbers] = np.arange(len(numbers))
    pixel, delay_s, light_photons, spread_s, coherence_cells, hit = (
        packed(getattr(light, name)) for name in Light.__dataclass_fields__
    )
    order, starts = grouped(pixel, delay_s, _BIN_FWHM * pulse_fwhm_s)
    at, brightest, width_s, away, near = spread(
        pixel,
        delay_s,
        light_photons,
        spread_s,
        coherence_cells,
        hit,
        order,
        starts,
        place,
        number,
        zones,
        cores,
        n_rows,
        n_cols,
        _LEAST_PHOTONS,
    )
    photons, mean_s, _ = (values[:, near[0].shape[1] // 2] for values in near)
    cast = [Light(*(np.zeros(0, values.dtype) for values in (at, mean_s, photons, width_s, away, brightest)))]
    for zone, far in enumerate(fars):
        if far is None:
            continue
        of = np.flatnonzero(number[zone_of.ravel()[at]] == zone)
        sources = Light(at[of], mean_s[of], away[of], width_s[of], np.zeros(len(of)), brightest[of])
        parts, stays = _far_light(sources, far, receiver, _SLAB_FWHM * pulse_fwhm_s)
        photons[of] += stays
        cast += parts
    far_light = [
        np.concatenate([getattr(part, name) for part in cast]).astype(getattr(cast[0], name).dtype)
        for name in Light.__dataclass_fields__
    ]
    return Light(*gathered(at, brightest, width_s, near, tuple(far_light), n_rows, n_cols))  # type: ignore[arg-type]


@lru_cache(maxsize=64)
def _cores_and_fars(
    receiver: Receiver, wavelength_m: float, sub: int, zones: tuple[int, ...]
) -> tuple[np.ndarray, tuple[np.ndarray | None, ...]]:
    """Return the shares near a ray's pixel (zone, sub-cell, offset), and how what goes farther is distributed (zone).

    Cores that reach differently far become equally wide: what one does not reach gets nothing.
    """
    pairs = [_core_and_far(_zone_shares(receiver, wavelength_m, sub, zone)) for zone in zones]
    widest = max(core.shape[-1] for core, _ in pairs)
    cores = np.zeros((len(pairs), sub * sub, widest, widest))
    for zone, (core, _) in enumerate(pairs):
        edge = (widest - core.shape[-1]) // 2
        cores[zone, :, edge : widest - edge, edge : widest - edge] = core.reshape(sub * sub, *core.shape[2:])
    return packed(cores.reshape(len(pairs), sub * sub, -1)), tuple(far for _, far in pairs)


@dataclass(frozen=True, eq=False)
class _Groups:
    """Returns in order of pixel and bin of delay; a group begins at each of `starts`."""

    order: np.ndarray
    starts: np.ndarray

    def only(self, of: np.ndarray) -> "_Groups":
        """Return the groups of some entries of `order`, which hold whole groups."""
        if len(of) == len(self.order):
            return self
        number = np.cumsum(np.bincount(self.starts, minlength=len(self.order)))[of]
        return _Groups(self.order[of], np.flatnonzero(np.diff(number, prepend=-1)))


def _groups(light: Light, bin_s: float) -> _Groups:
    bins = ((light.delay_s - light.delay_s.min()) / bin_s).astype(np.int64)
    key = light.pixel.astype(np.int64) * (int(bins.max()) + 1) + bins
    order = np.argsort(key, kind="stable")
    return _Groups(order, np.flatnonzero(np.diff(key[order], prepend=-1)))


def _sub(hits: Hits) -> int:
    """Return into how many sub-cells a pixel's side is cut: as finely as its finest ray, up to a limit."""
    return int(np.clip(np.rint(hits.weight.min() ** -0.5), 1, _FINEST))


def _place_in_pixel(hits: Hits, receiver: Receiver, sub: int) -> np.ndarray:
    """Return the sub-cell of its pixel (hit) that each ray goes through, row * sub + col."""
    direction = hits.rays.direction[hits.ray]
    col, row = receiver.image_of(direction[:, 0] / direction[:, 2], direction[:, 1] / direction[:, 2])
    down, across = (np.clip(((at - np.floor(at)) * sub).astype(np.int64), 0, sub - 1) for at in (row, col))
    cell: np.ndarray = down * sub + across
    return cell


def _spread(
    light: Light, group: _Groups, place: np.ndarray, shares: np.ndarray, receiver: Receiver, pulse_fwhm_s: float
) -> list[Light]:
    """Return the light of some groups where the lens puts it: near their pixels, and far from them."""
    order, starts = group.order, group.starts
    photons, delay_s, cells = light.photons[order], light.delay_s[order], light.coherence_cells[order]
    pixel = light.pixel[order][starts].astype(np.int64)
    row, col = pixel // receiver.n_cols, pixel % receiver.n_cols
    core, far = _core_and_far(shares)
    reach = core.shape[-1] // 2
    near = core.reshape(-1, *core.shape[2:])[place[order]]  # (return, row offset, col offset)
    hit = light.hit[
        order[first_greatest_of_each(photons, starts)]
    ]  # the brightest of a group stands for it in the labels
    spread_s = _together(delay_s, light.depth_spread_s[order], photons, starts)
    home = np.zeros(len(starts))
    made = []
    for down in range(-reach, reach + 1):
        for across in range(-reach, reach + 1):
            share = near[:, down + reach, across + reach]
            sent = np.add.reduceat(photons * share, starts)
            if (down, across) == (0, 0):
                home += sent
                continue
            on = (row + down >= 0) & (row + down < receiver.n_rows)
            on &= (col + across >= 0) & (col + across < receiver.n_cols)
            little = sent < _LEAST_PHOTONS
            home += np.where(little & on, sent, 0.0)
            kept = np.flatnonzero(on & ~little)
            mean_s = np.add.reduceat(photons * share * delay_s, starts)[kept] / sent[kept]
            coherence_cells = np.add.reduceat(cells * share, starts)[kept]
            to = (pixel + down * receiver.n_cols + across)[kept]
            made.append(Light(to, mean_s, sent[kept], spread_s[kept], coherence_cells, hit[kept]))
    weight = np.where(np.add.reduceat(photons, starts)[np.cumsum(_marks(starts, len(order))) - 1] > 0.0, photons, 1.0)
    mean_s = np.add.reduceat(weight * delay_s, starts) / np.add.reduceat(weight, starts)
    if far is not None:
        away = np.add.reduceat(photons * np.maximum(1.0 - near.sum(axis=(1, 2)), 0.0), starts)
        sources = Light(pixel, mean_s, away, spread_s, np.zeros(len(starts)), hit)
        cast, stays = _far_light(sources, far, receiver, _SLAB_FWHM * pulse_fwhm_s)
        home += stays
        made += cast
    coherence_cells = np.add.reduceat(cells * near[:, reach, reach], starts)
    return [Light(pixel, mean_s, home, spread_s, coherence_cells, hit), *made]


def _marks(starts: np.ndarray, n: int) -> np.ndarray:
    marks = np.zeros(n, np.int64)
    marks[starts] = 1
    return marks


def _far_light(sources: Light, kernel: np.ndarray, receiver: Receiver, slab_s: float) -> tuple[list[Light], np.ndarray]:
    """Return the light that pixels send far away, slab by slab of delay, and what of each source (source) stays at home.

    A slab that would give no pixel a return's worth stays whole where it is; of others what is too little is shared among
    the rest.
    """
    from scipy.signal import fftconvolve

    stays = np.zeros(len(sources.pixel))
    slab = ((sources.delay_s - sources.delay_s.min()) / slab_s).astype(np.int64)
    cast = []
    for number in np.unique(slab):
        of = np.flatnonzero(slab == number)
        total = float(sources.photons[of].sum())
        if total * float(kernel.max()) < _LEAST_PHOTONS:
            stays[of] = sources.photons[of]
            continue
        image = np.bincount(sources.pixel[of], sources.photons[of], receiver.n_rows * receiver.n_cols)
        fallen = np.maximum(fftconvolve(image.reshape(receiver.shape), kernel, mode="same").ravel(), 0.0)
        pixel = np.flatnonzero(fallen >= _LEAST_PHOTONS)
        if not len(pixel):
            stays[of] = sources.photons[of]
            continue
        photons = fallen[pixel] * (float(fallen.sum()) / float(fallen[pixel].sum()))
        delay_s = float((sources.photons[of] * sources.delay_s[of]).sum()) / total
        same = np.ones(len(pixel))
        brightest = of[first_greatest(sources.photons[of])]
        coherence_cells = np.full(len(pixel), 1e3)  # light from many pixels: its speckle averages out
        cast.append(
            Light(
                pixel,
                delay_s * same,
                photons,
                slab_s * same,
                coherence_cells,
                np.full(len(pixel), sources.hit[brightest]),
            )
        )
    return cast, stays


def _together(delay_s: np.ndarray, spread_s: np.ndarray, photons: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Return the depth spread [s] of each group's light as one: the width of a box of the same variance."""
    weight = np.maximum(photons, 1e-30)
    total = np.add.reduceat(weight, starts)
    first_s = np.repeat(delay_s[starts], np.diff(starts, append=len(delay_s)))
    apart_s = delay_s - first_s
    mean_s = np.add.reduceat(weight * apart_s, starts) / total
    square = np.add.reduceat(weight * (apart_s**2 + spread_s**2 / 12.0), starts) / total
    spread: np.ndarray = np.sqrt(np.maximum(12.0 * (square - mean_s**2), 0.0))
    return spread


def _core_and_far(shares: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the shares near a ray's pixel, and how what goes farther is distributed (None: nothing does)."""
    reach = shares.shape[-1] // 2
    if reach <= _CORE:
        return shares, None
    middle = slice(reach - _CORE, reach + _CORE + 1)
    far = shares.mean(axis=(0, 1))
    far[middle, middle] = 0.0
    return shares[:, :, middle, middle], far / far.sum()


def _zone_shares(receiver: Receiver, wavelength_m: float, sub: int, zone: int) -> np.ndarray:
    """Return the shares of a ray's light for the middle of a zone of the field, or for all of it."""
    if not isinstance(receiver.psf, FieldDependentPsf):
        return _shares(receiver, wavelength_m, sub, 0.0, 0.0)
    x = ((zone % _ZONES + 0.5) / _ZONES - 0.5) * receiver.n_cols * receiver.pixel_tangent
    y = ((zone // _ZONES + 0.5) / _ZONES - 0.5) * receiver.n_rows * receiver.pixel_tangent
    return _shares(receiver, wavelength_m, sub, float(np.arctan(np.hypot(x, y))), float(np.arctan2(y, x)))


@lru_cache(maxsize=256)
def _shares(receiver: Receiver, wavelength_m: float, sub: int, field_rad: float, azimuth_rad: float) -> np.ndarray:
    """Return the shares (sub row, sub col, row offset, col offset) of a ray's light, for one place in the field."""
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
    halo = any(kernel.halo_fraction > 0.0 for kernel in kernels)
    reach = reach_of(receiver.psf, missed=_MISSED_OF_HALO if halo else _MISSED, **optics)
    return pixel_shares(receiver.psf, sub=sub, reach=reach, **optics)


def read_files(laser: Laser, receiver: Receiver) -> None:
    """Read all files that laser and receiver name, so that what is wrong with one is told before the first flash."""
    laser.density(np.zeros(1), np.zeros(1))
    _ = laser.pulse, receiver.line_of_sight
    if receiver.distortion is not None:
        half = 0.5 * receiver.pixel_tangent
        receiver.distortion.check(half * receiver.n_cols, half * receiver.n_rows)
    if receiver.psf is not None:
        _zone_shares(receiver, laser.wavelength_m, 1, 0)
