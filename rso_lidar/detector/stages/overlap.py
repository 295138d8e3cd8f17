"""Rows of a pixel that overlap in time share one noise: the next row repeats what the row before it has drawn.

With independent noise, a return that reaches from one row into the next would have two chances to trigger.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rso_lidar.detector.stages.time_axis import Rows
from rso_lidar.kernels import kernel


class Overlap(NamedTuple):
    """Rows that continue the row before: their first `shared` steps are those `lag` steps later there.

    Those reach to the step after the last that the comparator watched: decisions up to there remain valid, and what comes
    later is drawn. Rows that are the first of their pixel, or far from the one before, are not among them.
    """

    row: np.ndarray
    lag: np.ndarray
    shared: np.ndarray

    @staticmethod
    def of(rows: Rows) -> "Overlap":
        """Find the rows that continue another, and their overlap."""
        row = np.flatnonzero(rows.pixel[1:] == rows.pixel[:-1]) + 1
        lag = rows.start[row] - rows.start[row - 1]
        shared = np.minimum(rows.last[row - 1] + 1, rows.length) - lag
        some = shared > 0
        return Overlap(row[some], lag[some], shared[some])

    def select(self, block: slice) -> "Overlap":
        """Return that of some rows, counted from the first of them, which must be the first of a pixel."""
        first, last = np.searchsorted(self.row, (block.start, block.stop))
        return Overlap(self.row[first:last] - block.start, self.lag[first:last], self.shared[first:last])

    def carry(self, drawn: np.ndarray) -> None:
        """Write over what was drawn (row, step; 32 bits each) where the row before has drawn it already."""
        if not len(self.row):
            return
        copy_shared(drawn.view(np.uint32), *self)


def split_rows(rows: Rows, at_once: int) -> list[slice]:
    """Return slices of about `at_once` rows. Each begins with the first row of a pixel."""
    pixel = rows.pixel
    edges = np.unique([*np.searchsorted(pixel, pixel[::at_once]), len(pixel)]).astype(int)
    return [slice(a, b) for a, b in pairwise(edges.tolist())]


@kernel
def copy_shared(drawn: np.ndarray, row: np.ndarray, lag: np.ndarray, shared: np.ndarray) -> None:
    """Copy the steps that a row shares with the row before it.

    Parameters
    ----------
    drawn : (row, step) u4, changed in place
    row : (overlap) rows that overlap the row before
    lag : (overlap) steps by which they begin later
    shared : (overlap) number of shared steps
    """
    for k in range(len(row)):
        for step in range(shared[k]):
            drawn[row[k], step] = drawn[row[k] - 1, lag[k] + step]
