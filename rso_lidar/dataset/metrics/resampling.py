"""Encounters drawn with replacement: intervals of figures of merit whose frames are not independent.

Frames of one encounter share its attitude, its range and its satellite, and several noise draws share even the pose. What
is independent is the encounter. A bootstrap over frames would give intervals that are too narrow, so whole encounters are
drawn (Davison and Hinkley, *Bootstrap Methods and their Application*, 1997, sec. 3.8).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

FEWEST_ENCOUNTERS = 8  # below this, an interval of a bootstrap is not given
_BLOCK = 4_000_000  # weights in one block: 32 MB
_KEY = 20240917  # of the random generator; fixed, so that the same predictions give the same intervals


class EncounterIndex:
    """Encounter of each frame, numbered from 0.

    `index` (frame) is the number of each frame's encounter, and `count` the number of encounters.
    """

    def __init__(self, sample: np.ndarray) -> None:
        """Number the encounters of frames, by the identity (frame) of the encounter of each."""
        values, self.index = np.unique(np.asarray(sample), return_inverse=True)
        self.count = len(values)
        self._kept: dict[int, np.ndarray] = {}

    def draw(self, replicates: int) -> Iterator[np.ndarray]:
        """Draw as many encounters as there are, with replacement, once for each replicate.

        The same number of replicates gives the same draws.

        Yields
        ------
        np.ndarray
            How often each encounter was drawn (replicate, encounter), a block of replicates at a time.
        """
        if replicates in self._kept:
            yield self._kept[replicates]
            return
        rng = np.random.Generator(np.random.Philox(key=[_KEY, 0]))
        rows = max(1, _BLOCK // max(self.count, 1))
        even = np.full(self.count, 1.0 / max(self.count, 1))
        for start in range(0, replicates, rows):
            weights = rng.multinomial(self.count, even, size=min(rows, replicates - start)).astype(float)
            if rows >= replicates:
                self._kept[replicates] = weights
            yield weights

    def sum_by(self, values: np.ndarray) -> np.ndarray:
        """Return sums (encounter, …) of values (frame, …)."""
        values = np.asarray(values, dtype=float)
        sums = np.zeros((self.count, *values.shape[1:]))
        np.add.at(sums, self.index, values)
        return sums
