"""Sums over the pixels of frames, of which the figures of merit of a run are made."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar.records import Frame

_LEAST_M, _STEP, _BINS = 1e-4, 0.01, 1800  # histogram of errors: bins of 1 %, from 0.1 mm to 6.6 km
_MOST_WEIGHTS = 4_000_000  # in one block of replicates: 32 MB


@dataclass(frozen=True, eq=False)
class FrameSums:
    """Sums over the pixels of one frame, or of several.

    `pixels` counts pixels on the target, `found` those of them that report its range, and `false` pixels that report a
    range where no target is. `hits` counts the frames in which enough pixels find the target. `squared_m2` is the sum of
    the squared range errors of `found`, and `photons` that of the expected photons of `pixels`. `counts` (bin) is the
    histogram of the errors' magnitudes, which starts at bin `first`.
    """

    frames: float
    pixels: float
    found: float
    false: float
    hits: float
    squared_m2: float
    photons: float
    first: int
    counts: np.ndarray


_SUMMED = ("frames", "pixels", "found", "false", "hits", "squared_m2", "photons")


def sum_frame(frame: Frame, number: int, size_m: float, least_pixels: int) -> FrameSums:
    """Sum over the pixels of a frame.

    Parameters
    ----------
    number : index of the target
    size_m : size of the target [m]. A range error larger than that means that the pixel reported noise
    least_pixels : least number of pixels that report the target for it to be found in the frame
    """
    labels = frame.labels
    on_target = (labels.filled_fraction > 0.0) & (labels.target == number)
    error_m = np.where(frame.valid, np.asarray(frame.range_m, dtype=float), np.nan) - labels.range_m
    is_found = on_target & (np.abs(error_m) <= size_m)
    steps = np.log(np.maximum(np.abs(error_m[is_found]), _LEAST_M) / _LEAST_M) / _STEP
    bins = np.minimum(steps.astype(int), _BINS - 1)
    first = int(bins.min(initial=_BINS - 1))
    return FrameSums(
        frames=1.0,
        pixels=float(on_target.sum()),
        found=float(is_found.sum()),
        false=float((frame.valid & (labels.target < 0)).sum()),
        hits=float(is_found.sum() >= least_pixels),
        squared_m2=float(np.sum(error_m[is_found] ** 2)),
        photons=float(np.sum(labels.photons[on_target], dtype=float)),
        first=first,
        counts=np.bincount(bins - first).astype(float),
    )


class RunSums:
    """Sums and counts over the frames of a run, in constant memory."""

    def __init__(self, number: int, size_m: float, least_pixels: int = 1) -> None:
        """Start the sums of a run at 0."""
        self._of = (number, size_m, least_pixels)
        self.frames = self.pixels = self.found = self.false = self.hits = 0.0
        self.squared_m2 = self.photons = 0.0
        self._counts = np.zeros(_BINS)

    def add(self, frame: Frame) -> None:
        """Add one frame."""
        self.include(sum_frame(frame, *self._of))

    def include(self, sums: FrameSums) -> None:
        """Add the sums of one frame, or of several."""
        for name in _SUMMED:
            setattr(self, name, getattr(self, name) + getattr(sums, name))
        self._counts[sums.first : sums.first + len(sums.counts)] += sums.counts

    def total(self) -> FrameSums:
        """Return the sums as one record."""
        return FrameSums(**{name: getattr(self, name) for name in _SUMMED}, first=0, counts=self._counts.copy())

    def error_within_m(self, share: float) -> float:
        """Return the quantile of the absolute range error of detections [m], to 1 %; NaN without any."""
        if not self.found:
            return math.nan
        reached = int(np.searchsorted(np.cumsum(self._counts), share * self.found))
        return _LEAST_M * math.exp(_STEP * (reached + 0.5))


def combine_sums(parts: Sequence[FrameSums], weights: np.ndarray) -> Iterator[RunSums]:
    """Yield the sums of a run in which each part counts as often as its weight says.

    Parameters
    ----------
    weights : (replicate, part) how often each part counts
    """
    low = min(part.first for part in parts)
    high = max(part.first + len(part.counts) for part in parts)
    histogram = np.zeros((len(parts), high - low))
    for row, frame_sums in zip(histogram, parts, strict=True):
        row[frame_sums.first - low : frame_sums.first - low + len(frame_sums.counts)] = frame_sums.counts
    columns = np.array([[getattr(part, name) for name in _SUMMED] for part in parts])
    rows = max(1, _MOST_WEIGHTS // (high - low + 1))
    for start in range(0, len(weights), rows):
        some = weights[start : start + rows]
        for sums, counts in zip(some @ columns, some @ histogram, strict=True):
            total = RunSums(0, 0.0)
            total.include(FrameSums(**dict(zip(_SUMMED, sums.tolist(), strict=True)), first=low, counts=counts))
            yield total
