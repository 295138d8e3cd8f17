"""Where pulses peak among samples: the first top of each trace, or all that a valley parts."""

from __future__ import annotations

import numpy as np

from rso_lidar.detector.matched import Matched


def first_peak(samples: np.ndarray, start: np.ndarray, least: float) -> np.ndarray:
    """Return the sample of the first peak not more than one sample before `start`, after smoothing by 1, 2, 1."""
    smooth = _smoothed(samples)
    top = (samples >= least) & (np.arange(samples.shape[1]) >= start[:, None] - 1)
    top[:, 1:] &= smooth[:, 1:] >= smooth[:, :-1]
    top[:, :-1] &= smooth[:, :-1] > smooth[:, 1:]
    peak = top.argmax(axis=1)
    row = np.arange(len(samples))
    none = np.flatnonzero(~top[row, peak])
    peak[none] = samples[none].argmax(axis=1)
    return highest_near(samples, peak)


def _smoothed(samples: np.ndarray) -> np.ndarray:
    """Return the samples smoothed by 1, 2, 1, the first and last as if repeated."""
    smooth: np.ndarray = 0.5 * samples
    smooth[:, 1:] += 0.25 * samples[:, :-1]
    smooth[:, :-1] += 0.25 * samples[:, 1:]
    smooth[:, 0] += 0.25 * samples[:, 0]
    smooth[:, -1] += 0.25 * samples[:, -1]
    return smooth


def highest_near(samples: np.ndarray, peak: np.ndarray) -> np.ndarray:
    """Return the highest of each peak and its two neighbours."""
    row, last = np.arange(len(samples)), samples.shape[1] - 1
    near = np.stack([peak, np.maximum(peak - 1, 0), np.minimum(peak + 1, last)])
    highest: np.ndarray = near[samples[row, near].argmax(axis=0), row]
    return highest


def middle_of_plateau(clipped: np.ndarray, peak: np.ndarray, guess: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return peak and guess moved to the middle of the run of clipped samples that the peak is in."""
    low, high, last = peak.copy(), peak.copy(), clipped.shape[1] - 1
    rows = np.flatnonzero(clipped[np.arange(len(peak)), peak])
    moving = rows
    while len(moving):
        moving = moving[(low[moving] > 0) & clipped[moving, np.maximum(low[moving] - 1, 0)]]
        low[moving] -= 1
    moving = rows
    while len(moving):
        moving = moving[(high[moving] < last) & clipped[moving, np.minimum(high[moving] + 1, last)]]
        high[moving] += 1
    wide = high > low
    return np.where(wide, (low + high) // 2, peak), np.where(wide, 0.5 * (low + high), guess)


def vertex(samples: np.ndarray, peak: np.ndarray) -> np.ndarray:
    """Return how far the vertex of the parabola through the peak and its neighbours lies behind the peak [samples]."""
    row = np.arange(len(samples))
    middle = np.clip(peak, 1, samples.shape[1] - 2)
    left, top, right = (samples[row, middle + k].astype(float) for k in (-1, 0, 1))
    bend = left - 2.0 * top + right
    shift = np.divide(0.5 * (left - right), bend, out=np.zeros_like(bend), where=bend < 0.0)
    return np.where(middle == peak, np.clip(shift, -1.0, 1.0), 0.0)


def peaks_of(
    samples: np.ndarray, matched: Matched, threshold_counts: float, sigma_counts: float, most: int
) -> np.ndarray:
    """Return the samples (trace, most) of peaks whose matched statistic is high, highest first, −1 where there are fewer.

    Peaks are looked for in the samples, smoothed by 1, 2, 1, which part two pulses better than the statistic does; the
    bumps of one long pulse, from a tilted surface, have no valley between them. The statistic at a sample may be
    somewhat below that at the peak: the threshold itself is for the fit.
    """
    n, row = samples.shape[1], np.arange(len(samples))
    smooth = _smoothed(samples)
    top = np.ones(samples.shape, bool)
    top[:, 1:] &= smooth[:, 1:] >= smooth[:, :-1]
    top[:, :-1] &= smooth[:, :-1] > smooth[:, 1:]
    statistic = np.where(top, matched.statistic(samples), -np.inf)
    statistic[statistic < 0.8 * threshold_counts] = -np.inf
    peaks = np.full((len(samples), most), -1)
    found = np.zeros(len(samples), np.intp)
    apart = max(1.0, matched.fwhm - 1.0)  # a place on the grid is good to half a sample
    while len(row):
        highest = statistic[row].argmax(axis=1)
        seen = np.isfinite(statistic[row, highest]) & (found[row] < most)
        row, highest = row[seen], highest[seen]
        statistic[row] = np.where(np.abs(np.arange(n) - highest[:, None]) < apart, -np.inf, statistic[row])
        parted = np.ones(len(row), bool)
        for slot in range(int(found[row].max(initial=0))):
            others = np.flatnonzero(peaks[row, slot] >= 0)
            parted[others] &= _parted(smooth[row[others]], highest[others], peaks[row[others], slot], sigma_counts)
        new = row[parted]
        peaks[new, found[new]] = highest[parted]
        found[new] += 1
    return peaks


def _parted(smooth: np.ndarray, one: np.ndarray, other: np.ndarray, sigma_counts: float) -> np.ndarray:
    """Return whether a valley parts two peaks: a tenth of the lower one, and three sigma of the noise."""
    row, sample = np.arange(len(smooth)), np.arange(smooth.shape[1])
    between = (sample > np.minimum(one, other)[:, None]) & (sample < np.maximum(one, other)[:, None])
    valley = np.where(between, smooth, np.inf).min(axis=1)
    lower = np.minimum(smooth[row, one], smooth[row, other])
    parted: np.ndarray = lower - valley > np.maximum(0.1 * lower, 3.0 * sigma_counts)
    return parted
