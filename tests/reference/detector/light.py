"""Light on the axis of time in NumPy: the oracle of `rso_lidar.detector.stages.light`."""

import numpy as np

from rso_lidar.detector.stages.light import MOST_PIECES, WIDEST, share_sixths
from rso_lidar.detector.stages.time_axis import Rows
from rso_lidar.records import Photons

_AT_ONCE = 32_768  # returns, so that what is worked on stays in the cache


def spread_light(photons: Photons, rows: Rows, step_s: float, factors: np.ndarray | None = None) -> np.ndarray:
    """Return the expected photons (row, step), float32, as if each return were a flash of no length at its delay."""
    weight = photons.photons if factors is None else photons.photons * factors
    centre = (photons.delay_s + photons.late_s) / step_s
    spread = photons.depth_spread_s / step_s
    pixel = photons.pixel
    deep = np.flatnonzero(spread > WIDEST)
    if len(deep):
        weight, centre, spread, pixel = _cut(weight, centre, spread, pixel, deep)
    n_pixels = photons.shape[0] * photons.shape[1]
    count = np.bincount(rows.pixel, minlength=n_pixels)
    first = np.cumsum(count) - count
    grid = np.zeros(len(rows.pixel) * rows.length, np.float32)
    for piece in range(0, len(pixel), _AT_ONCE):
        part = slice(piece, piece + _AT_ONCE)
        some = pixel[part]
        for k in range(int(count[some].max())):
            of = part if k == 0 and count[some].all() else piece + np.flatnonzero(count[pixel[part]] > k)
            row = first[pixel[of]] + k
            _share(grid, weight[of], centre[of] - rows.start[row], spread[of], row * rows.length, rows)
    return grid.reshape(-1, rows.length)


def _cut(
    weight: np.ndarray, centre: np.ndarray, spread: np.ndarray, pixel: np.ndarray, deep: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Return the returns with those that are deeper than a few steps cut into equal pieces, put at the end."""
    pieces = np.minimum(np.ceil(spread[deep] / WIDEST), MOST_PIECES).astype(np.int64)
    of = np.repeat(deep, pieces)
    number = np.arange(len(of)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    pieces = np.repeat(pieces, pieces)
    piece = spread[of] / pieces
    whole = weight.copy()
    whole[deep] = 0.0
    return (
        np.concatenate([whole, weight[of] / pieces]),
        np.concatenate([centre, centre[of] + (number - 0.5 * (pieces - 1)) * piece]),
        np.concatenate([spread, piece]),
        np.concatenate([pixel, pixel[of]]),
    )


def _share(
    grid: np.ndarray, weight: np.ndarray, at: np.ndarray, spread: np.ndarray, offset: np.ndarray, rows: Rows
) -> None:
    """Add returns at steps `at` of their rows to the grid: cubic interpolation's weights, averaged over their depth."""
    below = np.floor(at)
    inside = (below >= 1.0) & (below < rows.length - 2 - rows.room)
    if not inside.all():
        weight, below, at = (
            np.where(inside, value, other) for value, other in ((weight, 0.0), (below, 1.0), (at, 1.0))
        )
    x1 = at - below
    variance = spread * spread * (1.0 / 12.0)
    x2 = x1 * x1 + variance
    x3 = x1 * (x2 + 2.0 * variance)
    index = offset + below.astype(np.int64)
    run = np.flatnonzero(np.diff(index, prepend=-1))  # neighbours in a pixel often share their steps
    if not len(run):
        return
    cell = index[run]
    sixth = weight * (1.0 / 6.0)
    for step, share in enumerate(share_sixths(x1, x2, x3), -1):
        np.add.at(grid, cell + step, np.add.reduceat(sixth * share, run).astype(np.float32))
