"""Sorting of short runs of numbers, inside kernels."""

import numpy as np

from rso_lidar.kernels import kernel

RUN = 16  # length of the runs that are sorted by insertion


@kernel
def sort_by(value: np.ndarray, order: np.ndarray, spare: tuple[np.ndarray, np.ndarray], start: int, stop: int) -> None:
    """Sort value[start:stop], and order[start:stop] with it, in place; equal values keep their order.

    Runs are sorted by insertion and then merged.
    """
    for low in range(start, stop, RUN):
        for k in range(low + 1, min(low + RUN, stop)):
            this, number, at = value[k], order[k], k
            while at > low and value[at - 1] > this:
                value[at], order[at] = value[at - 1], order[at - 1]
                at -= 1
            value[at], order[at] = this, number
    run = RUN
    while run < stop - start:
        for low in range(start, stop, 2 * run):
            middle, high = min(low + run, stop), min(low + 2 * run, stop)
            for k in range(low, high):
                spare[0][k], spare[1][k] = order[k], value[k]
            left, right = low, middle
            for at in range(low, high):
                if right < high and (left == middle or spare[1][right] < spare[1][left]):
                    order[at], value[at] = spare[0][right], spare[1][right]
                    right += 1
                else:
                    order[at], value[at] = spare[0][left], spare[1][left]
                    left += 1
        run *= 2
