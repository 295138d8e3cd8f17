"""Errors of predictions for each pixel: parts of a target, and ranges at a finer resolution."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rso_lidar.dataset.metrics.merits import HIGHER, LOWER, BinnedScores, Bins, FigureOfMerit, find_bins, find_log_edges
from rso_lidar.dataset.metrics.weighted_statistics import Quantile, Ratios
from rso_lidar.dataset.scoring.ground_truth import FrameTruth


class PartCounts:
    """Pixels of each part class that were predicted, there, and both, frame by frame."""

    def __init__(self, frames: int, part_classes: Sequence[str]) -> None:
        """Start with no frame counted."""
        self.part_classes = tuple(part_classes)
        size = (frames, len(self.part_classes))
        self.both, self.there, self.called = (np.zeros(size, np.int64) for _ in range(3))
        self.right, self.asked = (np.zeros(frames, np.int64) for _ in range(2))

    def add(self, rows: np.ndarray, predicted: np.ndarray, true: np.ndarray, reported: np.ndarray) -> None:
        """Count the pixels of some frames.

        Parameters
        ----------
        rows : numbers of the frames
        predicted, true : part class (frame, row, col), -1 for none. A missing prediction has no part anywhere
        reported : pixels (frame, row, col) that reported a return; the others do not count
        """
        same = predicted == true
        for k in range(len(self.part_classes)):
            there, called = reported & (true == k), reported & (predicted == k)
            for total, mask in ((self.there, there), (self.called, called), (self.both, there & called)):
                total[rows, k] = mask.sum(axis=(1, 2))
        self.right[rows] = (same & reported).sum(axis=(1, 2))
        self.asked[rows] = reported.sum(axis=(1, 2))


def score_parts(truth: FrameTruth, counts: PartCounts, missing: np.ndarray) -> BinnedScores:
    """Score predicted part classes over pixels that reported a return.

    Parameters
    ----------
    counts : of the pixels
    missing : (frame) frames without a prediction, whose pixels are all wrong
    """
    all_of, asked = truth.encounters, counts.asked > 0
    union = counts.there + counts.called - counts.both
    right = np.where(missing, 0, counts.right)
    known = np.flatnonzero(counts.there.sum(axis=0) > 0)
    merits = [
        FigureOfMerit(
            "mean_iou", "1", HIGHER, "mean over part classes of intersection over union of pixels",
            Ratios(all_of, counts.both[:, known], union[:, known]),
        ),
        FigureOfMerit(
            "pixel_accuracy", "1", HIGHER, "share of reporting pixels whose part class, or none, is predicted",
            Ratios(all_of, right, counts.asked),
        ),
    ]  # fmt: skip
    merits += [
        FigureOfMerit(
            f"iou.{counts.part_classes[k]}", "1", HIGHER, f"intersection over union of pixels of {counts.part_classes[k]}",
            Ratios(all_of, counts.both[:, k], union[:, k]), False,
        )
        for k in known.tolist()
    ]  # fmt: skip
    edges = find_log_edges(truth.lit_pixels[asked])
    bins = find_bins(truth.lit_pixels, edges)
    inside = [(bins == k)[:, None] for k in range(len(edges) - 1)]
    series = [Ratios(all_of, counts.both[:, known] * mask, union[:, known] * mask) for mask in inside]
    return BinnedScores(tuple(merits), (Bins("mean_iou", "lit_pixels", "1", edges, {"mean": series}),))


class RangeErrors:
    """Errors of ranges at a finer resolution, frame by frame."""

    def __init__(self, frames: int) -> None:
        """Start with no frame counted."""
        self.square_m2, self.compared, self.there, self.false = (np.zeros(frames) for _ in range(4))
        self.photon_square, self.photon_scale = (np.zeros(frames) for _ in range(2))
        self.median_m = np.full(frames, np.nan)

    def add(self, rows: np.ndarray, predicted_m: np.ndarray, true_m: np.ndarray) -> None:
        """Compare the ranges of some frames.

        Parameters
        ----------
        rows : numbers of the frames
        predicted_m, true_m : ranges (frame, fine_row, fine_col), NaN where there is nothing
        """
        there, called = np.isfinite(true_m), np.isfinite(predicted_m)
        both = there & called
        error = np.where(both, predicted_m, 0.0).astype(float) - np.where(both, true_m, 0.0)
        self.square_m2[rows] = (error**2).sum(axis=(1, 2))
        self.compared[rows] = both.sum(axis=(1, 2))
        self.there[rows] = there.sum(axis=(1, 2))
        self.false[rows] = (called & ~there).sum(axis=(1, 2))
        for row, off, mask in zip(rows.tolist(), error, both, strict=True):
            self.median_m[row] = np.median(np.abs(off[mask])) if mask.any() else np.nan

    def add_photons(self, rows: np.ndarray, predicted: np.ndarray, true: np.ndarray) -> None:
        """Compare the photons of some frames.

        Parameters
        ----------
        rows : numbers of the frames
        predicted, true : expected photons (frame, fine_row, fine_col); a missing prediction is 0 everywhere
        """
        self.photon_square[rows] = ((np.nan_to_num(predicted).astype(float) - true) ** 2).sum(axis=(1, 2))
        self.photon_scale[rows] = (true.astype(float) ** 2).sum(axis=(1, 2))


def score_ranges(truth: FrameTruth, errors: RangeErrors) -> BinnedScores:
    """Score ranges at a finer resolution.

    Parameters
    ----------
    errors : of the pixels
    """
    all_of = truth.encounters
    union = errors.there + errors.false
    compared = errors.compared > 0
    merits = [
        FigureOfMerit(
            "fine_range_rms", "m", LOWER, "rms range error of fine pixels that are predicted and there",
            Ratios(all_of, errors.square_m2, errors.compared, root=True),
        ),
        FigureOfMerit(
            "fine_range_median", "m", LOWER, "median over frames of the median absolute range error",
            Quantile(all_of, errors.median_m, compared),
        ),
        FigureOfMerit(
            "fine_coverage", "1", HIGHER, "share of the fine pixels on the target that are predicted",
            Ratios(all_of, errors.compared, errors.there),
        ),
        FigureOfMerit(
            "fine_silhouette_iou", "1", HIGHER, "intersection over union of the predicted and the true silhouette",
            Ratios(all_of, errors.compared, union),
        ),
    ]  # fmt: skip
    if errors.photon_scale.any():
        merits.append(
            FigureOfMerit(
                "fine_photons_relative_rms", "1", LOWER, "rms error of the expected photons over their rms",
                Ratios(all_of, errors.photon_square, errors.photon_scale, root=True),
            )
        )  # fmt: skip
    edges = find_log_edges(truth.lit_pixels[errors.there > 0])
    bins = find_bins(truth.lit_pixels, edges)
    series = [
        Ratios(all_of, errors.square_m2 * (bins == k), errors.compared * (bins == k), root=True)
        for k in range(len(edges) - 1)
    ]
    return BinnedScores(tuple(merits), (Bins("fine_range_rms_m", "lit_pixels", "1", edges, {"rms": series}),))
