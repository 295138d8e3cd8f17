"""Figures of merit with their intervals, and figures of merit in bins of range, light or lit pixels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar.dataset.metrics.resampling import EncounterIndex
from rso_lidar.dataset.metrics.weighted_statistics import Statistic

HIGHER, LOWER = "higher", "lower"


@dataclass(frozen=True, eq=False)
class FigureOfMerit:
    """A number that says how good predictions are.

    `better` is ``higher`` or ``lower``. Those with `is_compared` are judged where two sets of predictions are compared.
    """

    name: str
    unit: str
    better: str
    meaning: str
    statistic: Statistic
    is_compared: bool = True


@dataclass(frozen=True, eq=False)
class Bins:
    """Statistics of frames in bins of a quantity, by series, such as recall of each class in bins of lit pixels."""

    name: str
    quantity: str
    unit: str
    edges: np.ndarray
    series: Mapping[str, Sequence[Statistic]]


@dataclass(frozen=True, eq=False)
class BinnedScores:
    """Scores of predictions of poses or pixels: figures of merit, and statistics in bins."""

    merits: tuple[FigureOfMerit, ...]
    bins: tuple[Bins, ...]


@dataclass(frozen=True)
class Value:
    """Value of a statistic with its interval, the method of the interval, and the frames and encounters that matter."""

    value: float
    low: float
    high: float
    method: str
    frames: int
    encounters: int


def replicate(statistics: Sequence[Statistic], encounters: EncounterIndex, replicates: int) -> np.ndarray:
    """Evaluate statistics with the weights of a bootstrap over encounters.

    Parameters
    ----------
    replicates : number of draws

    Returns
    -------
    Values (statistic, replicate). The same encounters and numbers give the same draws, so that two calls are paired.
    """
    blocks = [
        np.array([statistic.evaluate(weights) for statistic in statistics]).reshape(len(statistics), len(weights))
        for weights in encounters.draw(replicates)
    ]
    return np.concatenate(blocks, axis=1) if blocks else np.empty((len(statistics), 0))


def evaluate_all(statistics: Sequence[Statistic], encounters: EncounterIndex) -> np.ndarray:
    """Return the values (statistic) of statistics over all encounters."""
    once = np.ones((1, encounters.count))
    return np.array([statistic.evaluate(once)[0] for statistic in statistics])


def find_values(
    statistics: Sequence[Statistic], encounters: EncounterIndex, replicates: int, confidence: float
) -> tuple[Value, ...]:
    """Evaluate statistics with their intervals."""
    values = evaluate_all(statistics, encounters)
    drawn = iter(replicate([statistic for statistic in statistics if statistic.needs_draws], encounters, replicates))
    empty = np.empty(0)
    return tuple(
        Value(
            float(value),
            *statistic.find_interval(next(drawn) if statistic.needs_draws else empty, confidence),
            *statistic.count(),
        )
        for statistic, value in zip(statistics, values, strict=True)
    )


def find_log_edges(values: np.ndarray) -> np.ndarray:
    """Return edges of bins, two in a factor of ten, that hold all finite values (frame) above zero.

    >>> find_log_edges(np.array([1.0, 250.0])).round(1).tolist()
    [1.0, 3.2, 10.0, 31.6, 100.0, 316.2]
    """
    known = values[np.isfinite(values) & (values > 0)]
    if not len(known):
        return np.array([1.0, 10.0])
    first = np.floor(2 * np.log10(known.min()) + 1e-9)
    last = np.floor(2 * np.log10(known.max()) + 1e-9) + 1.0
    edges: np.ndarray = 10.0 ** (np.arange(first, last + 1.0) / 2)
    return edges


def find_even_edges(values: np.ndarray, count: int) -> np.ndarray:
    """Return edges of bins that hold about equally many of the finite values.

    Parameters
    ----------
    values : (frame)
    count : greatest number of bins; fewer where values are equal
    """
    known = values[np.isfinite(values)]
    if not len(known):
        return np.array([0.0, 1.0])
    edges = np.unique(np.quantile(known, np.linspace(0.0, 1.0, count + 1)))
    if len(edges) == 1:
        edges = np.append(edges, edges[0] + 1.0)
    edges[-1] = np.nextafter(edges[-1], np.inf)  # the greatest value is inside
    return edges


def find_bins(values: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return the number of the bin (frame) of each value; -1 outside all bins and for NaN."""
    bins = np.searchsorted(edges, np.where(np.isfinite(values), values, -np.inf), side="right") - 1
    return np.where((bins >= 0) & (bins < len(edges) - 1), bins, -1)
