"""Peaks among samples: the first of a trace, or all that a valley separates.

`samples` (sample) are those of one trace, or of all traces (trace, sample); `clipped` (trace, sample) is empty without any.
"""

import numpy as np

from rso_lidar.kernels import kernel


@kernel
def smooth_sample(samples: np.ndarray, sample: int) -> np.float32:
    """Return a sample smoothed by 1, 2, 1. The first and last samples count as repeated."""
    last = samples.shape[0] - 1
    quarter = np.float32(0.25)
    inner = np.float32(0.5) * samples[sample] + quarter * samples[max(sample - 1, 0)]
    return np.float32(inner + quarter * samples[min(sample + 1, last)])


@kernel
def find_first_peak(samples: np.ndarray, start: int, least: np.float32) -> int:
    """Find the first peak of the smoothed samples that is not below `least`, or the highest sample where there is none."""
    n, sample = samples.shape[0], max(start, 0)
    before = smooth_sample(samples, sample - 1) if sample > 0 else np.float32(-np.inf)
    here = smooth_sample(samples, min(sample, n - 1))
    while sample < n:
        after = smooth_sample(samples, sample + 1) if sample < n - 1 else np.float32(-np.inf)
        if samples[sample] >= least and here >= before and here > after:
            return sample
        sample, before, here = sample + 1, here, after
    highest = 0
    for sample in range(1, n):
        highest = sample if samples[sample] > samples[highest] else highest
    return highest


@kernel
def find_highest_near(samples: np.ndarray, peak: int) -> int:
    """Return the highest of a peak and its two neighbours; the peak if they are equal."""
    highest = peak
    if peak > 0 and samples[peak - 1] > samples[highest]:
        highest = peak - 1
    if peak < samples.shape[0] - 1 and samples[peak + 1] > samples[highest]:
        highest = peak + 1
    return highest


@kernel
def locate_vertex(samples: np.ndarray, peak: int) -> float:
    """Return how far the parabola through a peak and its neighbours has its vertex behind the peak [samples]."""
    if peak < 1 or peak > samples.shape[0] - 2:
        return 0.0
    left, right = np.float64(samples[peak - 1]), np.float64(samples[peak + 1])
    bend = left - 2.0 * np.float64(samples[peak]) + right
    return min(max(0.5 * (left - right) / bend, -1.0), 1.0) if bend < 0.0 else 0.0


def raise_to_highest(samples: np.ndarray, peaks: np.ndarray) -> np.ndarray:
    """Return the highest (trace) of each peak and its two neighbours, for samples (trace, sample)."""
    highest = np.array(peaks, np.int64)
    replace_by_highest(np.ascontiguousarray(samples, np.float32), highest)
    return highest


def locate_vertices(samples: np.ndarray, peaks: np.ndarray) -> np.ndarray:
    """Return how far (trace) the vertex of each parabola is behind its peak, for samples (trace, sample)."""
    shift = np.empty(len(samples))
    fill_vertices(np.ascontiguousarray(samples, np.float32), np.array(peaks, np.int64), shift)
    return shift


@kernel
def replace_by_highest(samples: np.ndarray, peaks: np.ndarray) -> None:
    """Replace each peak (trace) by the highest of itself and its two neighbours in samples (trace, sample)."""
    for trace in range(len(peaks)):
        peaks[trace] = find_highest_near(samples[trace], peaks[trace])


@kernel
def fill_vertices(samples: np.ndarray, peaks: np.ndarray, shift: np.ndarray) -> None:
    """Write how far (trace) [samples] the vertex of each parabola is behind its peak.

    Parameters
    ----------
    samples : (trace, sample)
    peaks : (trace) sample of the peak
    shift : (trace), written
    """
    for trace in range(len(peaks)):
        shift[trace] = locate_vertex(samples[trace], peaks[trace])


@kernel
def find_plateau(clipped: np.ndarray, trace: int, peak: int) -> tuple[int, int]:
    """Find the first and last of the run of clipped samples around a trace's peak; the peak alone without such a run."""
    low, high = peak, peak
    if clipped.shape[0] and clipped[trace, peak]:
        while low > 0 and clipped[trace, low - 1]:
            low -= 1
        while high < clipped.shape[1] - 1 and clipped[trace, high + 1]:
            high += 1
    return low, high


@kernel
def is_any_clipped(clipped: np.ndarray, trace: int) -> bool:
    """Return whether a sample of the trace is clipped."""
    if clipped.shape[0]:
        for sample in range(clipped.shape[1]):
            if clipped[trace, sample]:
                return True
    return False


@kernel
def find_peaks(
    samples: np.ndarray,
    half: int,
    height_weights: np.ndarray,
    least: np.float32,
    apart: float,
    three_sigma: np.float32,
    statistic: np.ndarray,
    peaks: np.ndarray,
) -> int:
    """Find the peaks of one trace whose matched statistic is high, highest first; return how many there are.

    Parameters
    ----------
    apart : least distance of two peaks [samples]
    statistic : (sample) scratch space
    """
    n, here, before = samples.shape[0], smooth_sample(samples, 0), np.float32(-np.inf)
    any_left = False
    for sample in range(n):
        after = smooth_sample(samples, sample + 1) if sample < n - 1 else np.float32(-np.inf)
        statistic[sample] = -np.inf
        if here >= before and here > after:
            total = np.float32(0.0)
            for k in range(max(half - sample, 0), min(2 * half + 1, n - sample + half)):
                total += height_weights[k] * samples[sample - half + k]
            if total >= least:
                statistic[sample], any_left = total, True
        before, here = here, after
    n_peaks = 0
    while any_left and n_peaks < peaks.shape[0]:
        highest = 0
        for sample in range(n):
            highest = sample if statistic[sample] > statistic[highest] else highest
        any_left = statistic[highest] > -np.inf
        if any_left:
            for sample in range(n):
                if abs(sample - highest) < apart:
                    statistic[sample] = -np.inf
            stands = True
            for other in range(n_peaks):
                stands = stands and is_separated(samples, highest, peaks[other], three_sigma)
            if stands:
                peaks[n_peaks] = highest
                n_peaks += 1
    return n_peaks


@kernel
def is_separated(samples: np.ndarray, one: int, other: int, three_sigma: np.float32) -> bool:
    """Return whether a valley separates two peaks: by a tenth of the lower one, and by three sigma of the noise."""
    lower = min(smooth_sample(samples, one), smooth_sample(samples, other))
    valley = np.float32(np.inf)
    for sample in range(min(one, other) + 1, max(one, other)):
        valley = min(valley, smooth_sample(samples, sample))
    return bool(lower - valley > max(np.float32(0.1) * lower, three_sigma))
