"""The amplifier as a loop: noise of its own and of the avalanche, row by row, as sums over the steps that it remembers."""

import numpy as np

from rso_lidar.arithmetic import loop
from rso_lidar.detector.alias import NORMAL_PER_SIGMA, NORMAL_ZERO, Table


@loop
def amplified(
    quiet: np.ndarray,
    excess: np.ndarray,
    gain: np.ndarray,
    taps: np.ndarray,
    noise: np.float32,
    table: Table,
    words: np.ndarray,
    amplitude: np.ndarray,
) -> None:
    """Write the amplitude (row, step): the mean `quiet` and what `excess` and white noise become, times the row's gain.

    `noise` [electrons] is the rms of a step before the filter, drawn from the normal `table` by the `words` (row * step).
    """
    columns_log2, cells, first = table
    per_value, zero = noise / np.float32(NORMAL_PER_SIGMA), first[0] - NORMAL_ZERO
    n_rows, n = quiet.shape
    before = len(taps) - 1
    white = np.empty(before + n, np.float32)  # the row with its end before it: time runs in a circle
    for row in range(n_rows):
        strength = gain[row]
        drawn, more, mean, sum_of = words[row * n : (row + 1) * n], excess[row], quiet[row], amplitude[row]
        now = white[before:]
        for step in range(n):
            word = drawn[step]
            column = np.int64(word) >> (32 - columns_log2)
            normal = column + (word >= cells[column, 0]) * (np.int64(cells[column, 1]) - first[0] - column) + zero
            now[step] = per_value * np.float32(normal) + strength * more[step]
            sum_of[step] = strength * mean[step]
        for step in range(before):
            white[step] = white[n + step]
        for tap in range(len(taps)):
            share, earlier = taps[tap], white[before - tap : before - tap + n]
            for step in range(n):
                sum_of[step] += share * earlier[step]
