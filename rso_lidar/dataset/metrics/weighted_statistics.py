"""Statistics of frames with a weight for each encounter: means, quantiles and ranked scores.

A figure of merit is a function of the weights of the encounters. With all weights one it is its value; with the weights of
a bootstrap it is a replicate. Two sets of predictions evaluated with the same weights are paired.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from rso_lidar.confidence_intervals import effective_count, percentile_interval, wilson_interval
from rso_lidar.dataset.metrics.resampling import (
    FEWEST_ENCOUNTERS,
    EncounterIndex,
)

_CHUNK = 2_000_000  # weights of frames in one step


class Statistic(ABC):
    """A number computed from frames whose encounters have weights. Its interval is that of a bootstrap over encounters."""

    @property
    def needs_draws(self) -> bool:
        """Whether the interval needs the values of a bootstrap."""
        return True

    @abstractmethod
    def evaluate(self, weights: np.ndarray) -> np.ndarray:
        """Return the values (replicate) for weights (replicate, encounter); NaN where there is none."""

    def find_interval(self, replicates: np.ndarray, confidence: float) -> tuple[float, float, str]:
        """Return an interval and the name of its method.

        Parameters
        ----------
        replicates : (replicate) values of a bootstrap
        confidence : probability of the interval
        """
        return bootstrap_interval(replicates, self.count()[1], confidence)

    @abstractmethod
    def count(self) -> tuple[int, int]:
        """Return the number of frames that matter, and of their encounters."""


class FrameStatistic(Statistic):
    """A statistic of the frames (frame) that are `asked` for."""

    encounters: EncounterIndex
    asked: np.ndarray

    def count(self) -> tuple[int, int]:
        """Return the number of frames that are asked for, and of their encounters."""
        return count_asked(self.encounters, self.asked)


@dataclass(frozen=True, eq=False)
class Ratios(Statistic):
    """Mean over columns of ratios of sums: accuracies, recalls, mean errors, overlaps.

    `above` and `below` are (frame) or (frame, column). A column without anything below is left out of the mean. `root`
    takes the square root of a ratio, for rms errors.
    """

    encounters: EncounterIndex
    above: np.ndarray
    below: np.ndarray
    root: bool = False
    is_proportion: bool = False
    _sums: tuple[np.ndarray, np.ndarray] = field(init=False, repr=False)

    @property
    def needs_draws(self) -> bool:
        """Whether the interval needs the values of a bootstrap; that of a proportion does not."""
        return not self.is_proportion

    def __post_init__(self) -> None:
        sums = (self.encounters.sum_by(np.atleast_2d(part.T).T) for part in (self.above, self.below))
        object.__setattr__(self, "_sums", tuple(sums))

    def evaluate(self, weights: np.ndarray) -> np.ndarray:
        """Return the values (replicate) for weights (replicate, encounter)."""
        above, below = (weights @ part for part in self._sums)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(below > 0, above / below, np.nan)
        if self.root:
            ratio = np.sqrt(ratio)
        return _average_known(ratio, axis=1)

    def find_interval(self, replicates: np.ndarray, confidence: float) -> tuple[float, float, str]:
        """Return Wilson's interval of a proportion with the design effect of encounters, else the bootstrap's."""
        above, below = (part[:, 0] for part in self._sums)
        if self.is_proportion and below.sum() > 0:
            share = float(above.sum() / below.sum())
            return *wilson_interval(share, effective_count(above, below), confidence), "Wilson, design effect"
        return super().find_interval(replicates, confidence)

    def count(self) -> tuple[int, int]:
        """Return the number of frames that matter, and of their encounters."""
        return count_asked(self.encounters, np.atleast_2d(self.below.T).T.sum(axis=1) > 0)


@dataclass(frozen=True, eq=False)
class Quantile(FrameStatistic):
    """Quantile of values (frame) over frames that are `asked` for; infinite values are those of failures."""

    encounters: EncounterIndex
    values: np.ndarray
    asked: np.ndarray
    level: float = 0.5

    def evaluate(self, weights: np.ndarray) -> np.ndarray:
        """Return the values (replicate) for weights (replicate, encounter)."""
        rows = np.flatnonzero(self.asked)
        if not len(rows):
            return np.full(len(weights), np.nan)
        rows = rows[np.argsort(self.values[rows], kind="stable")]
        ranked = self.values[rows]

        def find(of_frames: np.ndarray) -> np.ndarray:
            total = np.cumsum(of_frames, axis=1)
            reached = total >= self.level * total[:, -1:] - 1e-9
            passed = total > self.level * total[:, -1:] + 1e-9
            low, high = ranked[reached.argmax(axis=1)], ranked[passed.argmax(axis=1)]
            middle = np.where(low == high, low, 0.5 * low + 0.5 * high)  # of an even count, as numpy's median
            return np.where(total[:, -1] > 0, middle, np.nan)

        return in_chunks(weights, self.encounters.index[rows], find)


@dataclass(frozen=True, eq=False)
class Mean(Statistic):
    """Mean of other statistics, such as average precisions over classes; one without a value is left out."""

    parts: tuple[Statistic, ...]

    def evaluate(self, weights: np.ndarray) -> np.ndarray:
        """Return the values (replicate) for weights (replicate, encounter)."""
        return _average_known(np.stack([part.evaluate(weights) for part in self.parts]), axis=0)

    def count(self) -> tuple[int, int]:
        """Return the number of frames that matter, and of their encounters."""
        counts = [part.count() for part in self.parts]
        return max(frames for frames, _ in counts), max(some for _, some in counts)


def bootstrap_interval(replicates: np.ndarray, encounters: int, confidence: float) -> tuple[float, float, str]:
    """Return the interval of a bootstrap with the name of its method; NaN for too few encounters, or draws that all agree.

    Parameters
    ----------
    replicates : (replicate) values
    encounters : number of encounters that matter
    """
    if encounters < FEWEST_ENCOUNTERS:
        return np.nan, np.nan, f"none: fewer than {FEWEST_ENCOUNTERS} encounters"
    if (
        len(replicates) and (replicates == replicates[0]).all()
    ):  # such as all perfect: failures are too rare to be drawn
        return np.nan, np.nan, "none: all draws agree"
    return *percentile_interval(replicates, confidence), "bootstrap over encounters"


def _average_known(values: np.ndarray, axis: int) -> np.ndarray:
    """Return the mean of values along an axis without those that are NaN; NaN where all are."""
    known = ~np.isnan(values)
    sums = np.where(known, values, 0.0).sum(axis=axis)
    return np.where(known.any(axis=axis), sums / np.maximum(known.sum(axis=axis), 1), np.nan)


def count_asked(encounters: EncounterIndex, asked: np.ndarray) -> tuple[int, int]:
    """Return the number of frames that are asked for, and of their encounters."""
    return int(asked.sum()), len(np.unique(encounters.index[asked]))


def in_chunks(weights: np.ndarray, encounter: np.ndarray, find: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Evaluate a function of frame weights in pieces that fit in memory.

    Parameters
    ----------
    weights : (replicate, encounter)
    encounter : (frame) number of the encounter of each frame
    find : takes weights (replicate, frame) and returns values (replicate)
    """
    rows = max(1, _CHUNK // max(len(encounter), 1))
    pieces = [find(weights[start : start + rows][:, encounter]) for start in range(0, len(weights), rows)]
    return np.concatenate(pieces) if pieces else np.empty(0)
