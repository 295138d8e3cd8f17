"""NumPy oracle of `rso_lidar.optics.returns.blur`: same signature, same light in the same order.

Light that goes far comes by a Fourier transform, which is NumPy in the package too.
"""

from dataclasses import dataclass

import numpy as np

from rso_lidar.optics import FieldDependentPsf
from rso_lidar.optics.returns.blur import (
    BIN_FWHM,
    LEAST_PHOTONS,
    SLAB_FWHM,
    ZONES,
    Light,
    count_subcells,
    split_core_and_far,
    spread_far_light,
    zone_shares,
)
from tests.reference.ties import find_first_greatest_of_each


def blur_light(hits, light, receiver, wavelength_m, pulse_fwhm_s):
    """Return light behind the lens from light that arrives, one return for each lit hit, in their order."""
    if not len(light.pixel):
        return light
    sub = count_subcells(hits)
    place = _place_in_pixel(hits, receiver, sub)[light.hit]
    group = _groups(light, BIN_FWHM * pulse_fwhm_s)
    zone = np.zeros(len(light.pixel), np.int64)
    if isinstance(receiver.psf, FieldDependentPsf):
        row, col = light.pixel // receiver.n_cols, light.pixel % receiver.n_cols
        zone = row * ZONES // receiver.n_rows * ZONES + col * ZONES // receiver.n_cols
    parts = []
    for number in np.unique(zone):
        shares = zone_shares(receiver, wavelength_m, sub, int(number))
        of = np.flatnonzero(zone[group.order] == number)
        parts += _spread(light, group.only(of), place, shares, receiver, pulse_fwhm_s)
    made = Light(*(np.concatenate([getattr(part, name) for part in parts]) for name in Light.__dataclass_fields__))
    order = np.lexsort((made.delay_s, made.pixel))
    return made.only(order)


def _place_in_pixel(hits, receiver, sub):
    """Return the sub-cell of its pixel (hit) that each ray goes through, row * sub + col."""
    direction = hits.rays.direction[hits.ray]
    col, row = receiver.image_of(direction[:, 0] / direction[:, 2], direction[:, 1] / direction[:, 2])
    down, across = (np.clip(((at - np.floor(at)) * sub).astype(np.int64), 0, sub - 1) for at in (row, col))
    return down * sub + across


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


def _spread(
    light: Light, group: _Groups, place: np.ndarray, shares: np.ndarray, receiver, pulse_fwhm_s: float
) -> list[Light]:
    """Return the light of some groups where the lens puts it: near their pixels, and far from them."""
    order, starts = group.order, group.starts
    photons, delay_s, cells = light.photons[order], light.delay_s[order], light.coherence_cells[order]
    pixel = light.pixel[order][starts].astype(np.int64)
    row, col = pixel // receiver.n_cols, pixel % receiver.n_cols
    core, far = split_core_and_far(shares)
    reach = core.shape[-1] // 2
    near = core.reshape(-1, *core.shape[2:])[place[order]]  # (return, row offset, col offset)
    hit = light.hit[
        order[find_first_greatest_of_each(photons, starts)]
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
            little = sent < LEAST_PHOTONS
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
        cast, stays = spread_far_light(sources, far, receiver, SLAB_FWHM * pulse_fwhm_s)
        home += stays
        made += cast
    coherence_cells = np.add.reduceat(cells * near[:, reach, reach], starts)
    return [Light(pixel, mean_s, home, spread_s, coherence_cells, hit), *made]


def _marks(starts: np.ndarray, n: int) -> np.ndarray:
    marks = np.zeros(n, np.int64)
    marks[starts] = 1
    return marks


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


def blur_sunlight(hits, rate_per_s, receiver, wavelength_m):
    """Return the sunlight (row, col) on each pixel: the kernel of each hit added where it lands, without a transform."""
    sub = count_subcells(hits)
    place = _place_in_pixel(hits, receiver, sub)
    rows, cols = receiver.shape
    image = np.zeros(receiver.shape)
    row, col = hits.pixel // cols, hits.pixel % cols
    zone = np.zeros(len(row), np.int64)
    if isinstance(receiver.psf, FieldDependentPsf):
        zone = row * ZONES // rows * ZONES + col * ZONES // cols
    for number in np.unique(zone):
        core, far = split_core_and_far(zone_shares(receiver, wavelength_m, sub, int(number)))
        core = core.reshape(-1, *core.shape[2:])
        for k in np.flatnonzero((zone == number) & (rate_per_s > 0.0)):
            near = core[place[k]]
            _add_at(image, row[k], col[k], rate_per_s[k] * near)
            if far is not None:
                _add_at(image, row[k], col[k], rate_per_s[k] * max(1.0 - near.sum(), 0.0) * far)
    return image


def _add_at(image, row, col, kernel):
    """Add a kernel to an image about a pixel; what falls beside the image is lost."""
    reach = kernel.shape[0] // 2
    for i in range(kernel.shape[0]):
        for j in range(kernel.shape[1]):
            down, across = row + i - reach, col + j - reach
            if 0 <= down < image.shape[0] and 0 <= across < image.shape[1]:
                image[down, across] += kernel[i, j]
