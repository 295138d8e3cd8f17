"""Expected photons on the axis of time: returns of a pixel add before anything detects them."""

import math

import numpy as np

from rso_lidar.detector.stages.time_axis import Rows
from rso_lidar.kernels import kernel, packed
from rso_lidar.records import Photons

WIDEST = 1.5  # steps: a return of a deeper facet is cut into several ...
MOST_PIECES = 4096  # ... and at most into this number


def spread_light(photons: Photons, rows: Rows, step_s: float, factors: np.ndarray | None = None) -> np.ndarray:
    """Return the expected photons (row, step), float32, as if each return were a flash of no length at its delay.

    Parameters
    ----------
    rows : stretches of time to fill, all rows of some pixels
    factors : (return) multiply the photons, where given
    """
    grid = np.zeros((len(rows.pixel), rows.length), np.float32)
    if not len(grid):
        return grid
    ends = rows.pixel[[0, -1]].astype(photons.pixel.dtype)
    some = slice(np.searchsorted(photons.pixel, ends[0]), np.searchsorted(photons.pixel, ends[1], "right"))
    weight = photons.photons[some] if factors is None else photons.photons[some] * factors[some]
    last = rows.length - 3 - rows.room
    share_returns(
        packed(photons.pixel[some]),
        packed(photons.delay_s[some]),
        packed(weight),
        packed(photons.depth_spread_s[some]),
        float(photons.late_s),
        step_s,
        WIDEST,
        rows.pixel,
        rows.start,
        last,
        grid,
    )
    return grid


@kernel
def share_returns(
    pixel: np.ndarray,
    delay_s: np.ndarray,
    photons: np.ndarray,
    depth_spread_s: np.ndarray,
    late_s: float,
    step_s: float,
    widest: float,
    row_pixel: np.ndarray,
    row_start: np.ndarray,
    last: int,
    grid: np.ndarray,
) -> None:
    """Add each return to the steps of its pixel's rows, by cubic interpolation.

    Parameters
    ----------
    pixel, delay_s, photons, depth_spread_s : (return) those of `Photons`
    widest : steps; a deeper return is cut into several
    row_pixel, row_start : (row) those of `Rows`
    grid : (row, step) expected photons, added to
    """
    n_rows, row, steps_per_s, last = len(row_pixel), 0, 1.0 / step_s, min(last, grid.shape[1] - 3)
    for k in range(len(pixel)):
        while row < n_rows and row_pixel[row] < pixel[k]:
            row += 1
        if row == n_rows:
            break
        depth, sixth, pieces = depth_spread_s[k] * steps_per_s, photons[k] * (1.0 / 6.0), 1
        if depth > widest:
            pieces = min(math.ceil(depth / widest), MOST_PIECES)
            depth /= pieces
            sixth /= pieces
        variance = depth * depth * (1.0 / 12.0)
        centre = (delay_s[k] + late_s) * steps_per_s
        of = row
        while of < n_rows and row_pixel[of] == pixel[k]:
            for piece in range(pieces):
                at = centre + (piece - 0.5 * (pieces - 1)) * depth - row_start[of]
                below = math.floor(at)
                if below < 1.0 or below > last:
                    continue
                x1 = at - below
                x2 = x1 * x1 + variance
                x3 = x1 * (x2 + 2.0 * variance)
                step = int(below)
                grid[of, step - 1] += np.float32(sixth * (3.0 * x2 - x3 - 2.0 * x1))
                grid[of, step] += np.float32(sixth * (3.0 * (x3 - 2.0 * x2 - x1) + 6.0))
                grid[of, step + 1] += np.float32(sixth * (3.0 * (x2 - x3) + 6.0 * x1))
                grid[of, step + 2] += np.float32(sixth * (x3 - x1))
            of += 1


def share_sixths(x1: np.ndarray, x2: np.ndarray, x3: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return six times the shares of steps -1, 0, 1 and 2 in a return at x.

    The weights are those of cubic interpolation. Sum, mean, variance and third moment are exact. The remaining error is of
    fourth order: 2e-4 of the peak for a step of a quarter of the pulse's sigma.
    """
    return 3.0 * x2 - x3 - 2.0 * x1, 3.0 * (x3 - 2.0 * x2 - x1) + 6.0, 3.0 * (x2 - x3) + 6.0 * x1, x3 - x1


def sharing_response(n: int) -> np.ndarray:
    """Return what sharing returns among steps does to each frequency of a transform of `n` steps, over all places.

    Dividing by it leaves only what differs from place to place within a step. It is cut where it is far from 1, beyond
    what a pulse holds.
    """
    cycles = np.fft.rfftfreq(n)[:, None]
    place = (np.arange(32) + 0.5) / 32.0
    weights = np.stack(share_sixths(place, place**2, place**3)) / 6.0
    turned = [w * np.exp(-2j * math.pi * cycles * (k - 1 - place)) for k, w in enumerate(weights)]
    response: np.ndarray = np.maximum(np.sum(turned, axis=0).mean(axis=1).real, 0.5)
    return response
