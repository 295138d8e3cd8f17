"""Figures of merit of a classifier: accuracy, average precision, confusion, recall against light (Fuller et al., sec. 5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rso_lidar.dataset.metrics.merits import (
    HIGHER,
    LOWER,
    Bins,
    FigureOfMerit,
    find_bins,
    find_even_edges,
    find_log_edges,
)
from rso_lidar.dataset.metrics.precision_recall import AveragePrecision, RankingCurve
from rso_lidar.dataset.metrics.resampling import EncounterIndex
from rso_lidar.dataset.metrics.weighted_statistics import FrameStatistic, Mean, Ratios, in_chunks
from rso_lidar.dataset.scoring.ground_truth import FrameTruth

RELIABLE_PIXELS = 100  # Fuller et al., sec. 5: about 100 pixels are needed for reliable classification
RELIABLE_RECALL = 0.9
ALL = "all classes"
_FEWEST_ABOVE, _SHARE_ABOVE = 10, 0.05  # frames, and share of all frames, that a level is to hold for
_PARTS = 3  # bins of the confusion matrices by range and by light


@dataclass(frozen=True, eq=False)
class Confusions:
    """Counts (bin, true class, predicted class) in bins of a quantity; the last column counts missing predictions."""

    quantity: str
    unit: str
    edges: np.ndarray
    counts: np.ndarray


@dataclass(frozen=True, eq=False)
class Classification:
    """Scores of a classifier: its figures of merit, bins, curves by class (where there are scores) and confusions."""

    merits: tuple[FigureOfMerit, ...]
    bins: tuple[Bins, ...]
    curves: dict[str, RankingCurve]
    confusions: tuple[Confusions, ...]


@dataclass(frozen=True, eq=False)
class PassingLevel(FrameStatistic):
    """Least value (frame) of a quantity from which the share of hits is `level` or more; infinite if it never is.

    The share is fitted as a function that never falls, by isotonic regression, so that no bins have to be chosen. Its last
    step follows a few lucky frames: a level that only they reach is not reached.
    """

    encounters: EncounterIndex
    quantity: np.ndarray
    hit: np.ndarray
    asked: np.ndarray
    level: float = RELIABLE_RECALL
    _order: tuple[np.ndarray, np.ndarray, np.ndarray] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        rows = np.flatnonzero(self.asked)
        rows = rows[np.argsort(self.quantity[rows], kind="stable")]
        levels, starts = np.unique(self.quantity[rows], return_index=True)
        object.__setattr__(self, "_order", (rows, levels, starts))

    def evaluate(self, weights: np.ndarray) -> np.ndarray:
        """Return the values (replicate) for weights (replicate, encounter)."""
        from scipy.optimize import isotonic_regression

        rows, levels, starts = self._order
        if not len(rows):
            return np.full(len(weights), np.nan)
        hit = self.hit[rows].astype(float)

        def find(of_frames: np.ndarray) -> np.ndarray:
            hits, trials = (np.add.reduceat(part, starts, axis=1) for part in (of_frames * hit, of_frames))
            passing_levels = np.full(len(of_frames), np.inf)
            for number, (good, total) in enumerate(zip(hits, trials, strict=True)):
                there = np.flatnonzero(total > 0)
                if not len(there):
                    continue
                fitted = isotonic_regression(good[there] / total[there], weights=total[there]).x
                above = np.flatnonzero(fitted >= self.level - 1e-9)
                if len(above) and total[there[above[0]] :].sum() >= max(_FEWEST_ABOVE, _SHARE_ABOVE * total.sum()):
                    passing_levels[number] = levels[there[above[0]]]
            return passing_levels

        return in_chunks(weights, self.encounters.index[rows], find)


def score_classes(truth: FrameTruth, chosen: np.ndarray, scores: np.ndarray | None = None) -> Classification:
    """Score predicted classes.

    Parameters
    ----------
    truth : of the frames; those without a target, or with too few lit pixels, do not matter
    chosen : (frame) number of the predicted class, -1 where the prediction is missing: a failure
    scores : (frame, class) scores, minus infinity where missing; None where only classes were predicted
    """
    asked = truth.is_lit
    right = asked & (chosen == truth.class_id)
    of_class = {
        name: asked & (truth.class_id == k) for k, name in enumerate(truth.classes) if (truth.class_id == k).any()
    }
    merits = [
        _make_share("accuracy", "share of frames whose class is predicted", truth.encounters, right, asked),
        FigureOfMerit(
            "balanced_accuracy", "1", HIGHER, "mean over classes of the recall",
            _take_columns(truth.encounters, right, [*of_class.values()]), is_compared=False,
        ),
    ]  # fmt: skip
    strong = asked & (truth.reporting_pixels >= RELIABLE_PIXELS)
    if strong.any():
        meaning = f"accuracy of frames in which {RELIABLE_PIXELS} pixels or more of the target reported"
        merits.append(_make_share("accuracy_100_pixels", meaning, truth.encounters, right, strong))
    curves: dict[str, RankingCurve] = {}
    if scores is not None:
        numbers = {name: k for k, name in enumerate(truth.classes)}
        ranked = {
            name: AveragePrecision(truth.encounters, scores[:, numbers[name]], rows, asked)
            for name, rows in of_class.items()
        }
        curves = {name: ranking.trace() for name, ranking in ranked.items()}
        merits.append(
            FigureOfMerit(
                "macro_average_precision", "1", HIGHER, "mean over classes of the average precision",
                Mean(tuple(ranked.values())),
            )
        )  # fmt: skip
        merits += [
            FigureOfMerit(
                f"average_precision.{name}",
                "1",
                HIGHER,
                f"average precision of {name} against the rest",
                ranking,
                False,
            )
            for name, ranking in ranked.items()
        ]
    for name, rows in of_class.items():
        called = asked & (chosen == truth.classes.index(name))
        meaning = f"share of the frames of {name} that are called {name}"
        merits.append(_make_share(f"recall.{name}", meaning, truth.encounters, right, rows, is_compared=False))
        meaning = f"share of the frames called {name} that are {name}"
        merits.append(_make_share(f"precision.{name}", meaning, truth.encounters, right, called, is_compared=False))
    groups = {ALL: asked, **of_class}
    merits += [
        FigureOfMerit(
            f"pixels_for_recall_90{'' if name == ALL else f'.{name}'}", "1", LOWER,
            f"lit pixels from which the recall of {name} is {RELIABLE_RECALL:.0%} or more",
            PassingLevel(truth.encounters, truth.lit_pixels.astype(float), right, rows), is_compared=False,
        )
        for name, rows in groups.items()
    ]  # fmt: skip
    return Classification(
        tuple(merits),
        tuple(_bin_recall(truth, right, groups)),
        curves,
        tuple(_count_confusions(truth, chosen, asked)),
    )


def _make_share(
    name: str, meaning: str, encounters: EncounterIndex, right: np.ndarray, asked: np.ndarray, is_compared: bool = True
) -> FigureOfMerit:
    """Make the figure of merit of the share of right frames (frame) among those asked (frame)."""
    statistic = Ratios(encounters, right & asked, asked, is_proportion=True)
    return FigureOfMerit(name, "1", HIGHER, meaning, statistic, is_compared)


def _take_columns(encounters: EncounterIndex, right: np.ndarray, groups: Sequence[np.ndarray]) -> Ratios:
    """Return the mean share of right frames (frame) over groups, masks (frame)."""
    below = np.stack(groups, axis=1) if len(groups) else np.zeros((len(right), 1), bool)
    return Ratios(encounters, below & right[:, None], below)


def _bin_recall(truth: FrameTruth, right: np.ndarray, groups: dict[str, np.ndarray]) -> list[Bins]:
    """Make recall in bins of lit pixels, range and light, for all classes and for each, by masks (frame)."""
    binned = []
    for quantity, unit, values, edges in (
        ("lit_pixels", "1", truth.lit_pixels, find_log_edges(truth.lit_pixels[groups[ALL]])),
        ("range", "m", truth.range_to_target_m, find_even_edges(truth.range_to_target_m[groups[ALL]], 8)),
        ("total_photons", "1", truth.total_photons, find_log_edges(truth.total_photons[groups[ALL]])),
    ):
        bins = find_bins(values, edges)
        series = {
            name: [
                Ratios(truth.encounters, right & rows & (bins == k), rows & (bins == k), is_proportion=True)
                for k in range(len(edges) - 1)
            ]
            for name, rows in groups.items()
        }
        binned.append(Bins("recall", quantity, unit, edges, series))
    return binned


def _count_confusions(truth: FrameTruth, chosen: np.ndarray, asked: np.ndarray) -> list[Confusions]:
    """Count confusions of predicted classes (frame), over all asked frames, and in three bins of range and of light."""
    size = len(truth.classes)
    confusions = []
    for quantity, unit, values, parts in (
        ("all", "1", np.zeros(len(asked)), 1),
        ("range", "m", truth.range_to_target_m, _PARTS),
        ("total_photons", "1", truth.total_photons, _PARTS),
    ):
        edges = find_even_edges(values[asked], parts)
        bins = find_bins(values, edges)
        counts = np.zeros((len(edges) - 1, size, size + 1), dtype=np.int64)
        rows = np.flatnonzero(asked & (bins >= 0))
        called = np.where(chosen[rows] < 0, size, chosen[rows])
        np.add.at(counts, (bins[rows], truth.class_id[rows], called), 1)
        confusions.append(Confusions(quantity, unit, edges, counts))
    return confusions
