"""Rays through the pixels: only those that can hit a target and are lit."""

import math
from functools import lru_cache

import numpy as np

from rso_lidar.kernels import packed
from rso_lidar.optics.laser import Laser
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
    boxes = boxes_in_cells(receiver, extent, np.inf, k)
    fineness = find_fineness(boxes, receiver.min_rays_per_target)
    if laser.footprint != "gaussian" and laser.offset is None and receiver.filter_width_nm is None:
        # One cell more than is lit: the edge's cells keep a share even where their centre is dark.
        boxes = boxes_in_cells(receiver, extent, laser.half_width_tangent + receiver.pixel_tangent / k, k)
    targets = boxes, packed(fineness), *outlines_in_cells(receiver, extent, k)
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
    """Make the rays of a window of cells and of parts of cells; return direction (ray, xyz), pixel and weight, by pixel.

    Parameters
    ----------
    owner, first_row, first_col, single : as `coverage.find_owners` returns them
    blocks, marks : as `coverage.mark_parts` returns them
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


def clip_to_beam(
    direction: np.ndarray, pixel: np.ndarray, weight: np.ndarray, laser: Laser, receiver: Receiver
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Keep the rays inside a footprint with an edge, and for sunlight those outside as well.

    A cell that the edge cuts keeps the share of its area that is lit, and its ray goes through the middle of that
    share. A narrow beam therefore loses no energy to the grid. For sunlight the rest of the cell gets a ray of its own,
    through the cell's farthest corner.

    Parameters
    ----------
    direction, pixel, weight : rays, as in `Rays`
    laser : a laser at the lens, with a footprint that has an edge
    receiver : gives the size of the cells

    Returns
    -------
    Direction, pixel and weight of the rays that are left.
    """
    half_field = float(receiver.field_edge.max())
    circle, reach = laser.footprint == "circle", laser.half_width_tangent
    if half_field * (math.sqrt(2.0) if circle else 1.0) <= reach * (1.0 + 1e-12):
        return direction, pixel, weight
    x, y = direction[:, 0] / direction[:, 2], direction[:, 1] / direction[:, 2]
    half_cell = 0.5 * np.sqrt(weight) * receiver.pixel_tangent
    if receiver.distortion is not None:
        half_cell *= np.sqrt(receiver.distortion.area_at_direction(x, y))
    farthest = [np.abs(v) + (1.0 - 1e-6) * half_cell for v in (x, y)]
    share, x, y = _clip_to_circle(x, y, half_cell, reach) if circle else _clip_to_square(x, y, half_cell, reach)
    kept = np.flatnonzero(share > 1e-9)  # less is rounding
    lit = _unit_vectors(x[kept], y[kept]), pixel[kept], weight[kept] * share[kept]
    if receiver.filter_width_nm is None:
        return lit
    rest = np.flatnonzero(share < 1.0 - 1e-9)
    cut = share[rest] > 1e-9
    unlit = _select(direction, rest)
    unlit[cut] = _unit_vectors(*(np.copysign(farthest[axis][rest[cut]], unlit[cut, axis]) for axis in (0, 1)))
    dark = unlit, pixel[rest], weight[rest] * (1.0 - np.where(cut, share[rest], 0.0))
    direction, pixel, weight = (np.concatenate(column) for column in zip(lit, dark, strict=True))
    order = np.argsort(pixel, kind="stable")
    return _select(direction, order), pixel[order], weight[order]


def _clip_to_square(x: np.ndarray, y: np.ndarray, half_cell: np.ndarray, reach: float) -> tuple[np.ndarray, ...]:
    """Return the lit share of square cells about (x, y), and the middle of that share; exact.

    Parameters
    ----------
    x, y, half_cell : (cell) middle and half the side, in the tangent plane
    """
    (left, right), (top, bottom) = (
        (np.maximum(v - half_cell, -reach), np.minimum(v + half_cell, reach)) for v in (x, y)
    )
    share = np.maximum(right - left, 0.0) * np.maximum(bottom - top, 0.0) / (2.0 * half_cell) ** 2
    return share, 0.5 * (left + right), 0.5 * (top + bottom)


def _clip_to_circle(x: np.ndarray, y: np.ndarray, half_cell: np.ndarray, reach: float) -> tuple[np.ndarray, ...]:
    """Return the lit share of square cells about (x, y), and the middle of that share, from 32 x 32 points of each.

    Parameters
    ----------
    x, y, half_cell : (cell) middle and half the side, in the tangent plane
    """
    radius, half_diagonal = np.hypot(x, y), math.sqrt(2.0) * half_cell
    share = (radius < reach).astype(float)
    # 1024 points give a share to some 1e-3, and the errors of many cells cancel.
    edge = np.flatnonzero(np.abs(radius - reach) <= half_diagonal)
    offset = (np.arange(32) + 0.5) / 16.0 - 1.0
    x, y = x.copy(), y.copy()
    for some in np.array_split(edge, 1 + len(edge) // 2048):
        across = x[some, None, None] + half_cell[some, None, None] * offset
        down = y[some, None, None] + half_cell[some, None, None] * offset[:, None]
        inside = across**2 + down**2 <= reach**2
        count = np.maximum(inside.sum(axis=(1, 2)), 1)
        share[some] = inside.mean(axis=(1, 2))
        x[some] = (across * inside).sum(axis=(1, 2)) / count
        y[some] = (down * inside).sum(axis=(1, 2)) / count
    return share, x, y


def _unit_vectors(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the unit vectors (ray, xyz) of directions (x, y, 1)."""
    direction = np.empty((x.size, 3), order="F")  # x, y and z each contiguous, as casting needs them
    direction[:, 2] = 1.0 / np.sqrt(1.0 + x * x + y * y)
    direction[:, 0] = x * direction[:, 2]
    direction[:, 1] = y * direction[:, 2]
    return direction


def _select(direction: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Return some of the directions, with x, y and z each contiguous."""
    taken = np.empty((len(chosen), 3), order="F")
    for axis in range(3):
        np.take(direction[:, axis], chosen, out=taken[:, axis], mode="clip")
    return taken
