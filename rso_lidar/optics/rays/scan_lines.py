"""Line sampling: the rays of one flash along scan lines that contours cut, and the error that they leave."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.optics.laser import Laser
from rso_lidar.optics.rays.contour_images import GAUSSIAN_REACH, cut_contours, image_contours
from rso_lidar.optics.rays.line_rays import CONTOUR, LINE, PAIR, TEXTURE, place_rays
from rso_lidar.optics.rays.outlines import cover_pixels, image_bounds, image_outlines
from rso_lidar.optics.rays.probes import count_probes, distrust_fronts, find_unexpected, image_fronts, place_probes
from rso_lidar.optics.rays.slabs import NOISE_SHARE
from rso_lidar.optics.receiver import Receiver
from rso_lidar.records import Contours, Extent, Hits, Rays, specs

# Choices between error and time, as docs/physics.md states them. _ROUGH, _NARROW, _NARROW_AGAIN, _STEEP and _AIM are
# multiples of the error asked for.
_ROUGH = 10.0  # error at which the first round aims, over half the light of a pixel whose contours are all visible
_NARROW = 3.0  # width of intervals that share a ray, over the width of all contours on their line
_NARROW_AGAIN = 1.0  # the same in the second round
_NARROWEST = 0.06  # greatest such width, whatever error is asked for
_STEEP = 2.5  # change of column with row of contours whose ends do not count, over the width of all contours of a pixel
_AIM = 0.7  # error in a second round, over the one that is asked for
_DIM = 1e-3  # a pixel with less light, over the brightest, counts as if it had so much
_WIDE = 8.0  # pixels: half the width of a Gaussian beam whose light is nearly even within a pixel
_MOST_PER_SIDE = 48  # rays
# The label's variance over what is expected, fitted to the scenes of tests/physics/sampling_scenes.py:
_PER_STEP, _PER_TEXTURE, _PER_TWIST, _PER_UNEXPECTED = 0.65, 0.2, 0.2, 0.1
_BRIGHTER = 3.0  # squared step at most, over the one expected: a dim facet may hide a bright one
_ERROR_OF_CELLS = 0.54  # see `_rays_per_side`
_CONTRAST = 2.0  # assumed: spread of the light of cells of foil, over its mean


class ScanLines:
    """Rays of one flash: one in each interval that contours cut from the scan lines of a pixel.

    Contours are edges at which light may change abruptly. A pixel is cut into slabs where they end. Each slab gets
    one line or more. Each interval between two contours gets one ray or more, whose weights sum to the interval's length
    times the height that the line stands for. Very narrow neighbours share a ray. Nothing is drawn at random.

    Cast `probes` first, if there are any, and give what they meet to `lay`: it leaves out hidden contours. Then `rays`
    are those of the first round, to be cast and given to `take`. The number of slabs follows from the remaining contours.
    The light that the rays meet tells which of these are visible, and how bright a pixel is. If the error of the frame may
    then be more than `Receiver.sampling_error`, the pixels that contribute most to it are sampled anew with more slabs.

    With `Receiver.rays_per_pixel` = k², each pixel has k lines with k rays each where no contours are given, and there is
    one round.

    Parameters
    ----------
    receiver, laser : the instrument
    extent, contours : where targets and their contours are in the tangent plane
    textures : (target) size of the cells of crinkled foil in the tangent plane; infinite for facets without a texture

    Attributes
    ----------
    probes : rays that find what is hidden; None where there are no contours, and the lines are laid
    rays : those of the round that is to be cast; from `lay` on
    """

    def __init__(
        self, receiver: Receiver, laser: Laser, extent: Extent, contours: Contours, textures: np.ndarray
    ) -> None:
        self._receiver, reach = receiver, np.inf
        if laser.offset is None and receiver.filter_width_nm is None:
            reach = laser.half_width_tangent * (GAUSSIAN_REACH if laser.footprint == "gaussian" else 1.0)
        bounds, outlines = image_bounds(receiver, extent, reach), image_outlines(receiver, extent)
        per_side = _rays_per_side(receiver, laser, textures)
        self._sides, top, left = cover_pixels(bounds, *outlines, per_side, *receiver.shape)
        self._window = slice(top, top + self._sides.shape[0]), slice(left, left + self._sides.shape[1])
        self._contours = image_contours(receiver, laser, contours)
        self.probes: Rays | None = None
        self._fronts, self._per_side = np.empty((4, 0, 0)), 0
        if len(contours.ends):
            self._per_side = count_probes(self._sides, receiver.sampling_error)
            self.probes = self._aim(*place_probes(self._sides, self._per_side, top, left, receiver.n_cols))
        else:
            self._begin()

    def lay(self, fronts: np.ndarray) -> None:
        """Lay the scan lines of the first round, and place its `rays`.

        Parameters
        ----------
        fronts : (abc, probe) [1/m], what `probes` meet: 1/z = a x/z + b y/z + c on the plane of a facet, zeros for nothing
        """
        assert self.probes is not None, "lay: there are no probes"
        apart, direction = self._receiver.pixel_tangent / self._per_side, packed(self.probes.direction.T)
        error = self._receiver.sampling_error
        self._fronts = image_fronts(self._sides, self._per_side, direction, packed(fronts), apart, error)
        self._begin()

    def _begin(self) -> None:
        """Place the rays of the first round."""
        self._cut(self._sides)
        self._is_crossed = (np.diff(self._pieces[0]) > 0).reshape(self._sides.shape)
        self._place(self._sides, np.full(self._sides.shape, -1.0), _NARROW)

    def _cut(self, sides: np.ndarray) -> None:
        """Cut the contours that are not hidden into pieces, in pixels with rays, of which `sides` (row, col) is not 0."""
        rows, cols = self._window
        self._pieces = cut_contours(
            *self._contours, packed(sides), rows.start, cols.start, self._fronts, self._per_side
        )

    def _aim(self, point: np.ndarray, pixel: np.ndarray, weight: np.ndarray, side: np.ndarray | None = None) -> Rays:
        """Aim rays at points (col_row, ray) of the focal plane [pixels]; the others are columns of `Rays`."""
        direction = np.empty((3, len(pixel)))
        direction[0], direction[1] = self._receiver.tangents_at(point[0], point[1])
        normalise(direction)
        return Rays(self._receiver.shape, direction.T, pixel, weight, side)

    def _place(self, sides: np.ndarray, allowed: np.ndarray, narrow: float) -> None:
        """Place the rays of some pixels of the window; the parameters are those of `line_rays.place_rays`."""
        error, (rows, cols) = self._receiver.sampling_error, self._window
        point, pixel, weight, side, kind, change, known = place_rays(
            *self._pieces,
            packed(sides),
            rows.start,
            cols.start,
            self._receiver.n_cols,
            packed(allowed),
            error if self._receiver.rays_per_pixel is not None else _ROUGH * error,  # a grid has one round
            min(narrow * error, _NARROWEST),
            _STEEP * error,
            self._receiver.psf is None,  # a lens spreads light from where rays are: even light stays even
        )
        self._follows, self._point = (kind, change), point
        self._variance = np.zeros(self._receiver.shape)
        self._variance[self._window] = known
        self.rays = self._aim(point, pixel, weight, side)

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
        light = np.zeros(len(rays.pixel))
        light[hits.ray] = photons
        is_unexpected = self._find_unexpected(hits)
        variance, (seen, total) = self._variance, np.zeros((2, *self._variance.shape))
        correct_variance(
            packed(rays.pixel),
            packed(rays.weight),
            *self._follows,
            light,
            is_unexpected,
            variance.reshape(-1),
            seen.reshape(-1),
            total.reshape(-1),
            (_PER_STEP, _PER_TEXTURE, _PER_TWIST, _PER_UNEXPECTED),
        )
        hits = replace(hits, photons_variance=variance)
        if before is not None:
            return _replace_pixels(before, hits), False
        if self._receiver.rays_per_pixel is not None:
            return hits, False
        doubted = np.zeros(self._receiver.shape, np.bool_)
        doubted.flat[rays.pixel[is_unexpected]] = True
        self._is_crossed |= doubted[self._window]
        allowed = self._find_missed(variance[self._window], total[self._window])
        if not allowed.any():
            return hits, False
        allowed /= np.maximum(seen[self._window], 1e-3)
        doubted = doubted[self._window] & (allowed > 0.0)
        again = np.where(allowed > 0.0, self._sides, 0)
        if doubted.any():  # here the probes were wrong, and all contours count
            distrust_fronts(self._fronts, self._per_side, doubted)
            self._cut(again)
        self._place(again, allowed, _NARROW_AGAIN)
        return hits, True

    def _find_unexpected(self, hits: Hits) -> np.ndarray:
        """Find the rays (ray) that meet what should be hidden."""
        rows, cols = self._window
        depth_m = hits.range_m * self.rays.direction[hits.ray, 2]
        place = rows.start, cols.start
        return find_unexpected(packed(self._point), packed(hits.ray), depth_m, *place, self._fronts, self._per_side)

    def _find_missed(self, variance: np.ndarray, photons: np.ndarray) -> np.ndarray:
        """Choose the pixels of the second round; return the variance (row, col) that each may have, 0 for all others.

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


