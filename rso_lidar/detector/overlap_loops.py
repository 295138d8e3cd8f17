"""The work of `overlap` as a loop: what some rows take from the row before them."""

import numpy as np

from rso_lidar.arithmetic import loop


@loop
def carry(drawn: np.ndarray, row: np.ndarray, lag: np.ndarray, shared: np.ndarray) -> None:
    """Write the first `shared` steps of each `row` of `drawn` (row, step) from `lag` steps later in the row before."""
    for k in range(len(row)):
        for step in range(shared[k]):
            drawn[row[k], step] = drawn[row[k] - 1, lag[k] + step]
