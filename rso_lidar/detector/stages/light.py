"""The work of `waveform` as loops: one pass over the returns for the rows, one for their light, one over what is lit."""

import math

import numpy as np

from rso_lidar.arithmetic import loop
from rso_lidar.detector.waveform import MOST_PIECES


@loop
def rows_of(
    pixel: np.ndarray,
    delay_s: np.ndarray,
    photons: np.ndarray,
    depth_spread_s: np.ndarray,
    timing_s: tuple[float, float, float, float, float],
    steps: tuple[int, int, int],
    enough: tuple[float, float],
    made: np.ndarray,
) -> int:
    """Return how many rows there are, written to pixel, start and first of `made` (3, row); -1 where they do not fit.

    Parameters
    ----------
    timing_s : lateness, longest half depth, rise, fall, step.
    steps : steps to a sample, before a latch, watched.
    enough : least photons of a pixel that has rows; photons of a row after which there is no other.
    """
    late_s, longest_s, rise_s, fall_s, step_s = timing_s
    per_sample, before, watched_steps = steps
    least_photons, sure_photons = enough
    n_rows, first, n = 0, 0, len(pixel)
    while first < n:
        end, total = first, 0.0
        while end < n and pixel[end] == pixel[first]:
            total += photons[end]
            end += 1
        covered_s = -math.inf
        more = total > least_photons
        while more:
            begin_s = math.inf
            for k in range(first, end):
                half_s = min(0.5 * depth_spread_s[k], longest_s)
                at_s = delay_s[k] + late_s
                if photons[k] > 0.0 and at_s + half_s + fall_s > covered_s:
                    begin_s = min(begin_s, at_s - half_s - rise_s)
            if begin_s == math.inf:
                break
            if n_rows == made.shape[1]:
                return -1
            begin = math.floor(max(begin_s, covered_s) / step_s + 1e-9)
            watched = begin // per_sample * per_sample  # rows begin on a sample, so that samples fall on steps
            made[0, n_rows], made[1, n_rows], made[2, n_rows] = pixel[first], watched - before, begin - watched + before
            if begin_s <= covered_s:  # goes on from the last step that was watched
                made[2, n_rows] -= 1
            n_rows += 1
            ends_s = (watched + watched_steps) * step_s
            more, light = False, 0.0
            for k in range(first, end):
                to_s = delay_s[k] + late_s + min(0.5 * depth_spread_s[k], longest_s) + fall_s
                if photons[k] > 0.0 and to_s > ends_s:
                    more = True
                elif photons[k] > 0.0 and to_s > covered_s:
                    light += photons[k]
            more = more and light <= sure_photons
            covered_s = ends_s
        first = end
    return n_rows


@loop
def shared(
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
    """Add each return to the steps of its pixel's rows in `grid`, by cubic interpolation; none begins after step `last`."""
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


@loop
def laid(
    light: np.ndarray,
    pulse: np.ndarray,
    amplified: np.ndarray,
    least: np.float32,
    primaries: np.ndarray,
    amplitude: np.ndarray,
) -> None:
    """Lay two responses (twice around the circle) over the light of each row; `primaries` below `least` count as none."""
    n_rows, n = light.shape
    for row in range(n_rows):
        expected, mean = primaries[row], amplitude[row]
        expected[:] = 0.0
        mean[:] = 0.0
        for lit in range(n):
            photons = light[row, lit]
            if photons != 0.0:
                from_pulse, from_amplified = pulse[n - lit : 2 * n - lit], amplified[n - lit : 2 * n - lit]
                for step in range(n):
                    expected[step] += photons * from_pulse[step]
                    mean[step] += photons * from_amplified[step]
        for step in range(n):
            if expected[step] < least:
                expected[step] = 0.0
