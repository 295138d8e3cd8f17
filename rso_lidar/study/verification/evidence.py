"""Confidence bounds of quantities that depend on noise, from the frames of one or more runs.

Noise of frames is independent: frame k depends on (scenario, seed, k) only. Pixels of one frame are not, because they
share the pulse, and the geometry differs from frame to frame. So the frame is the unit of every bound. A tracker carries
its state from frame to frame, and the unit is a block of successive frames that is longer than its memory.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rso_lidar.confidence_intervals import (
    bootstrap_bounds,
    clopper_pearson_bounds,
    effective_count,
    poisson_bounds,
)
from rso_lidar.study.trades.merits import Merit, Run
from rso_lidar.study.trades.run_sums import FrameSums, RunSums, combine_sums

FEWEST_UNITS = 8  # below this, a bootstrap has too few different draws: 6435 for 8 units
_REPLICATES, _KEY = 2000, 20240917  # draws, and key of their generator: the same frames give the same bounds
_MOST_UNITS = 1000  # more frames are grouped, some successive ones to a unit
_TRIALS = {"detection_fraction": ("found", "pixels"), "found_fraction": ("hits", "frames")}
_QUANTILES = ("range_error_m",)


@dataclass(frozen=True)
class Evidence:
    """Value of a quantity with its one-sided confidence bounds, NaN where the sample gives none.

    `sample` describes the sample, `note` what the reader should know. Of a quantity without noise, both bounds are the
    value.
    """

    value: float
    low: float
    high: float
    sample: str
    note: str = ""


def bound_merit(merit: Merit, run: Run, frames: Sequence[FrameSums], confidence: float) -> Evidence:
    """Return a figure of merit of frames with its confidence bounds."""
    total = RunSums(0, 0.0)
    for frame_sums in frames:
        total.include(frame_sums)
    value = merit.of(replace(run, sums=total))
    sample = f"{len(frames):,} frame{'s' * (len(frames) != 1)}"
    if not math.isfinite(value):
        return Evidence(value, math.nan, math.nan, sample, "has no value: no pixel of these frames reports the target")
    if merit.noise == "proportion":
        hits, trials = (np.array([getattr(frame_sums, name) for frame_sums in frames]) for name in _TRIALS[merit.name])
        low, high = bound_proportion(hits, trials, confidence)
        return Evidence(value, low, high, sample)
    if merit.noise == "count":
        low, high = bound_count(np.array([frame_sums.false for frame_sums in frames]), confidence)
        return Evidence(value, low, high, sample)
    units = _group(frames)
    if len(units) < FEWEST_UNITS:
        return Evidence(value, math.nan, math.nan, sample, f"a bound needs {FEWEST_UNITS} frames or more")
    rng = np.random.Generator(np.random.Philox(key=[_KEY, len(units)]))
    weights = rng.multinomial(len(units), np.full(len(units), 1.0 / len(units)), size=_REPLICATES).astype(float)

    def values(weights: np.ndarray) -> np.ndarray:
        return np.array([float(merit.value(replace(run, sums=sums))) for sums in combine_sums(units, weights)])

    left_out = None if merit.name in _QUANTILES else values(1.0 - np.eye(len(units)))
    low, high = bootstrap_bounds(values(weights), value, confidence, left_out, len(units))
    return Evidence(value, low, high, sample, "" if math.isfinite(low) else "some draws of frames have no value")


def _group(frames: Sequence[FrameSums]) -> list[FrameSums]:
    """Group successive frames so that there are at most `_MOST_UNITS` units."""
    if len(frames) <= _MOST_UNITS:
        return list(frames)
    units = []
    for rows in np.array_split(np.arange(len(frames)), _MOST_UNITS):
        sums = RunSums(0, 0.0)
        for row in rows:
            sums.include(frames[row])
        units.append(sums.total())
    return units


def bound_proportion(hits: np.ndarray, trials: np.ndarray, confidence: float) -> tuple[float, float]:
    """Return the exact bounds of a proportion whose trials are clustered in frames (Korn and Graubard, 1998).

    The number of trials is divided by the design effect, and reduced for the degrees of freedom of that estimate.

    Parameters
    ----------
    hits, trials : (frame) successes and trials of each frame
    """
    from scipy.special import stdtrit

    total, units = float(trials.sum()), int(np.sum(trials > 0))
    if total <= 0.0:
        return math.nan, math.nan
    share, count = float(hits.sum()) / total, effective_count(hits, trials)
    if 0.0 < share < 1.0 and units > 1 and total > units:
        count *= (float(stdtrit(total - 1.0, confidence)) / float(stdtrit(units - 1.0, confidence))) ** 2
    return clopper_pearson_bounds(share, count, confidence)


def bound_count(counts: np.ndarray, confidence: float) -> tuple[float, float]:
    """Return the bounds of the mean of Poisson counts; counts that scatter more count for less (quasi-Poisson).

    Parameters
    ----------
    counts : (frame) events of each frame
    """
    total, n = float(counts.sum()), len(counts)
    scatter = float(np.var(counts, ddof=1) / np.mean(counts)) if n > 1 and total > 0.0 else 1.0
    scatter = max(scatter, 1.0)
    low, high = poisson_bounds(total / scatter, confidence)
    return low * scatter / n, high * scatter / n


def bound_series(
    runs: Sequence[np.ndarray], statistic: Callable[[np.ndarray], float], confidence: float, decimals: int
) -> Evidence:
    """Return a statistic of the errors of a tracker with its bounds, by a bootstrap of blocks (Carlstein, 1986).

    Parameters
    ----------
    runs : (frame) values of each run; NaN where there is none
    """
    known = [values[np.isfinite(values)] for values in runs]
    count, of = sum(map(len, known)), sum(map(len, runs))
    if not count:
        return Evidence(math.nan, math.nan, math.nan, f"0 of {of:,} frames", "has no value in any frame")
    together = np.concatenate(known)
    value = round(statistic(together), decimals) + 0.0
    length = max(math.ceil(integrated_time(values**2)) for values in known if len(values))
    blocks = [
        block for values in known if len(values) for block in np.array_split(values, max(len(values) // length, 1))
    ]
    sample = f"{count:,} of {of:,} frames, {len(blocks)} block{'s' * (len(blocks) != 1)} of {length}"
    if len(blocks) < FEWEST_UNITS:
        note = f"a bound needs {FEWEST_UNITS} blocks longer than the tracker's memory; fly longer, or set seeds"
        return Evidence(value, math.nan, math.nan, sample, note)
    rng = np.random.Generator(np.random.Philox(key=[_KEY, len(blocks)]))
    drawn = rng.integers(len(blocks), size=(_REPLICATES, len(blocks)))
    replicates = np.array([statistic(np.concatenate([blocks[k] for k in row])) for row in drawn])
    low, high = bootstrap_bounds(replicates, value, confidence, units=len(blocks))
    return Evidence(value, low, high, sample)


def integrated_time(values: np.ndarray) -> float:
    """Return the integrated autocorrelation time of a series [frames], at least 1 (Geyer, *Statist. Sci.* 7, 473, 1992).

    Parameters
    ----------
    values : (frame) the series
    """
    n = len(values)
    off = values - np.mean(values)
    power = float(np.sum(off**2))
    if n < 4 or not power > 0.0:
        return 1.0
    spectrum = np.fft.rfft(off, 2 * n)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2)[:n] / power
    pairs = correlation[: n // 2 * 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0.0)
    return max(1.0, 2.0 * float(pairs[: ends[0] if len(ends) else None].sum()) - 1.0)
