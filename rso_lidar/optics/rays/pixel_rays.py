"""Rays through the pixels: only those that can hit a target and are lit."""

from functools import lru_cache

import numpy as np

from rso_lidar.kernels import packed
from rso_lidar.optics.laser import Laser
from rso_lidar.optics.rays.beam_edge import clip_to_beam
from rso_lidar.optics.rays.cells import boxes_in_cells, outlines_in_cells, tangents_of_cells
from rso_lidar.optics.rays.coverage import find_fineness, find_owners, mark_parts
from rso_lidar.optics.rays.ray_grid import make_rays, normalise
from rso_lidar.optics.receiver import Receiver
from rso_lidar.records import Extent, Rays

_NO_BLOCKS = packed(np.empty((0, 7), np.int64)), packed(np.empty(0, np.int16))


def pixel_rays(receiver: Receiver, laser: Laser, extent: Extent) -> Rays:
    """Make the rays of one flash, through the cells of each pixel's k x k grid that a target's bounds touch.

    A target that would get fewer than `min_rays_per_target` rays has its cells refined m x m; only the rays inside its
    bounds are made. A ray's weight is its share of the pixel's area, 1/k² or 1/(k m)², and does not depend on
    its neighbours. Cells are even in the image, so a lens with distortion bends the rays. Rays that the laser does not
    light are left out, unless the laser is beside the lens or sunlight is simulated.

    Parameters
    ----------
    receiver : the lens and the focal plane
    laser : gives the footprint
    extent : where targets can be

    Returns
    -------
    Rays ordered by pixel.
    """
    k, shape = receiver.rays_per_side, receiver.shape
    boxes = boxes_in_cells(receiver, extent, np.inf)
    fineness = find_fineness(boxes, receiver.min_rays_per_target)
    if laser.footprint != "gaussian" and laser.offset is None and receiver.filter_width_nm is None:
        # One cell more than is lit: the edge's cells keep a share even where their centre is dark.
        boxes = boxes_in_cells(receiver, extent, laser.half_width_tangent + receiver.pixel_tangent / k)
    targets = boxes, packed(fineness), *outlines_in_cells(receiver, extent)
    owner, first_row, first_col, single = find_owners(*targets, k, *shape)
    owner = packed(owner)
    if single == shape[0] * shape[1] * k * k:
        direction, pixel, weight = _full_grid(receiver)
    else:
        parts = (
            mark_parts(*targets, owner, first_row, first_col, k, *shape) if fineness.max(initial=1) > 1 else _NO_BLOCKS
        )
        direction, pixel, weight = _rays(receiver, owner, first_row, first_col, single, *parts)
    if laser.footprint != "gaussian" and laser.offset is None:
        direction, pixel, weight = clip_to_beam(direction, pixel, weight, laser, receiver)
    return Rays(shape, direction, pixel, weight)


def _rays(
    receiver: Receiver,
    owner: np.ndarray,
    first_row: int,
    first_col: int,
    single: int,
    blocks: np.ndarray,
    marks: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Make the rays of a window of cells and of parts of cells.

    Parameters
    ----------
    owner, first_row, first_col, single : as `coverage.find_owners` returns them
    blocks, marks : as `coverage.mark_parts` returns them

    Returns
    -------
    Direction (ray, xyz), pixel and weight, by pixel.
    """
    k, shape, is_bent = receiver.rays_per_side, receiver.shape, receiver.distortion is not None
    x, y = tangents_of_cells(receiver, (first_row, first_row + owner.shape[0]))
    cells = owner, first_row, first_col, single, packed(blocks), packed(marks)
    direction, pixel, weight, fine = make_rays(*cells, k, *shape, x, y, receiver.pixel_tangent, is_bent)
    if is_bent:
        direction[0, fine], direction[1, fine] = receiver.tangents_at(direction[0, fine], direction[1, fine])
        normalise(direction)
    return direction.T, pixel, weight


@lru_cache(maxsize=2)
def _full_grid(receiver: Receiver) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return direction (ray, xyz), pixel and weight of the rays through all cells."""
    n_rows, n_cols = (size * receiver.rays_per_side for size in receiver.shape)
    arrays = _rays(receiver, packed(np.zeros((n_rows, n_cols), np.int16)), 0, 0, n_rows * n_cols, *_NO_BLOCKS)
    for values in arrays:
        values.flags.writeable = False
    return arrays
