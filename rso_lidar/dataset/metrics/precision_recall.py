"""Precision and recall, and detections against false alarms, of ranked scores.

Average precision is the sum of precision over the steps of recall, without interpolation, with ties taken together: the
definition of scikit-learn's `average_precision_score` (Manning, Raghavan and Schütze, *Introduction to Information
Retrieval*, 2008, sec. 8.4). A score of minus infinity is that of a missing prediction, which no threshold retrieves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rso_lidar.dataset.metrics.resampling import EncounterIndex
from rso_lidar.dataset.metrics.weighted_statistics import FrameStatistic, in_chunks


@dataclass(frozen=True, eq=False)
class RankingCurve:
    """Points of a curve from the highest threshold to the lowest.

    `threshold`, `precision`, `recall` and `false_alarm_rate` are (point); precision is one where nothing is retrieved.
    """

    threshold: np.ndarray
    precision: np.ndarray
    recall: np.ndarray
    false_alarm_rate: np.ndarray


@dataclass(frozen=True, eq=False)
class _Ranking(FrameStatistic):
    """Scores (frame) against truth (frame) of frames that are asked for, ranked from the highest score to the lowest."""

    encounters: EncounterIndex
    score: np.ndarray
    positive: np.ndarray
    asked: np.ndarray

    @cached_property
    def rows(self) -> np.ndarray:
        """Frames by falling score."""
        rows = np.flatnonzero(self.asked)
        order: np.ndarray = rows[np.argsort(-self.score[rows], kind="stable")]
        return order

    @cached_property
    def last_of_tie(self) -> np.ndarray:
        """Places in `rows` that end a group of equal scores, without those of missing predictions."""
        ranked = self.score[self.rows]
        ends = np.flatnonzero(np.append(ranked[1:] != ranked[:-1], True)) if len(ranked) else np.empty(0, int)
        places: np.ndarray = ends[ranked[ends] > -np.inf]
        return places

    def _evaluate(self, weights: np.ndarray, find: Callable[..., np.ndarray]) -> np.ndarray:
        """Apply a function of weighted counts of detections and false alarms at each threshold.

        Parameters
        ----------
        weights : (replicate, encounter)
        find : takes detections and false alarms (replicate, threshold), and the totals (replicate) of both
        """
        good = self.positive[self.rows]

        def count(of_frames: np.ndarray) -> np.ndarray:
            hits = np.cumsum(of_frames * good, axis=1)
            alarms = np.cumsum(of_frames * ~good, axis=1)
            if not hits.shape[1]:
                return np.full(len(of_frames), np.nan)
            with np.errstate(divide="ignore", invalid="ignore"):
                return find(hits[:, self.last_of_tie], alarms[:, self.last_of_tie], hits[:, -1], alarms[:, -1])

        return in_chunks(weights, self.encounters.index[self.rows], count)

    def trace(self) -> RankingCurve:
        """Trace precision, recall and the rate of false alarms over all thresholds."""
        good = self.positive[self.rows]
        hits, alarms = np.cumsum(good), np.cumsum(~good)
        ends = self.last_of_tie
        true, false = (np.concatenate([[0.0], part[ends]]) if len(part) else np.zeros(1) for part in (hits, alarms))
        with np.errstate(divide="ignore", invalid="ignore"):
            precision = np.where(true + false > 0, true / (true + false), 1.0)
            recall, rate = true / good.sum(), false / (~good).sum()
        return RankingCurve(np.concatenate([[np.inf], self.score[self.rows][ends]]), precision, recall, rate)


class AveragePrecision(_Ranking):
    """Area under precision over recall, as a sum over the steps of recall."""

    def evaluate(self, weights: np.ndarray) -> np.ndarray:
        """Return the values (replicate) for weights (replicate, encounter); NaN without a positive frame."""
        return self._evaluate(weights, _find_average_precision)


class RocArea(_Ranking):
    """Area under detections over false alarms: the probability that a positive frame outranks a negative one.

    Ties count half (Hanley and McNeil, *Radiology* 143, 29, 1982).
    """

    def evaluate(self, weights: np.ndarray) -> np.ndarray:
        """Return the values (replicate) for weights (replicate, encounter); NaN where all frames are alike."""
        return self._evaluate(weights, _find_area)


class FalseAlarmRate(_Ranking):
    """False-alarm rate at the highest threshold whose recall reaches 95 %."""

    recall = 0.95

    def evaluate(self, weights: np.ndarray) -> np.ndarray:
        """Return the values (replicate) for weights (replicate, encounter); one where no threshold reaches the recall."""

        def find(hits: np.ndarray, alarms: np.ndarray, positives: np.ndarray, negatives: np.ndarray) -> np.ndarray:
            if not hits.shape[1]:
                return np.where((positives > 0) & (negatives > 0), 1.0, np.nan)
            reached = hits >= self.recall * positives[:, None] - 1e-9
            at = np.take_along_axis(alarms, reached.argmax(axis=1)[:, None], axis=1)[:, 0]
            rate = np.where(reached.any(axis=1), at / negatives, 1.0)
            return np.where((positives > 0) & (negatives > 0), rate, np.nan)

        return self._evaluate(weights, find)


def _find_average_precision(
    hits: np.ndarray, alarms: np.ndarray, positives: np.ndarray, negatives: np.ndarray
) -> np.ndarray:
    """Return the average precision (replicate) of retrieved frames (replicate, threshold), of all (replicate)."""
    retrieved = hits + alarms
    precision = np.where(retrieved > 0, hits / np.where(retrieved > 0, retrieved, 1.0), 0.0)
    steps = np.diff(hits, axis=1, prepend=0.0)
    return np.where(positives > 0, (precision * steps).sum(axis=1) / positives, np.nan)


def _find_area(hits: np.ndarray, alarms: np.ndarray, positives: np.ndarray, negatives: np.ndarray) -> np.ndarray:
    """Return the area under the curve of detections over false alarms (replicate), closed at the missing predictions.

    Parameters
    ----------
    hits, alarms : (replicate, threshold) retrieved positive and negative frames
    positives, negatives : (replicate) all of them
    """
    start = np.zeros((len(hits), 1))
    last = hits[:, -1:] if hits.shape[1] else start
    hits, alarms = np.hstack([start, hits, last]), np.hstack([start, alarms, negatives[:, None]])
    area = (np.diff(alarms, axis=1) * 0.5 * (hits[:, 1:] + hits[:, :-1])).sum(axis=1)
    return np.where((positives > 0) & (negatives > 0), area / (positives * negatives), np.nan)
