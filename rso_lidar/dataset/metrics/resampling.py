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
        """Number the encounters of frames.

        Parameters
        ----------
        sample : (frame) identity of the encounter of each frame.
        """
        values, self.index = np.unique(np.asarray(sample), return_inverse=True)
        self.count = len(values)
        self._kept: dict[tuple[int, int], np.ndarray] = {}

    def draw(self, replicates: int, stream: int = 0) -> Iterator[np.ndarray]:
        """Draw as many encounters as there are, with replacement, once for each replicate.

        Parameters
        ----------
        replicates : number of replicates.
        stream : number of the random stream; the same numbers give the same draws.

        Yields
        ------
        np.ndarray
            How often each encounter was drawn (replicate, encounter), a block of replicates at a time.
        """
        if (replicates, stream) in self._kept:
            yield self._kept[replicates, stream]
            return
        rng = np.random.Generator(np.random.Philox(key=[_KEY, stream]))
        rows = max(1, _BLOCK // max(self.count, 1))
        even = np.full(self.count, 1.0 / max(self.count, 1))
        for start in range(0, replicates, rows):
            weights = rng.multinomial(self.count, even, size=min(rows, replicates - start)).astype(float)
            if rows >= replicates:
                self._kept[replicates, stream] = weights
            yield weights

    def sum_by(self, values: np.ndarray) -> np.ndarray:
        """Return sums (encounter, …) of values (frame, …)."""
        values = np.asarray(values, dtype=float)
        sums = np.zeros((self.count, *values.shape[1:]))
        np.add.at(sums, self.index, values)
        return sums


def percentile_interval(replicates: np.ndarray, confidence: float) -> tuple[float, float]:
    """Return the interval between percentiles of a bootstrap; NaN where a replicate has no value.

    Parameters
    ----------
    replicates : (replicate) values.
    confidence : probability of the interval.
    """
    known = replicates[~np.isnan(replicates)]
    if len(known) < 0.9 * len(replicates) or not len(known):
        return np.nan, np.nan
    tail = 0.5 * (1.0 - confidence)
    low, high = np.quantile(known, [tail, 1.0 - tail], method="inverted_cdf")  # infinite values are allowed
    return float(low), float(high)


def wilson_interval(share: float, count: float, confidence: float) -> tuple[float, float]:
    """Return Wilson's score interval of a proportion (Wilson, 1927).

    Parameters
    ----------
    share : observed proportion.
    count : number of independent trials, which need not be whole.
    confidence : probability of the interval.

    >>> low, high = wilson_interval(0.9, 100, 0.95)
    >>> round(low, 4), round(high, 4)
    (0.8256, 0.9448)
    """
    from scipy.special import ndtri

    if not count > 0 or not np.isfinite(share):
        return np.nan, np.nan
    z2 = float(ndtri(0.5 + 0.5 * confidence)) ** 2
    middle = (share + 0.5 * z2 / count) / (1.0 + z2 / count)
    half = np.sqrt(z2 * (share * (1.0 - share) / count + 0.25 * z2 / count**2)) / (1.0 + z2 / count)
    return (0.0 if share <= 0.0 else float(middle - half)), (1.0 if share >= 1.0 else float(middle + half))


def effective_count(hits: np.ndarray, trials: np.ndarray) -> float:
    """Return the number of independent trials that would give a proportion the variance that it has over encounters.

    The variance is that of a ratio of sums over encounters. Divided by the variance of independent trials it is the
    design effect of survey statistics (Korn and Graubard, *Survey Methodology* 24, 193, 1998). Where all trials succeed or
    all fail, each encounter counts once.

    Parameters
    ----------
    hits, trials : (encounter) successes and trials of each encounter.
    """
    asked = trials > 0
    n, total = int(asked.sum()), float(trials.sum())
    if n == 0:
        return 0.0
    share = float(hits.sum()) / total
    if share <= 0.0 or share >= 1.0 or n == 1:
        return float(n)
    residual = hits[asked] - share * trials[asked]
    variance = n / (n - 1) * float((residual**2).sum()) / total**2
    return min(share * (1.0 - share) / variance, total) if variance > 0.0 else total  # 0: all encounters have one share
