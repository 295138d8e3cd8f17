"""The returns of all traces laid out over the focal plane, as one loop."""

import numpy as np

from rso_lidar.arithmetic import loop
from rso_lidar.detector.measure import LAST, STRONGEST


@loop
def lay_out(
    pixel: np.ndarray,
    range_m: np.ndarray,
    amplitude: np.ndarray,
    clipped: np.ndarray,
    choice: int,
    full_scale: float,
    one_m: np.ndarray,
    one_counts: np.ndarray,
    saturated: np.ndarray,
    several_m: np.ndarray,
    several_counts: np.ndarray,
) -> None:
    """Fill what each pixel reports of the returns (trace, return): the one chosen, and all as far as `several` has room.

    What is filled holds NaN and 0 before.
    """
    for trace in range(range_m.shape[0]):
        at, chosen = pixel[trace], -1
        for k in range(range_m.shape[1]):
            if not np.isfinite(range_m[trace, k]):
                continue
            better = choice == LAST or (choice == STRONGEST and amplitude[trace, k] > amplitude[trace, max(chosen, 0)])
            chosen = k if chosen < 0 or better else chosen
            if k < several_m.shape[1]:
                several_m[at, k] = range_m[trace, k]
                several_counts[at, k] = min(max(np.rint(amplitude[trace, k]), 1.0), full_scale)
        if chosen < 0:
            continue
        one_m[at] = range_m[trace, chosen]
        counts = min(max(np.rint(amplitude[trace, chosen]), 1.0), full_scale)
        one_counts[at] = counts
        some = counts >= full_scale
        for sample in range(clipped.shape[1]):
            some = some or clipped[trace, sample]
        saturated[at] = some
