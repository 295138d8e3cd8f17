"""The edge of the laser's beam: rays inside a footprint, and the lit share of cells that its edge cuts."""

import math

import numpy as np

from rso_lidar.optics.laser import Laser
from rso_lidar.optics.receiver import Receiver


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
