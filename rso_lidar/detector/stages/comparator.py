"""The comparator of a pixel: a Schmitt trigger that latches on the first crossing, true or false.

Everywhere `amplitude` (row, step) and `threshold` (row) are in electrons. `first` and `last` (row) are the steps from which,
and before which, the comparator is watched.
"""

import math

import numpy as np

from rso_lidar.kernels import kernel, packed

NEVER = -1
NEAR = -2  # not at a step, perhaps between two


class Bridge:
    """What filtered noise does between two steps, given the steps, so that no result depends on the step's length.

    Between steps the noise is its best estimate from the four steps around, by kriging with the autocorrelation of the
    two-pole amplifier. To that comes a Gaussian rest, which the steps do not determine, drawn at fifteen points. The mean
    is smooth; it is interpolated by the quintic through six steps.
    """

    reach = 5.0  # sigmas of the rest that are worth looking at

    def __init__(self, pole_s: float, step_s: float, points: int = 15) -> None:
        """Compute weights of the conditional mean, and root of the conditional covariance, at points between two steps."""
        known = np.arange(-1.0, 3.0) * step_s / pole_s
        between = np.arange(1, points + 1) / (points + 1.0) * step_s / pole_s

        def correlation(a: np.ndarray, b: np.ndarray) -> np.ndarray:
            x = np.abs(np.subtract.outer(a, b))
            return (1.0 + x) * np.exp(-x)  # type: ignore[no-any-return]

        across = correlation(between, known)
        self.weights: np.ndarray = np.linalg.solve(correlation(known, known), across.T).T
        rest = correlation(between, between) - self.weights @ across.T
        nodes, at, power = np.arange(-2.0, 4.0), np.arange(1, points + 1) / (points + 1.0), np.arange(6)[:, None]
        self.mean_weights: np.ndarray = np.linalg.solve(nodes**power, at**power).T
        self.mean_weights[:, 1:5] -= self.weights
        self.root: np.ndarray = np.linalg.cholesky(rest + 1e-12 * np.eye(points))
        self.sigma = float(np.sqrt(rest.diagonal().max()))

    def path(
        self,
        amplitude: np.ndarray,
        mean: np.ndarray,
        row: np.ndarray,
        step: np.ndarray,
        sigma: np.ndarray,
        rng: np.random.Generator,
    ) -> np.ndarray:
        """Return random amplitudes (row, point) at points evenly between `step` and the next, without these two.

        Parameters
        ----------
        mean : (row, step) the amplitude without noise [electrons]
        row, step : where to draw
        sigma : rms of the noise there [electrons]
        """
        around = np.clip(step[:, None] + np.arange(-2, 4), 0, amplitude.shape[1] - 1)
        near = around[:, 1:5]
        white = rng.standard_normal((len(row), len(self.root)))
        path: np.ndarray = np.einsum("pn,rn->rp", self.weights, amplitude[row[:, None], near])
        path += np.einsum("pn,rn->rp", self.mean_weights, mean[row[:, None], around])
        path += sigma[:, None] * np.einsum("pq,rq->rp", self.root, white)
        return path


def find_latches(
    amplitude: np.ndarray,
    primaries: np.ndarray,
    threshold: np.ndarray,
    base_per_s: np.ndarray,
    first: np.ndarray,
    last: np.ndarray,
    arming: np.ndarray,
    *,
    hysteresis: float,
    step_s: float,
    quiet_electrons: float,
    shot_electrons_rs: float,
    reach: float,
) -> np.ndarray:
    """Return the step (row) at which each row latches, NEVER, or NEAR where `find_crossings_between` has to look.

    A row that is being armed must first be below the threshold less the hysteresis, and is never NEAR.

    Parameters
    ----------
    primaries : (row, step) expected photoelectrons in a step
    base_per_s : (row) primaries that no pulse makes [1/s]
    arming : (row) whether the pixel is armed at `first`
    hysteresis : [electrons]
    shot_electrons_rs : rms noise for each root of the rate of primaries [1/s]
    reach : distance to the threshold that counts as near, in rms noise
    """
    latch = np.empty(len(amplitude), np.int64)
    find_first_crossings(
        packed(amplitude, np.float32),
        packed(primaries, np.float32),
        packed(threshold, np.float32),
        packed(base_per_s, np.float64),
        packed(first, np.int64),
        packed(last, np.int64),
        packed(arming, np.bool_),
        np.float32(hysteresis),
        1.0 / float(step_s),
        float(quiet_electrons) ** 2,
        float(shot_electrons_rs) ** 2,
        float(reach),
        latch,
    )
    return latch


@kernel
def find_first_crossings(
    amplitude: np.ndarray,
    primaries: np.ndarray,
    threshold: np.ndarray,
    base_per_s: np.ndarray,
    first: np.ndarray,
    last: np.ndarray,
    arming: np.ndarray,
    hysteresis: np.float32,
    per_step_s: float,
    quiet_square: float,
    square_s: float,
    reach: float,
    latch: np.ndarray,
) -> None:
    """Fill `latch` (row) with the step at which each row latches, NEVER, or NEAR where it may cross between two steps.

    It may where a step comes within `reach` rms of the noise of the threshold.

    Parameters
    ----------
    per_step_s : one over the length of a step [1/s]
    quiet_square, square_s : mean square of the noise, and what each primary a second adds
    latch : (row) written
    amplitude, primaries, threshold, base_per_s, first, last, arming, hysteresis : as for `find_latches`
    """
    for row in range(amplitude.shape[0]):
        level = threshold[row]
        ready = not arming[row]
        latch[row] = NEVER
        begin, end = max(first[row], 0), min(last[row], amplitude.shape[1])
        for step in range(begin, end):
            if not ready:
                ready = amplitude[row, step] < level - hysteresis
            if ready and amplitude[row, step] >= level:
                latch[row] = step
                break
        if latch[row] != NEVER or arming[row]:
            continue
        for step in range(begin, end - 1):
            below = level - np.float64(max(amplitude[row, step], amplitude[row, step + 1]))
            rate_per_s = primaries[row, step] * per_step_s + base_per_s[row]
            if below < reach * math.sqrt(quiet_square + square_s * rate_per_s):
                latch[row] = NEAR
                break