@kernel
def correct_variance(
    pixel: np.ndarray,
    weight: np.ndarray,
    kind: np.ndarray,
    change: np.ndarray,
    light: np.ndarray,
    is_unexpected: np.ndarray,
    variance: np.ndarray,
    seen: np.ndarray,
    photons: np.ndarray,
    calibration: tuple[float, float, float, float],
) -> None:
    """Correct the variance of pixels by what their rays met.

    A hidden contour changes nothing: the variance due to contours is multiplied by the squared changes of light that were
    met from line to line, over those that were expected; in pixels of one line, by those along the line. In pixels
    without contours, differences of light between rays and lines are added. Where a ray meets what should be hidden, the
    contours of that were left out, and the light of the ray is known badly.

    Parameters
    ----------
    pixel, weight, kind, change : (ray) as `line_rays.place_rays` returns them
    light : (ray) photons of a whole pixel that is as bright as the ray's hit
    is_unexpected : (ray) whether it meets what should be hidden
    variance : (pixel), changed
    seen, photons : (pixel), written: by what the variance due to contours was multiplied, and the pixel's photons
    calibration : variance over what is expected, over squared differences of neighbours, over the squared twist of four
        rays, and over the squared light of rays that meet what should be hidden
    """
    per_step, per_texture, per_twist, per_unexpected = calibration
    n, i = len(pixel), 0
    while i < n:
        first, total, uneven = i, 0.0, 0.0
        met, expected, met_along, expected_along = 0.0, 0.0, 0.0, 0.0
        before, is_textured = -1.0, False
        while i < n and pixel[i] == pixel[first]:
            start, photons_of_line, height = i, 0.0, 0.0
            while i < n and pixel[i] == pixel[first] and (i == start or kind[i] != LINE):
                photons_of_line += weight[i] * light[i]
                height += weight[i]
                if is_unexpected[i]:
                    uneven += per_unexpected * (weight[i] * light[i]) ** 2
                if kind[i] == CONTOUR:
                    met_along += (light[i] - light[i - 1]) ** 2
                    expected_along += change[i] ** 2
                elif kind[i] == TEXTURE:
                    uneven += per_texture * (weight[i] * (light[i] - light[i - 1])) ** 2
                    is_textured = True
                i += 1
            mean = photons_of_line / height
            if before >= 0.0:
                if change[start] > 0.0:
                    met += (mean - before) ** 2
                    expected += change[start] ** 2
                elif change[start] == 0.0 and is_textured:
                    uneven += ((mean - before) * height) ** 2 / 12.0
            total += photons_of_line
            before = mean
        if i - first == 4 and kind[first + 1] == PAIR and kind[first + 3] == PAIR:
            twist = light[first] - light[first + 1] - light[first + 2] + light[first + 3]
            uneven += per_twist * (weight[first] * twist) ** 2
        if expected == 0.0:
            met, expected = met_along, expected_along
        share = per_step * (min(met / expected, _BRIGHTER) if expected > 0.0 else 1.0)
        seen[pixel[first]], photons[pixel[first]] = share, total
        variance[pixel[first]] = share * variance[pixel[first]] + uneven


