"""Line sampling: the rays of one flash along scan lines that contours cut, and the error that they leave."""

import math
from dataclasses import dataclass, replace

import numpy as np

from rso_lidar.kernels import packed
from rso_lidar.optics.laser import Laser
from rso_lidar.optics.rays.cells import boxes_in_cells, outlines_in_cells
from rso_lidar.optics.rays.contour_images import GAUSSIAN_REACH, cut_contours, image_contours
from rso_lidar.optics.rays.coverage import find_owners
from rso_lidar.optics.rays.ray_grid import normalise
from rso_lidar.optics.rays.slabs import correct_variance, place_rays
from rso_lidar.optics.receiver import Receiver
from rso_lidar.records import Contours, Extent, Hits, Rays

_AIM = 8.0  # error of a pixel if none of its contours were hidden, over the error asked for
_NARROW = 3.0  # width of intervals that share a ray, over the error asked for
_STEEP = 2.5  # width of a contour whose ends count, over the error asked for
_PER_STEP, _PER_TEXTURE, _PER_TWIST = 0.5, 0.15, 0.1
_MOST_PER_SIDE = 32
_ERROR_OF_CELLS = 0.54
_CONTRAST = 2.0  # assumed: spread of the light of cells of foil, over its mean


@dataclass(frozen=True, eq=False)
class ScanLines:
    """Rays along scan lines, and what is known of their error before they are cast.

    Attributes
    ----------
    rays : the rays, pixel by pixel and line by line
    jump : (ray), how each follows the one before, as in `slabs`
    variance : (row, col), variance of the pixels' photons if no contour is hidden
    """

    rays: Rays
    jump: np.ndarray
    variance: np.ndarray

    def estimate_variance(self, hits: Hits, photons: np.ndarray) -> Hits:
        """Return hits with the variance of each pixel's photons that sampling leaves.

        Parameters
        ----------
        hits : hits of the rays
        photons : (hit) expected photons of a whole pixel that is as bright as the hit
        """
        light = np.zeros(len(self.jump))
        light[hits.ray] = photons
        variance, rays = self.variance.copy(), self.rays
        correct_variance(
            packed(rays.pixel),
            packed(rays.weight),
            self.jump,
            light,
            variance.reshape(-1),
            _PER_STEP,
            _PER_TEXTURE,
            _PER_TWIST,
        )
        return replace(hits, photons_variance=variance)


def lay_scan_lines(
    receiver: Receiver, laser: Laser, extent: Extent, contours: Contours, textures: np.ndarray
) -> ScanLines:
    """Lay scan lines through the pixels that targets may touch, and place one ray in each interval between contours.

    Parameters
    ----------
    receiver, laser : the instrument
    extent, contours : where targets and their contours are in the tangent plane
    textures : (target) size of the cells of crinkled foil in the tangent plane; infinite for facets without a texture
    """
    (n_rows, n_cols), error = receiver.shape, receiver.sampling_error
    reach = np.inf
    if laser.offset is None and receiver.filter_width_nm is None:
        reach = laser.half_width_tangent * (GAUSSIAN_REACH if laser.footprint == "gaussian" else 1.0)
    boxes, outlines = boxes_in_cells(receiver, extent, reach, 1), outlines_in_cells(receiver, extent, 1)
    least, per_side = _rays_per_side(receiver, laser, textures)
    owner, top, left, _ = find_owners(boxes, per_side // least, *outlines, 1, n_rows, n_cols)
    height, width = owner.shape
    starts, pieces, steps = cut_contours(
        *image_contours(receiver, laser, contours), (top, top + height, left, left + width)
    )
    is_crossed = (np.diff(starts) > 0).reshape(height, width)
    sides = np.where((owner == 0) | is_crossed, least, 0)
    sides[owner > 0] = per_side[owner[owner > 0] - 1]
    point, pixel, weight, jump, known = place_rays(
        starts,
        pieces,
        steps,
        packed(sides),
        top,
        left,
        n_cols,
        _AIM * error,
        min(_NARROW * error, 0.125),
        _STEEP * error,
    )
    direction = np.empty((3, len(pixel)))
    direction[0], direction[1] = receiver.tangents_at(point[0], point[1])
    normalise(direction)
    variance = np.zeros(receiver.shape)
    variance[top : top + height, left : left + width] = known
    return ScanLines(Rays(receiver.shape, direction.T, pixel, weight), jump, variance)


def _rays_per_side(receiver: Receiver, laser: Laser, textures: np.ndarray) -> tuple[int, np.ndarray]:
    """Return the number of rays along the side of a pixel that no contour crosses, in general and for each target.

    N rays through n cells of even light of different brightness, with a relative spread c, have the relative error
    0.54 c n^(1/4) / N^(3/4): the error of the area within an outline on a lattice (0.0724 u³ for each unit of length, with
    the spacing u; Matérn 1989), for the outlines of all cells.
    """
    least = 2 if laser.offset is None else 4  # shadows of a laser beside the lens have no contours
    if laser.footprint == "pattern":
        least = max(least, math.ceil(2.0 * receiver.pixel_tangent / laser.cell_tangent))
    cells = (receiver.pixel_tangent / textures) ** 2
    rays = (_ERROR_OF_CELLS * _CONTRAST / receiver.sampling_error) ** (4.0 / 3.0) * np.cbrt(cells)
    return least, packed(np.clip(np.ceil(np.sqrt(rays)), least, _MOST_PER_SIDE).astype(np.int64))
