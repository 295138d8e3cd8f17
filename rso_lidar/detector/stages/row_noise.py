"""Addresses of the random words of rows: a frame's key, pixel and first step of a row, and the stage that draws."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rso_lidar.detector.stages.time_axis import Rows
from rso_lidar.kernels import kernel, packed
from rso_lidar.philox import draw_key, fill_row

# The last word of a counter. The avalanche draws three words for each step, from three stages: for its tables of many and of
# few primaries, and for the rest. Where the rest has avalanches, it draws a block for each, from further stages.
AMPLIFIER, AVALANCHE, AVALANCHE_MORE = 0, 1, 4


class RowNoise(NamedTuple):
    """Where the random words of some rows are."""

    key: np.ndarray  # (2) uint32
    pixel: np.ndarray  # (row)
    start: np.ndarray  # (row) first step, counted from emission

    @staticmethod
    def of(rows: Rows, rng: np.random.Generator) -> RowNoise:
        """Draw a key for rows."""
        return RowNoise(draw_key(rng), packed(rows.pixel, np.int64), packed(rows.start, np.int64))

    def select(self, block: slice) -> RowNoise:
        """Return that of some rows."""
        return RowNoise(self.key, self.pixel[block], self.start[block])

    def draw(self, stage: int, n_stages: int, n_steps: int) -> np.ndarray:
        """Return the words (stage, row, step), uint32, that some stages draw.

        Parameters
        ----------
        stage, n_stages : the first stage, and how many
        n_steps : steps of a row. The number of words is the next multiple of four
        """
        words = np.empty((n_stages, len(self.pixel), -(-n_steps // 4) * 4), np.uint32)
        fill_rows(self.key, self.start, self.pixel, stage, words)
        return words


@kernel
def fill_rows(key: np.ndarray, start: np.ndarray, pixel: np.ndarray, stage: int, words: np.ndarray) -> None:
    """Write the words that some stages draw.

    Parameters
    ----------
    key, start, pixel : those of `RowNoise`
    words : (stage, row, step) uint32, written; a multiple of four steps
    """
    for k in range(words.shape[0]):
        for row in range(words.shape[1]):
            fill_row(key, start[row], pixel[row], stage + k, words[k, row])