def _replace_pixels(hits: Hits, finer: Hits) -> Hits:
    """Replace the hits of pixels that were sampled again."""
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
    columns_of_rays = (
        join(getattr(hits.rays, name), getattr(finer.rays, name), of_rays) for name in ("pixel", "weight", "side")
    )
    place = np.zeros(len(hits.rays.pixel) + len(finer.rays.pixel), np.int32)
    place[of_rays] = np.arange(len(of_rays))
    columns: dict[str, Any] = {
        name: join(getattr(hits, name), getattr(finer, name), of_hits)
        for name, spec in specs(Hits).items()
        if spec.dims == ("hit",) and getattr(hits, name) is not None
    }
    columns["ray"] = place[join(hits.ray, finer.ray + np.int32(len(hits.rays.pixel)), of_hits)]
    columns["photons_variance"] = np.where(
        is_finer, np.asarray(finer.photons_variance), np.asarray(hits.photons_variance)
    )
    return Hits(Rays(hits.rays.shape, direction.T, *columns_of_rays), **columns)


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


@kernel
def normalise(direction: np.ndarray) -> None:
    """Turn x and y (xyz, ray) of directions (x, y, 1) into unit vectors, in place."""
    x, y, z = direction[0], direction[1], direction[2]
    for m in range(direction.shape[1]):
        z[m] = 1.0 / math.sqrt(1.0 + x[m] * x[m] + y[m] * y[m])
        x[m] *= z[m]
        y[m] *= z[m]


