"""Addresses of the random words of rows: a frame's key, pixel and first step of a row, and the stage that draws."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rso_lidar.detector.stages.overlap import Overlap
from rso_lidar.detector.stages.time_axis import Rows
from rso_lidar.kernels import kernel, packed
from rso_lidar.philox import draw_key, fill_row

# The last word of a counter. The avalanche draws three words for each step: for its tables of many and of few primaries,
# and for the rest. Where the rest has avalanches, it draws a block for each, from further stages.
AMPLIFIER, AVALANCHE, AVALANCHE_FINE, AVALANCHE_REST, AVALANCHE_MORE = range(5)


class RowNoise(NamedTuple):
    """Where the random words of some rows are.

    Rows that overlap in time share words: the first `shared` steps of a row are those `lag` steps later in the row before.
    """

    key: np.ndarray  # (2) uint32
    pixel: np.ndarray  # (row)
    start: np.ndarray  # (row) first step, counted from emission
    lag: np.ndarray  # (row) steps
    shared: np.ndarray  # (row) steps, 0 where nothing is shared

    @staticmethod
    def of(rows: Rows, overlap: Overlap, rng: np.random.Generator) -> RowNoise:
        """Draw a key for rows.

        Parameters
        ----------
        rows : stretches of time of pixels.
        overlap : which of them overlap.
        rng : the frame's generator.
        """
        lag, shared = np.zeros((2, len(rows.pixel)), np.int64)
        lag[overlap.row], shared[overlap.row] = overlap.lag, overlap.shared
        return RowNoise(draw_key(rng), *(packed(values, np.int64) for values in (rows.pixel, rows.start, lag, shared)))

    def select(self, block: slice) -> RowNoise:
        """Return that of some rows, of which the first must be the first of a pixel."""
        return RowNoise(self.key, *(values[block] for values in self[1:]))


@kernel
def share_words(words: np.ndarray, before: np.ndarray, lag: int, shared: int) -> None:
    """Copy the words that a row shares with the row before.

    Parameters
    ----------
    words : (step) words of the row, written.
    before : (step) words of the row before; afterwards those of this row.
    lag, shared : by how many steps the rows differ, and how many they share.
    """
    for step in range(shared):
        words[step] = before[lag + step]
    for step in range(len(words)):
        before[step] = words[step]


@kernel
def fill_words(noise: RowNoise, row: int, stage: int, words: np.ndarray) -> None:
    """Write the words (step) that a stage draws for a row; as many as a multiple of four steps."""
    fill_row(noise.key, noise.start[row], noise.pixel[row], stage, words)
