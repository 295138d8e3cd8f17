"""Scorecard of one algorithm on one split: every figure of merit with its interval, for one training run or several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from rso_lidar.dataset.metrics.merits import (
    BinnedScores,
    Bins,
    FigureOfMerit,
    Value,
    evaluate_all,
    find_values,
    replicate,
)
from rso_lidar.dataset.metrics.precision_recall import RankingCurve
from rso_lidar.dataset.metrics.weighted_statistics import Statistic, bootstrap_interval
from rso_lidar.dataset.scoring.classification import Classification, Confusions, score_classes
from rso_lidar.dataset.scoring.ground_truth import FrameTruth
from rso_lidar.dataset.scoring.pixel_errors import PartCounts, RangeErrors, score_parts, score_ranges
from rso_lidar.dataset.scoring.pose_errors import ModelSurface, find_pose_errors, score_poses
from rso_lidar.dataset.scoring.prediction_table import Predictions
from rso_lidar.dataset.scoring.presence import Presence, score_presence
from rso_lidar.errors import DatasetError
from rso_lidar.records import Symmetry

_BLOCK = 64  # frames of pixels in memory at once


class PixelReader(Protocol):
    """Arrays of a split, read for some of its frames."""

    def read(self, rows: Sequence[int], names: Sequence[str]) -> Mapping[str, np.ndarray]:
        """Return arrays with the frame first."""
        ...


@dataclass(frozen=True, eq=False)
class Benchmark:
    """What predictions are scored against.

    `truth` is that of the frames, `pixels` reads arrays of them, `part_classes` are the common part classes, `surfaces` and
    `symmetries` those of the models by number.
    """

    truth: FrameTruth
    pixels: PixelReader | None
    part_classes: tuple[str, ...]
    surfaces: Mapping[int, ModelSurface]
    symmetries: Sequence[Symmetry | None]
    identity: str
    split: str


@dataclass(frozen=True, eq=False)
class RunScores:
    """Scores of the predictions of one training run; a task that it does not predict is None."""

    name: str
    missing: np.ndarray
    classification: Classification | None
    presence: Presence | None
    poses: BinnedScores | None
    parts: BinnedScores | None
    ranges: BinnedScores | None
    class_id: np.ndarray | None

    @property
    def merits(self) -> tuple[FigureOfMerit, ...]:
        """All figures of merit."""
        tasks = (self.classification, self.presence, self.poses, self.parts, self.ranges)
        return tuple(merit for task in tasks if task is not None for merit in task.merits)

    @property
    def bins(self) -> tuple[Bins, ...]:
        """All figures in bins."""
        tasks = (self.classification, self.poses, self.parts, self.ranges)
        return tuple(bins for task in tasks if task is not None for bins in task.bins)


@dataclass(frozen=True)
class ScoredMerit:
    """A figure of merit with its mean over runs, its interval over encounters, and the value of each run."""

    name: str
    unit: str
    better: str
    meaning: str
    is_compared: bool
    value: Value
    of_runs: tuple[float, ...]

    @property
    def spread(self) -> float:
        """Standard deviation over runs; NaN for one."""
        return float(np.std(self.of_runs, ddof=1)) if len(self.of_runs) > 1 else float("nan")


@dataclass(frozen=True, eq=False)
class Scorecard:
    """Scores of an algorithm on a split.

    Parameters
    ----------
    benchmark : the frames, and what is true of them
    runs : scores of each training run of the algorithm
    replicates : draws of the bootstrap over encounters
    confidence : level of the intervals
    """

    benchmark: Benchmark
    runs: tuple[RunScores, ...]
    replicates: int = 2000
    confidence: float = 0.95

    def draw(self, places: Sequence[int]) -> np.ndarray:
        """Return replicates (run, merit, replicate) of the bootstrap.

        Parameters
        ----------
        places : of the figures of merit among `merits`
        """
        encounters = self.benchmark.truth.encounters
        return np.stack([replicate(of_run, encounters, self.replicates) for of_run in self._choose(places)])

    def evaluate(self, places: Sequence[int]) -> np.ndarray:
        """Return the means over runs (merit) of some figures of merit, without intervals.

        Parameters
        ----------
        places : of the figures of merit among `merits`
        """
        encounters = self.benchmark.truth.encounters
        mean: np.ndarray = np.stack([evaluate_all(of_run, encounters) for of_run in self._choose(places)]).mean(axis=0)
        return mean

    def _choose(self, places: Sequence[int]) -> list[list[Statistic]]:
        """Return the statistics (run, merit) of some figures of merit."""
        return [[run.merits[place].statistic for place in places] for run in self.runs]

    @cached_property
    def merits(self) -> tuple[ScoredMerit, ...]:
        """Every figure of merit with its interval."""
        encounters = self.benchmark.truth.encounters
        statistics = [[merit.statistic for merit in run.merits] for run in self.runs]
        values = np.stack([evaluate_all(of_run, encounters) for of_run in statistics])
        return tuple(
            ScoredMerit(
                merit.name, merit.unit, merit.better, merit.meaning, merit.is_compared, value, tuple(of_runs.tolist())
            )
            for merit, value, of_runs in zip(self.runs[0].merits, self._join(statistics), values.T, strict=True)
        )  # fmt: skip

    @cached_property
    def binned(self) -> tuple[tuple[Bins, dict[str, tuple[Value, ...]]], ...]:
        """Figures in bins with their intervals, by series."""
        binned = []
        for number, bins in enumerate(self.runs[0].bins):
            of_series = {}
            for name in bins.series:
                statistics = [run.bins[number].series[name] for run in self.runs]
                of_series[name] = self._join(statistics)
            binned.append((bins, of_series))
        return tuple(binned)

    def _join(self, statistics: Sequence[Sequence[Statistic]]) -> tuple[Value, ...]:
        """Return the mean over runs of statistics (run, statistic) with intervals over encounters."""
        encounters = self.benchmark.truth.encounters
        if len(statistics) == 1:
            return find_values(statistics[0], encounters, self.replicates, self.confidence)
        values = np.stack([evaluate_all(of_run, encounters) for of_run in statistics]).mean(axis=0)
        drawn = np.stack([replicate(of_run, encounters, self.replicates) for of_run in statistics]).mean(axis=0)
        joined_values = []
        for statistic, value, row in zip(statistics[0], values.tolist(), drawn, strict=True):
            frames, some = statistic.count()
            joined_values.append(Value(value, *bootstrap_interval(row, some, self.confidence), frames, some))
        return tuple(joined_values)

    @cached_property
    def confusions(self) -> tuple[Confusions, ...]:
        """Confusion matrices, summed over runs."""
        tasks = [run.classification for run in self.runs if run.classification is not None]
        if not tasks:
            return ()
        return tuple(
            Confusions(
                confusion.quantity,
                confusion.unit,
                confusion.edges,
                sum(task.confusions[k].counts for task in tasks),  # type: ignore[arg-type]
            )
            for k, confusion in enumerate(tasks[0].confusions)
        )

    def curves(self, name: str) -> list[RankingCurve]:
        """Return curves of precision and recall, one for each run.

        Parameters
        ----------
        name : of a class; empty for presence
        """
        curves = []
        for run in self.runs:
            if not name and run.presence is not None:
                curves.append(run.presence.curve)
            elif name and run.classification is not None and name in run.classification.curves:
                curves.append(run.classification.curves[name])
        return curves


def score_run(predictions: Predictions, rows: np.ndarray, benchmark: Benchmark) -> RunScores:
    """Score the predictions of one run.

    Parameters
    ----------
    rows : (frame) row of the prediction of each frame of the truth, -1 where it is missing: a failure
    """
    truth, missing = benchmark.truth, rows < 0
    classification = presence = poses = None
    class_id = None
    if predictions.class_id is not None:
        class_id = _take(predictions.class_id, rows, -1)
        scores = predictions.class_scores
        classification = score_classes(truth, class_id, None if scores is None else _take(scores, rows, -np.inf))
    if predictions.present_score is not None:
        presence = score_presence(truth, _take(predictions.present_score, rows, np.nan))
    if predictions.position_m is not None and predictions.quaternion_xyzw is not None:
        errors = find_pose_errors(
            truth,
            _take(predictions.position_m, rows, np.nan),
            _take(predictions.quaternion_xyzw, rows, np.nan),
            benchmark.surfaces,
            benchmark.symmetries,
        )
        poses = score_poses(truth, errors)
    parts = _score_parts(predictions, rows, benchmark) if "part_class_id" in predictions.pixels else None
    fine = {"oversampled_range_m", "oversampled_photons"} & set(predictions.pixels)
    ranges = _score_ranges(predictions, rows, benchmark) if fine else None
    return RunScores(predictions.name, missing, classification, presence, poses, parts, ranges, class_id)


def _take(values: np.ndarray, rows: np.ndarray, absent: float) -> np.ndarray:
    """Return values in the order of the truth, by rows (frame), which are -1 where missing."""
    taken = np.full((len(rows), *values.shape[1:]), absent, dtype=values.dtype)
    taken[rows >= 0] = values[rows[rows >= 0]]
    return taken


def _score_parts(predictions: Predictions, rows: np.ndarray, benchmark: Benchmark) -> BinnedScores:
    """Score predicted part classes."""
    counts = PartCounts(len(benchmark.truth), benchmark.part_classes)
    for at, arrays in _read_blocks(benchmark, ("part_class_id", "range_m")):
        true = arrays["part_class_id"]
        called = _take_pixels(predictions, "part_class_id", rows[at], true.shape[1:], -1)
        if called.size and not (called.min() >= -1 and called.max() < len(benchmark.part_classes)):
            raise DatasetError(
                f"{predictions.name}: part_class_id has {called.min()} to {called.max()}; give 0 to "
                f"{len(benchmark.part_classes) - 1}, and -1 for none"
            )
        counts.add(at, called, true, np.isfinite(arrays["range_m"]))
    return score_parts(benchmark.truth, counts, rows < 0)


def _score_ranges(predictions: Predictions, rows: np.ndarray, benchmark: Benchmark) -> BinnedScores:
    """Score predictions at a finer resolution."""
    errors = RangeErrors(len(benchmark.truth))
    names = tuple(name for name in ("oversampled_range_m", "oversampled_photons") if name in predictions.pixels)
    for at, arrays in _read_blocks(benchmark, names):
        for name in names:
            true = arrays[name]
            predicted = _take_pixels(predictions, name, rows[at], true.shape[1:], np.nan)
            (errors.add if name == "oversampled_range_m" else errors.add_photons)(at, predicted, true)
    return score_ranges(benchmark.truth, errors)


def _read_blocks(benchmark: Benchmark, names: Sequence[str]) -> Any:
    """Yield the numbers of some frames with arrays of them, a block at a time."""
    if benchmark.pixels is None:
        raise DatasetError(f"{benchmark.split}: holds no {names[0]}; make the dataset with it")
    for start in range(0, len(benchmark.truth), _BLOCK):
        at = np.arange(start, min(start + _BLOCK, len(benchmark.truth)))
        yield at, benchmark.pixels.read(at.tolist(), tuple(names))


def _take_pixels(
    predictions: Predictions, name: str, rows: np.ndarray, shape: tuple[int, ...], absent: float
) -> np.ndarray:
    """Return arrays of pixels in the order of the truth, by rows (frame), which are -1 where missing."""
    source = predictions.pixels[name]
    if tuple(source.shape[1:]) != tuple(shape):
        raise DatasetError(
            f"{predictions.name}: {name} has shape {tuple(source.shape)}; give (frame, {', '.join(map(str, shape))})"
        )
    taken = np.full((len(rows), *shape), absent, dtype=np.asarray(source[:0]).dtype if absent == absent else float)
    known = np.flatnonzero(rows >= 0)
    if len(known):
        order = known[np.argsort(rows[known])]
        taken[order] = source[rows[order]]  # h5py reads rows in rising order only
    return taken
