"""The comparators in NumPy: the oracle of `rso_lidar.detector.stages.comparator`."""

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
