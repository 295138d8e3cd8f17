"""How the centroid of a recorded target wanders about the target's origin: its size and its correlation time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.evaluation.track_quality.evaluation import Tracking
from rso_lidar.rpo import CentroidWander

_FEWEST = 20  # fixes
_UNEVEN = 0.01  # relative, by which steps of time may differ
_LONGEST = 0.5  # greatest lag, as a fraction of the recording


@dataclass(frozen=True, eq=False)
class MeasuredWander:
    """The wander of the centroid in a recording, about its own mean.

    Parameters
    ----------
    centroid : as a part of a navigation sensor
    mean_m : (3,) mean of centroid minus origin along the line of sight (away from the lidar), and across it [m]
    lag_s, correlation : (lag,) times [s] and the autocorrelation there, of three axes together; at 0 of what is not white
    lengths : length of the recording in correlation times
    """

    centroid: CentroidWander
    mean_m: np.ndarray
    lag_s: np.ndarray
    correlation: np.ndarray
    lengths: float

    def describe(self) -> str:
        """Describe the wander in one line."""
        part = self.centroid
        return (
            f"wanders by {part.along_sigma_m:.3f} m along and {part.across_sigma_m:.3f} m across the line of sight "
            f"(1 sigma), around {self.mean_m[0]:+.3f} m along; correlation time {part.correlation_time_s:.3g} s, "
            f"of which the recording has {self.lengths:.0f}"
        )


def measure_centroid_wander(tracked: Tracking) -> MeasuredWander:
    """Measure how the centroid of a target wanders in a recording, by the truth that the recording holds.

    The correlation time is that in which the autocorrelation of the three axes together falls to 1/e. White noise is left
    out: it is the part of the variance that the autocorrelation, extrapolated from the first two lags to 0, does not have.
    A standard deviation has a relative error of about one over the root of the number of correlation times.

    Parameters
    ----------
    tracked : trackers run on the recording; `tracking` with ``poses=False`` suffices

    Returns
    -------
    MeasuredWander

    Raises
    ------
    RecordingError
        For too few fixes, frames at uneven steps, a centroid that does not wander, and one whose correlation lasts beyond
        half of the recording
    """
    table, axes = tracked.table, Tracking.AXES
    time_s = table["time_s"]
    offset = np.stack([table[f"centroid_error_{axis}_m"] for axis in axes], axis=1)
    known = np.isfinite(offset).all(axis=1)
    if known.sum() < _FEWEST:
        raise RecordingError(f"centroid wander: {known.sum()} fixes are fewer than {_FEWEST}; take more frames")
    middle = np.stack([table[f"centroid_{axis}_m"] for axis in axes], axis=1)
    steps_s = np.diff(time_s)
    step_s = float(np.median(steps_s))
    if np.abs(steps_s / step_s - 1.0).max() > _UNEVEN:
        raise RecordingError("centroid wander: the frames are at uneven steps of time; take each, or each n-th")
    along = middle - offset
    along /= np.linalg.norm(along, axis=1)[:, None]
    right = np.cross([0.0, 1.0, 0.0], along)
    right /= np.linalg.norm(right, axis=1)[:, None]
    triad = np.stack([along, right, np.cross(along, right)], axis=1)
    parts = np.einsum("tij,tj->ti", triad, offset)
    mean_m = np.nanmean(parts, axis=0)
    lags = np.arange(int(_LONGEST * (len(time_s) - 1)) + 1)
    covariance = np.array([_correlate(parts - mean_m, lag) for lag in lags.tolist()])
    slow = np.clip(2.0 * covariance[1] - covariance[2], np.maximum(covariance[1], 0.0), covariance[0])
    total = float(slow.sum())
    # An autocorrelation of white noise has a standard deviation of one over the root of the number of fixes.
    if total <= 3.0 * float(covariance[0].sum()) / math.sqrt(known.sum()):
        raise RecordingError("centroid wander: the offset is white from frame to frame; there is no wander to measure")
    correlation = covariance.sum(axis=1) / total
    correlation[0] = 1.0
    below = np.flatnonzero(correlation < math.exp(-1.0))
    if not len(below):
        raise RecordingError(
            f"centroid wander: still correlated by {correlation[-1]:.2f} after {lags[-1] * step_s:g} s; record longer"
        )
    last = int(below[0])
    before, after = correlation[last - 1], correlation[last]
    time_of_decay_s = step_s * (last - 1 + (before - math.exp(-1.0)) / (before - after))
    centroid = CentroidWander(
        along_sigma_m=float(np.sqrt(slow[0])),
        across_sigma_m=float(np.sqrt(0.5 * (slow[1] + slow[2]))),
        correlation_time_s=time_of_decay_s,
    )
    return MeasuredWander(centroid, mean_m, lags * step_s, correlation, float(time_s[-1] - time_s[0]) / time_of_decay_s)


def _correlate(parts: np.ndarray, lag: int) -> np.ndarray:
    """Return the mean products (3,) of deviations (time, 3) that are a number of steps apart."""
    pairs = parts[lag:] * parts[: len(parts) - lag]
    kept = pairs[np.isfinite(pairs).all(axis=1)]
    return kept.mean(axis=0) if len(kept) else np.zeros(3)
