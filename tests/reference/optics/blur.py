"""NumPy oracle of `rso_lidar.optics.returns.blur`: same signature, same light in the same order.

Light that goes far comes by a Fourier transform, which is NumPy in the package too.
"""

from dataclasses import dataclass

import numpy as np

from rso_lidar.optics import FieldDependentPsf
from rso_lidar.optics.returns.blur import (
    BIN_FWHM,
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
    down, across = (values[light.hit] for values in _place_in_pixel(hits, receiver))
    group = _groups(light, BIN_FWHM * pulse_fwhm_s)
    zone = np.zeros(len(light.pixel), np.int64)
    if isinstance(receiver.psf, FieldDependentPsf):
        row, col = light.pixel // receiver.n_cols, light.pixel % receiver.n_cols
        zone = row * ZONES // receiver.n_rows * ZONES + col * ZONES // receiver.n_cols
    parts = []
    for number in np.unique(zone):
        shares = zone_shares(receiver, wavelength_m, sub, int(number))
        of = np.flatnonzero(zone[group.order] == number)
        parts += _spread(light, group.only(of), (down, across), shares, receiver, pulse_fwhm_s)
    made = Light(*(np.concatenate([getattr(part, name) for part in parts]) for name in Light.__dataclass_fields__))
    order = np.lexsort((made.delay_s, made.pixel))
    return made.only(order)


def _place_in_pixel(hits, receiver):
    """Return where in its pixel each hit's ray goes through, from the upper edge and from the left one [pixels]."""
    direction = hits.rays.direction[hits.ray]
    col, row = receiver.image_of(direction[:, 0] / direction[:, 2], direction[:, 1] / direction[:, 2])
    return row - np.floor(row), col - np.floor(col)


def _interpolate(table, down, across):
    """Return rows of a table (sub row, sub col, ...) at places in the pixel, linearly between middles of sub-cells."""
    sides = [np.arange(n) - 0.5 for n in table.shape[:2]]
    cells = [at * (len(side) - 2) for at, side in zip((down, across), sides, strict=True)]
    # A hat about the middle of each sub-cell, as wide as the distance of its neighbours.
    hats = [np.maximum(1.0 - np.abs(at[:, None] - side), 0.0) for at, side in zip(cells, sides, strict=True)]
    return np.einsum("ki,kj,ij...->k...", *hats, table)


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


def _spread(light, group, place, shares, receiver, pulse_fwhm_s):
    """Return the light of some groups where the lens puts it: near their pixels, and far from them."""
    order, starts = group.order, group.starts
    photons, delay_s, cells = light.photons[order], light.delay_s[order], light.coherence_cells[order]
    pixel = light.pixel[order][starts].astype(np.int64)
    row, col = pixel // receiver.n_cols, pixel % receiver.n_cols
    core, beyond, far = split_core_and_far(shares)
    reach = core.shape[-1] // 2
    at = [values[order] for values in place]
    near, outside = _interpolate(core, *at), _interpolate(beyond, *at)
    hit = light.hit[
        order[find_first_greatest_of_each(photons, starts)]
    ]  # the brightest of a group stands for it in the labels
    spread_s = _together(delay_s, light.depth_spread_s[order], photons, starts)
    dark_s = np.add.reduceat(delay_s, starts) / np.diff(starts, append=len(order))
    home_s, made = dark_s, []
    for down in range(-reach, reach + 1):
        for across in range(-reach, reach + 1):
            share = near[:, down + reach, across + reach]
            sent = np.add.reduceat(photons * share, starts)
            is_home = (down, across) == (0, 0)
            on = (row + down >= 0) & (row + down < receiver.n_rows)
            on &= (col + across >= 0) & (col + across < receiver.n_cols)
            mean_s = np.add.reduceat(photons * share * delay_s, starts) / np.where(sent > 0.0, sent, 1.0)
            mean_s = np.where(sent > 0.0, mean_s, dark_s)
            home_s = mean_s if is_home else home_s
            coherence_cells = np.add.reduceat(cells * share, starts)
            to = pixel + down * receiver.n_cols + across
            made.append(Light(to, mean_s, sent, spread_s, coherence_cells, hit).only(is_home | (on & (sent > 0.0))))
    if far is not None:
        away, *moved = (np.add.reduceat(photons * outside[:, k], starts) for k in range(3))
        of = np.flatnonzero(away > 0.0)
        sources = Light(pixel, home_s, away, spread_s, np.zeros(len(starts)), hit).only(of)
        to = tuple(moment[of] / away[of] for moment in moved)
        made += spread_far_light(sources, to, far, receiver, SLAB_FWHM * pulse_fwhm_s)
    return made


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
    down, across = _place_in_pixel(hits, receiver)
    rows, cols = receiver.shape
    image = np.zeros(receiver.shape)
    row, col = hits.pixel // cols, hits.pixel % cols
    zone = np.zeros(len(row), np.int64)
    if isinstance(receiver.psf, FieldDependentPsf):
        zone = row * ZONES // rows * ZONES + col * ZONES // cols
    for number in np.unique(zone):
        core, beyond, far = split_core_and_far(zone_shares(receiver, wavelength_m, sub, int(number)))
        for k in np.flatnonzero((zone == number) & (rate_per_s > 0.0)):
            near, outside = (_interpolate(table, down[[k]], across[[k]])[0] for table in (core, beyond))
            _add_at(image, row[k], col[k], rate_per_s[k] * near)
            if far is not None and outside[0] > 0.0:
                to = np.floor(outside[1:] / outside[0]).astype(int)
                y, x = outside[1:] / outside[0] - to
                for i, j, part in ((0, 0, (1 - y) * (1 - x)), (0, 1, (1 - y) * x), (1, 0, y * (1 - x)), (1, 1, y * x)):
                    at = row[k] + to[0] + i, col[k] + to[1] + j
                    if 0 <= at[0] < rows and 0 <= at[1] < cols:
                        _add_at(image, *at, rate_per_s[k] * outside[0] * part * far)
    return image


def _add_at(image, row, col, kernel):
    """Add a kernel to an image about a pixel; what falls beside the image is lost."""
    reach = kernel.shape[0] // 2
    for i in range(kernel.shape[0]):
        for j in range(kernel.shape[1]):
            down, across = row + i - reach, col + j - reach
            if 0 <= down < image.shape[0] and 0 <= across < image.shape[1]:
                image[down, across] += kernel[i, j]
