"""Storing and converting as one loop: the samples of each trace from the steps of its row, in counts."""

import numpy as np

from rso_lidar.arithmetic import loop


@loop
def store(
    amplitude: np.ndarray,
    row: np.ndarray,
    first: np.ndarray,
    per_sample: int,
    counts_per_electron: np.float32,
    offset_counts: np.ndarray,
    full_scale: np.float32,
    quantised: bool,
    counts: np.ndarray,
) -> int:
    """Fill `counts` (trace, sample) with the converter's output of every `per_sample`th step from `first` of each `row`.

    `offset_counts` (trace) holds the baseline and what a pixel adds to it. Return how many traces were filled before one
    that reaches beyond its row.
    """
    for trace in range(counts.shape[0]):
        last = first[trace] + (counts.shape[1] - 1) * per_sample
        if first[trace] < 0 or last >= amplitude.shape[1]:
            return trace
        for sample in range(counts.shape[1]):
            electrons = amplitude[row[trace], first[trace] + sample * per_sample]
            count = electrons * counts_per_electron + offset_counts[trace]
            if quantised:
                count = np.rint(count)
            counts[trace, sample] = min(max(count, np.float32(0.0)), full_scale)
    return len(counts)
