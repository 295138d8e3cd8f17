"""The comparators of all rows as one loop: what `first_crossing` finds, and which rows `crossed_between` has to look at."""

import math

import numpy as np

from rso_lidar.arithmetic import loop
from rso_lidar.detector.trigger import NEAR, NEVER


@loop
def first_crossings(
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

    It may where a step comes within `reach` rms of the noise of the threshold [electrons]. That noise has a mean square of
    `quiet_square` and `square_s` for each primary a second; `per_step_s` turns `primaries` of a step into that.
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
