"""Figures of merit of a detector that says whether a target is in the frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar.dataset.metrics.merits import HIGHER, LOWER, FigureOfMerit
from rso_lidar.dataset.metrics.precision_recall import AveragePrecision, FalseAlarmRate, RankingCurve, RocArea
from rso_lidar.dataset.scoring.ground_truth import FrameTruth


@dataclass(frozen=True, eq=False)
class Presence:
    """Scores of a detector: its figures of merit, and its curve over thresholds."""

    merits: tuple[FigureOfMerit, ...]
    curve: RankingCurve


def score_presence(truth: FrameTruth, score: np.ndarray) -> Presence:
    """Score the confidence that a target is in the frame.

    Parameters
    ----------
    truth : of the frames; a frame counts as one with a target where enough pixels are lit
    score : (frame) higher where a target is more likely, and NaN where the prediction is missing. A missing prediction
        is a failure: a miss in a frame with a target, and a false alarm at every threshold in an empty one
    """
    empty = truth.present == 0
    full = (truth.present > 0) & (truth.lit_pixels >= truth.min_lit_pixels)
    filled = np.where(np.isnan(score), np.where(empty, np.inf, -np.inf), score)
    ranking = (truth.encounters, filled, full, full | empty)
    rate = FalseAlarmRate(*ranking)
    merits = (
        FigureOfMerit(
            "presence_average_precision", "1", HIGHER, "average precision of frames with a target against empty ones",
            AveragePrecision(*ranking),
        ),
        FigureOfMerit(
            "presence_roc_area", "1", HIGHER, "probability that a frame with a target has the higher score of two",
            RocArea(*ranking), is_compared=False,
        ),
        FigureOfMerit(
            "false_alarms_at_recall_95", "1", LOWER,
            f"share of empty frames called full where {rate.recall:.0%} of full ones are", rate,
        ),
    )  # fmt: skip
    return Presence(merits, rate.trace())
