"""The comparators in NumPy: the oracle of `rso_lidar.detector.stages.comparator`."""

import math

import numpy as np

from rso_lidar.detector.stages.comparator import NEAR, NEVER, mark_near, mark_watched


def first_crossing(
    amplitude: np.ndarray,
    threshold: np.ndarray,
    first: np.ndarray,
    last: np.ndarray,
    *,
    hysteresis: float = 0.0,
    arming: np.ndarray | None = None,
) -> np.ndarray:
    """Return the step (row) at which each row latches, or -1.

    Parameters
    ----------
    amplitude : (row, step) [electrons] above the baseline.
    threshold : (row) [electrons].
    first, last : (row) the steps from which, and before which, the comparator is watched.
    hysteresis : [electrons].
    arming : (row) where `first` is the moment of arming: such a comparator must be below threshold - hysteresis before it
        can fire. Elsewhere it was ready before, and a signal that is above at `first` latches there.
    """
    watched = mark_watched(amplitude.shape[1], first, last)
    above = (amplitude >= threshold[:, None]) & watched
    if arming is not None and arming.any():
        rows = np.flatnonzero(arming)
        ready = np.maximum.accumulate((amplitude[rows] < threshold[rows, None] - hysteresis) & watched[rows], axis=1)
        above[rows] &= ready
    latched: np.ndarray = above.argmax(axis=1)
    latched[~above[np.arange(len(above)), latched]] = NEVER
    return latched


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
    """Return the step (row) at which each row latches, NEVER, or NEAR."""
    latch = first_crossing(amplitude, threshold, first, last, hysteresis=hysteresis, arming=arming)
    some = np.flatnonzero((latch == NEVER) & ~arming)
    rate_per_s = primaries[some] / step_s + base_per_s[some, None]
    sigma = np.sqrt(quiet_electrons**2 + shot_electrons_rs**2 * rate_per_s)
    watched = mark_watched(amplitude.shape[1], first[some], last[some])
    latch[some[mark_near(amplitude[some], threshold[some], watched, reach * sigma).any(axis=1)]] = NEAR
    return latch


def refine_crossings(
    amplitude: np.ndarray, row: np.ndarray, threshold: np.ndarray, latch: np.ndarray, earliest: np.ndarray
) -> np.ndarray:
    """Return where (trace) [steps] the amplitude passes the threshold upward."""
    step = latch.copy()
    back = np.flatnonzero(step > earliest)
    while len(back):
        back = back[amplitude[row[back], step[back] - 1] >= threshold[back]]
        step[back] -= 1
        back = back[step[back] > earliest[back]]
    around = np.clip(step[:, None] + np.arange(-2, 2), 0, amplitude.shape[1] - 1)
    scale, half = (np.float32(8.0) / threshold).astype(np.float32), np.float32(0.5)  # single precision: twice as fast
    two_before, before, after, two_after = np.arcsinh(amplitude[row[:, None], around].T * scale)
    level = np.float32(math.asinh(8.0))
    # Divided differences about the step before the crossing. Newton's method finds the root, from the straight line on.
    slope, bend = after - before, half * (after - before - before + two_before)
    twist = (two_after - two_before - np.float32(3.0) * slope) * np.float32(1.0 / 6.0)
    place = np.divide(level - before, slope, out=np.ones_like(slope), where=slope > 0.0)
    least = np.float32(0.2) * np.abs(slope) + np.float32(1e-9)
    for _ in range(3):
        further = bend + (place + 1) * twist
        steep = slope + (place + place - 1) * further + place * (place - 1) * twist
        value = before + place * (slope + (place - 1) * further)
        place = np.clip(place - (value - level) / np.maximum(steep, least), 0, 1)
    crossing: np.ndarray = np.where((step <= earliest) | (before >= level), step.astype(float), step - 1.0 + place)
    return crossing
