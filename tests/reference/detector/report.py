"""Reports of the focal plane in NumPy: the oracle of `rso_lidar.detector.chain.measurement`."""

import math

import numpy as np

from rso_lidar.detector.chain.measurement import LAST, STRONGEST


def report_traces(
    pixel, range_m, amplitude, clipped, choice, full_scale, one_m, one_counts, saturated, several_m, several_counts
):
    """Fill what each pixel reports: of the returns (trace, return) the one chosen, and of all as many as are asked for."""
    seen = np.isfinite(range_m)
    reported = np.flatnonzero(seen.any(axis=1))
    range_m, amplitude, seen, pixel = range_m[reported], amplitude[reported], seen[reported], pixel[reported]
    counts = np.clip(np.rint(np.where(seen, amplitude, 1.0)), 1, full_scale)
    row = np.arange(len(reported))
    if choice == STRONGEST:
        chosen = np.where(seen, amplitude, -math.inf).argmax(axis=1)
    elif choice == LAST:
        chosen = seen.shape[1] - 1 - seen[:, ::-1].argmax(axis=1)
    else:
        chosen = seen.argmax(axis=1)
    one_m[pixel] = range_m[row, chosen]
    one_counts[pixel] = counts[row, chosen]
    saturated[pixel] = clipped[reported].any(axis=1) | (counts[row, chosen] >= full_scale)
    kept = min(several_m.shape[1], seen.shape[1])
    several_m[pixel, :kept] = range_m[:, :kept]
    several_counts[pixel, :kept] = np.where(seen, counts, 0.0)[:, :kept]