def mark_watched(n_steps: int, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Return which steps (row, step) the comparator watches."""
    step = np.arange(n_steps)
    watched: np.ndarray = (step >= first[:, None]) & (step < last[:, None])
    return watched


def mark_near(amplitude: np.ndarray, threshold: np.ndarray, watched: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Return whether each step or the next, both watched, is near the threshold (row, step).

    Parameters
    ----------
    watched : (row, step)
    reach : (row, step) distance that counts as near [electrons]
    """
    pair = np.maximum(amplitude[:, :-1], amplitude[:, 1:])
    near: np.ndarray = (pair > threshold[:, None] - reach[:, :-1]) & watched[:, :-1] & watched[:, 1:]
    return near


def find_crossings_between(
    amplitude: np.ndarray,
    mean: np.ndarray,
    threshold: np.ndarray,
    watched: np.ndarray,
    sigma: np.ndarray,
    bridge: Bridge,
    rng: np.random.Generator,
) -> np.ndarray:
    """Return where (row) [steps] rows that are below the threshold at every step cross it between two steps, or -1.

    Parameters
    ----------
    mean : (row, step) the amplitude without noise [electrons]
    watched : (row, step) whether the comparator watches
    sigma : (row, step) rms of the noise [electrons]
    """
    row, step = np.nonzero(mark_near(amplitude, threshold, watched, bridge.reach * bridge.sigma * sigma))
    path = bridge.path(amplitude, mean, row, step, sigma[row, step], rng)
    above = path >= threshold[row, None]
    crossed = np.flatnonzero(above.any(axis=1))
    point = above[crossed].argmax(axis=1)
    row, step, path = row[crossed], step[crossed], path[crossed]
    before = np.where(point > 0, path[np.arange(len(point)), point - 1], amplitude[row, step])
    after = path[np.arange(len(point)), point]
    share = np.clip((threshold[row] - before) / np.maximum(after - before, 1e-30), 0.0, 1.0)
    result = np.full(len(amplitude), float(NEVER))
    place = step + (point + share) / (path.shape[1] + 1.0)
    result[row[::-1]] = place[::-1]  # the first of a row is written last
    return result


def refine_crossings(
    amplitude: np.ndarray, row: np.ndarray, threshold: np.ndarray, latch: np.ndarray, earliest: np.ndarray
) -> np.ndarray:
    """Return where (trace) [steps] the amplitude passes the threshold upward, in rows that are above it at `latch`.

    The edge is a cubic through the two steps before the crossing and the two after it, in asinh(8 a/T): a straight line is
    one there while the amplitude a is small, and the flank of a Gaussian, exponential and more, is a parabola. Of a pulse
    without noise the error is below 0.01 ns up to ten times the threshold, and below 0.1 ns up to a million times.

    Parameters
    ----------
    row : (trace) the rows to look at
    latch : (trace) a step at which the row is above; the crossing is before it
    earliest : (trace) the first step to look at. A row that is above from there on crosses there
    """
    crossing = np.empty(len(row))
    cross_edges(
        packed(amplitude, np.float32),
        packed(row, np.int64),
        packed(threshold, np.float32),
        packed(latch, np.int64),
        packed(earliest, np.int64),
        crossing,
    )
    return crossing


@kernel
def cross_edges(
    amplitude: np.ndarray,
    row: np.ndarray,
    threshold: np.ndarray,
    latch: np.ndarray,
    earliest: np.ndarray,
    crossing: np.ndarray,
) -> None:
    """Write where each edge crosses.

    Parameters
    ----------
    amplitude, row, threshold, latch, earliest : as for `refine_crossings`
    crossing : (trace) [steps], written
    """
    level, last = np.float32(math.asinh(8.0)), amplitude.shape[1] - 1
    for trace in range(len(row)):
        values, step = amplitude[row[trace]], latch[trace]
        while step > earliest[trace] and values[step - 1] >= threshold[trace]:
            step -= 1
        crossing[trace] = step
        if step <= earliest[trace]:
            continue
        scale = np.float32(8.0) / threshold[trace]
        two_before = math.asinh(values[max(step - 2, 0)] * scale)
        before, after = math.asinh(values[step - 1] * scale), math.asinh(values[step] * scale)
        two_after = math.asinh(values[min(step + 1, last)] * scale)
        if before >= level:  # the threshold and its scale are rounded
            continue
        # Divided differences about the step before the crossing. Newton's method finds the root, from the straight line on.
        slope = after - before
        bend = np.float32(0.5) * (after - before - before + two_before)
        twist = (two_after - two_before - np.float32(3.0) * slope) * np.float32(1.0 / 6.0)
        place = (level - before) / slope if slope > np.float32(0.0) else np.float32(1.0)
        least = np.float32(0.2) * abs(slope) + np.float32(1e-9)
        unit = np.float32(1.0)
        for _ in range(3):
            further = bend + (place + unit) * twist
            steep = slope + (place + place - unit) * further + place * (place - unit) * twist
            value = before + place * (slope + (place - unit) * further)
            place = min(max(place - (value - level) / max(steep, least), np.float32(0.0)), unit)
        crossing[trace] = step - 1.0 + place
