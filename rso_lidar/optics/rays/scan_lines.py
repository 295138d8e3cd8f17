"""Line sampling: the rays of one flash along scan lines that contours cut, and the error that they leave."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.optics.laser import Laser
from rso_lidar.optics.rays.cells import boxes_in_cells, outlines_in_cells
from rso_lidar.optics.rays.contour_images import GAUSSIAN_REACH, cut_contours, image_contours
from rso_lidar.optics.rays.coverage import find_owners
from rso_lidar.optics.rays.ray_grid import normalise
from rso_lidar.optics.rays.slabs import NOISE_SHARE, correct_variance, place_rays
from rso_lidar.optics.receiver import Receiver
from rso_lidar.records import Contours, Extent, Hits, Rays, specs

# Choices between error and time, as docs/physics.md states them. The first three are over the error asked for.
_ROUGH = 10.0  # error at which the first round aims, over half the light of a pixel whose contours are all visible
_NARROW = 3.0  # width of intervals that share a ray, over the width of all contours on their line
_NARROW_AGAIN = 1.0  # the same in the second round
_STEEP = 2.5  # change of column with row of contours whose ends do not count, over the width of all contours of a pixel
_AIM = 0.7  # error in a second round, over the one that is asked for
_DIM = 1e-3  # a pixel with less light, over the brightest, counts as if it had so much
_MOST_PER_SIDE = 32  # rays
# The label's variance over what is expected, fitted to the scenes of tests/physics/sampling_scenes.py:
_PER_STEP, _PER_TEXTURE, _PER_TWIST = 0.35, 0.3, 0.1
_ERROR_OF_CELLS = 0.54
_CONTRAST = 2.0  # assumed: spread of the light of cells of foil, over its mean


class ScanLines:
    """Rays of one flash: one in each interval that contours cut from the scan lines of a pixel.

    Contours are edges at which light may change abruptly. They end slabs of a pixel, one line or two go through each slab,
    and each interval of a line between two contours gets a ray, whose weight is the interval's length times the height
    that the line stands for. Nothing is drawn at random.

    The number of slabs follows from the contours, in a first round from all of them. The light that its rays meet tells
    which contours are visible, and how bright a pixel is. Where the error may then be more than `Receiver.sampling_error` of
    the pixel's light and more than a third of its photon noise, the pixel is sampled anew with more slabs.

    Parameters
    ----------
    receiver, laser : the instrument
    extent, contours : where targets and their contours are in the tangent plane
    textures : (target) size of the cells of crinkled foil in the tangent plane; infinite for facets without a texture
    """

    def __init__(
        self, receiver: Receiver, laser: Laser, extent: Extent, contours: Contours, textures: np.ndarray
    ) -> None:
        self._receiver = receiver
        n_rows, n_cols = receiver.shape
        reach = np.inf
        if laser.offset is None and receiver.filter_width_nm is None:
            reach = laser.half_width_tangent * (GAUSSIAN_REACH if laser.footprint == "gaussian" else 1.0)
        boxes, outlines = boxes_in_cells(receiver, extent, reach, 1), outlines_in_cells(receiver, extent, 1)
        least, per_side = _rays_per_side(receiver, laser, textures)
        owner, self._top, self._left, _ = find_owners(boxes, per_side // least, *outlines, 1, n_rows, n_cols)
        height, width = owner.shape
        self._window = slice(self._top, self._top + height), slice(self._left, self._left + width)
        self._pieces = cut_contours(
            *image_contours(receiver, laser, contours), (self._top, self._top + height, self._left, self._left + width)
        )
        self._is_crossed = (np.diff(self._pieces[0]) > 0).reshape(height, width)
        self._sides = np.where((owner == 0) | self._is_crossed, least, 0)
        self._sides[owner > 0] = per_side[owner[owner > 0] - 1]
        self._place(self._sides, np.full((height, width), -1.0), _NARROW)

    def _place(self, sides: np.ndarray, allowed: np.ndarray, narrow: float) -> None:
        """Place the rays of some pixels of the window; the parameters are those of `slabs.place_rays`."""
        error = self._receiver.sampling_error
        point, pixel, weight, self._jump, known = place_rays(
            *self._pieces,
            packed(sides),
            self._top,
            self._left,
            self._receiver.n_cols,
            packed(allowed),
            _ROUGH * error,
            min(narrow * error, 0.125),
            _STEEP * error,
        )
        direction = np.empty((3, len(pixel)))
        direction[0], direction[1] = self._receiver.tangents_at(point[0], point[1])
        normalise(direction)
        self._variance = np.zeros(self._receiver.shape)
        self._variance[self._window] = known
        self.rays = Rays(self._receiver.shape, direction.T, pixel, weight)

    def take(self, hits: Hits, photons: np.ndarray, before: Hits | None = None) -> tuple[Hits, bool]:
        """Take the hits of `rays`, and place those of the next round if one is needed.

        Parameters
        ----------
        hits : hits of the rays
        photons : (hit) expected photons of a whole pixel that is as bright as the hit
        before : what this method returned in the round before

        Returns
        -------
        The hits with the variance of each pixel's photons that sampling leaves, and whether another round is needed.
        """
        rays = self.rays
        light = np.zeros(len(self._jump))
        light[hits.ray] = photons
        variance, (seen, total) = self._variance, np.zeros((2, *self._variance.shape))
        by_ray = packed(rays.pixel), packed(rays.weight), self._jump, light
        by_pixel = variance.reshape(-1), seen.reshape(-1), total.reshape(-1)
        correct_variance(*by_ray, *by_pixel, _PER_STEP, _PER_TEXTURE, _PER_TWIST)
        if before is not None:
            return _replace_pixels(before, replace(hits, photons_variance=variance)), False
        hits = replace(hits, photons_variance=variance)
        allowed = self._find_missed(variance[self._window], total[self._window])
        if not allowed.any():
            return hits, False
        allowed /= np.maximum(seen[self._window], 1e-3)
        self._place(np.where(allowed > 0.0, self._sides, 0), allowed, _NARROW_AGAIN)
        return hits, True

    def _find_missed(self, variance: np.ndarray, photons: np.ndarray) -> np.ndarray:
        """Return the variance (row, col) that pixels of the window may have which are to be sampled anew, 0 elsewhere.

        Parameters
        ----------
        variance, photons : (row, col) of the window's pixels
        """
        error, total = self._receiver.sampling_error, float(photons.sum())
        weight = np.maximum(photons, _DIM * photons.max(initial=0.0))
        noise = NOISE_SHARE**2 * np.maximum(photons, 1.0)
        share = np.where(variance > noise, variance / np.maximum(weight, 1e-12), 0.0)
        allowed = np.zeros(variance.shape)
        if share.sum() > error**2 * total:
            order = np.argsort(share, axis=None)
            aim = (_AIM * error) ** 2
            missed = order[np.cumsum(share.flat[order]) > aim * total]
            allowed.flat[missed] = np.maximum(aim * photons * weight, noise).flat[missed]
            allowed[~self._is_crossed] = 0.0
        return allowed


def _replace_pixels(hits: Hits, finer: Hits) -> Hits:
    """Return hits in which the pixels that have finer rays have these alone."""
    is_finer = np.zeros(hits.rays.shape, np.bool_)
    is_finer.flat[finer.rays.pixel] = True
    of_rays = merge_pixels(packed(hits.rays.pixel), packed(finer.rays.pixel), is_finer.reshape(-1))
    of_hits = merge_pixels(packed(hits.pixel), packed(finer.pixel), is_finer.reshape(-1))

    def join(before: np.ndarray, after: np.ndarray, order: np.ndarray) -> np.ndarray:
        both: np.ndarray = np.concatenate([before, after]).take(order, mode="clip")
        return both

    direction = np.empty((3, len(of_rays)))
    for axis in range(3):
        direction[axis] = join(hits.rays.direction[:, axis], finer.rays.direction[:, axis], of_rays)
    pixel, weight = (join(getattr(hits.rays, name), getattr(finer.rays, name), of_rays) for name in ("pixel", "weight"))
    place = np.zeros(len(hits.rays.pixel) + len(finer.rays.pixel), np.int32)
    place[of_rays] = np.arange(len(of_rays))
    columns: dict[str, Any] = {
        name: join(getattr(hits, name), getattr(finer, name), of_hits)
        for name, spec in specs(Hits).items()
        if spec.dims == ("hit",) and getattr(hits, name) is not None
    }
    columns["ray"] = place[join(hits.ray, finer.ray + np.int32(len(hits.rays.pixel)), of_hits)]
    columns["photons_variance"] = np.where(is_finer, finer.photons_variance, hits.photons_variance)
    return Hits(Rays(hits.rays.shape, direction.T, pixel, weight), **columns)


@kernel
def merge_pixels(before: np.ndarray, after: np.ndarray, is_replaced: np.ndarray) -> np.ndarray:
    """Merge two lists of pixels, neither of which falls; return the place of each entry in both lists joined.

    Parameters
    ----------
    before, after : (entry) pixels
    is_replaced : (pixel) whether the entries of `before` are left out
    """
    order, n, j = np.empty(len(before) + len(after), np.int64), 0, 0
    for i in range(len(before) + 1):
        while j < len(after) and (i == len(before) or after[j] < before[i]):
            order[n] = len(before) + j
            n, j = n + 1, j + 1
        if i < len(before) and not is_replaced[before[i]]:
            order[n] = i
            n += 1
    return order[:n].copy()


def _rays_per_side(receiver: Receiver, laser: Laser, textures: np.ndarray) -> tuple[int, np.ndarray]:
    """Return the number of rays along the side of a pixel that no contour crosses, in general and for each target.

    N rays through n cells of even light of different brightness, with a relative spread c, have the relative error
    0.54 c n^(1/4) / N^(3/4): the error of the area within an outline on a lattice (0.0724 u³ for each unit of length, with
    the spacing u; Matérn 1989), for the outlines of all cells.
    """
    least = 2 if laser.offset is None else 4  # shadows of a laser beside the lens have no contours
    if laser.footprint == "pattern":
        least = max(least, min(math.ceil(2.0 * receiver.pixel_tangent / laser.cell_tangent), _MOST_PER_SIDE))
    cells = (receiver.pixel_tangent / textures) ** 2
    rays = (_ERROR_OF_CELLS * _CONTRAST / receiver.sampling_error) ** (4.0 / 3.0) * np.cbrt(cells)
    return least, packed(np.clip(np.ceil(np.sqrt(rays)), least, _MOST_PER_SIDE).astype(np.int64))