def _rays_per_side(receiver: Receiver, laser: Laser, textures: np.ndarray) -> np.ndarray:
    """Return the number of rays (target) along the side of a pixel that no contour crosses.

    N rays through n cells of even light of different brightness, with a relative spread c, have the relative error
    0.54 c n^(1/4) / N^(3/4): the error of the area within an outline on a lattice (0.0724 u³ for each unit of length, with
    the spacing u; Matérn 1989), for the outlines of all cells.
    """
    if receiver.rays_per_pixel is not None:
        return np.full(len(textures), receiver.rays_per_side, np.int64)
    # A lens spreads light from where rays are, and the light of a Gaussian beam bends within a pixel.
    is_bent = laser.footprint == "gaussian" and laser.half_width_tangent < _WIDE * receiver.pixel_tangent
    least = 2 if receiver.psf is None and not is_bent else 4
    if laser.offset is not None:  # its shadows have no contours: 0.27 / N^(3/4) of a pixel, over half of it
        least = max(least, math.ceil((0.54 / receiver.sampling_error) ** (2.0 / 3.0)))
    if laser.footprint == "pattern":
        least = max(least, min(math.ceil(2.0 * receiver.pixel_tangent / laser.cell_tangent), _MOST_PER_SIDE))
    cells = (receiver.pixel_tangent / textures) ** 2
    rays = (_ERROR_OF_CELLS * _CONTRAST / receiver.sampling_error) ** (4.0 / 3.0) * np.cbrt(cells)
    return packed(np.clip(np.ceil(np.sqrt(rays)), least, _MOST_PER_SIDE).astype(np.int64))


def find_small(receiver: Receiver, extent: Extent) -> np.ndarray:
    """Find the targets whose contours cut the lines of rays.

    These are all targets, unless the receiver has a fixed grid. Then they are those whose bounds get fewer rays of the grid
    than `Receiver.min_rays_per_target`.

    Parameters
    ----------
    receiver : decides how rays sample its pixels
    extent : where targets can be

    Returns
    -------
    Whether the contours of each target count (target).
    """
    if receiver.rays_per_pixel is None:
        return np.ones(len(extent.low), np.bool_)
    sides = np.maximum(extent.high - extent.low, 0.0) / receiver.pixel_tangent
    few: np.ndarray = sides.prod(axis=1) * receiver.rays_per_pixel < receiver.min_rays_per_target
    return few


def find_pixels(receiver: Receiver, extent: Extent) -> np.ndarray:
    """Find the pixels that a target's bounds may touch.

    Parameters
    ----------
    receiver : the lens and the focal plane
    extent : where targets can be

    Returns
    -------
    Numbers of the pixels (pixel), row * n_cols + col, ascending.
    """
    bounds, outlines = image_bounds(receiver, extent, np.inf), image_outlines(receiver, extent)
    touched, top, left = cover_pixels(bounds, *outlines, packed(np.ones(len(extent.low), np.int64)), *receiver.shape)
    row, col = np.nonzero(touched)
    pixels: np.ndarray = (row + top) * receiver.n_cols + col + left
    return pixels


def pixel_rays(receiver: Receiver, laser: Laser, extent: Extent) -> Rays:
    """Make a fixed grid of rays, k x k through each pixel that a target's bounds may touch.

    A ray's weight is its share of the pixel's area. From k = 3 on, no two rays of a pixel lie at the same row or column of
    the focal plane, so that an edge along either cuts them at different places. Behind a lens with a PSF they lie in the
    middle of their cells. Pixels outside the laser's footprint get no rays, unless the laser is beside the lens or sunlight
    is simulated. The edge of a beam cuts the lines that cross it.

    Parameters
    ----------
    receiver : the lens and the focal plane; k² is `rays_per_pixel`, or 16
    laser : gives the footprint
    extent : where targets can be

    Returns
    -------
    Rays ordered by pixel.
    """
    grid = receiver.replace(rays_per_pixel=receiver.rays_per_side**2)
    none = Contours(np.empty((0, 4)), np.empty(0), np.empty((0, 2)), np.empty(0, np.int16))
    return ScanLines(grid, laser, extent, none, np.full(len(extent.low), np.inf)).rays
