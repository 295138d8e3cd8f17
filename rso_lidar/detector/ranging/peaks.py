"""Where pulses peak among samples: the first top of a trace, or all that a valley parts."""

import numpy as np

from rso_lidar.kernels import kernel


@kernel
def smoothed(samples: np.ndarray, sample: int) -> np.float32:
    """Return a sample smoothed by 1, 2, 1, the first and last as if repeated."""
    last = samples.shape[0] - 1
    quarter = np.float32(0.25)
    inner = np.float32(0.5) * samples[sample] + quarter * samples[max(sample - 1, 0)]
    return np.float32(inner + quarter * samples[min(sample + 1, last)])


@kernel
def first_peak(samples: np.ndarray, start: int, least: np.float32) -> int:
    """Return the first top of the smoothed samples from `start` on that is not below `least`, or the highest sample."""
    n, sample = samples.shape[0], max(start, 0)
    before = smoothed(samples, sample - 1) if sample > 0 else np.float32(-np.inf)
    here = smoothed(samples, min(sample, n - 1))
    while sample < n:
        after = smoothed(samples, sample + 1) if sample < n - 1 else np.float32(-np.inf)
        if samples[sample] >= least and here >= before and here > after:
            return sample
        sample, before, here = sample + 1, here, after
    highest = 0
    for sample in range(1, n):
        highest = sample if samples[sample] > samples[highest] else highest
    return highest


@kernel
def highest_near(samples: np.ndarray, peak: int) -> int:
    """Return the highest of a peak and its two neighbours, the peak itself where they are no higher."""
    highest = peak
    if peak > 0 and samples[peak - 1] > samples[highest]:
        highest = peak - 1
    if peak < samples.shape[0] - 1 and samples[peak + 1] > samples[highest]:
        highest = peak + 1
    return highest


@kernel
def vertex(samples: np.ndarray, peak: int) -> float:
    """Return how far the vertex of the parabola through the peak and its neighbours lies behind the peak [samples]."""
    if peak < 1 or peak > samples.shape[0] - 2:
        return 0.0
    left, right = np.float64(samples[peak - 1]), np.float64(samples[peak + 1])
    bend = left - 2.0 * np.float64(samples[peak]) + right
    return min(max(0.5 * (left - right) / bend, -1.0), 1.0) if bend < 0.0 else 0.0


@kernel
def plateau(clipped: np.ndarray, trace: int, peak: int) -> tuple[int, int]:
    """Return the first and last of the run of clipped samples that the peak is in; the peak alone without."""
    low, high = peak, peak
    if clipped.shape[0] and clipped[trace, peak]:
        while low > 0 and clipped[trace, low - 1]:
            low -= 1
        while high < clipped.shape[1] - 1 and clipped[trace, high + 1]:
            high += 1
    return low, high


@kernel
def any_of(clipped: np.ndarray, trace: int) -> bool:
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
    """Fill `peaks` with the tops whose matched statistic is high, highest first, and return how many there are."""
    n, here, before = samples.shape[0], smoothed(samples, 0), np.float32(-np.inf)
    any_left = False
    for sample in range(n):
        after = smoothed(samples, sample + 1) if sample < n - 1 else np.float32(-np.inf)
        statistic[sample] = -np.inf
        if here >= before and here > after:
            total = np.float32(0.0)
            for k in range(max(half - sample, 0), min(2 * half + 1, n - sample + half)):
                total += height_weights[k] * samples[sample - half + k]
            if total >= least:
                statistic[sample], any_left = total, True
        before, here = here, after
    found = 0
    while any_left and found < peaks.shape[0]:
        highest = 0
        for sample in range(n):
            highest = sample if statistic[sample] > statistic[highest] else highest
        any_left = statistic[highest] > -np.inf
        if any_left:
            for sample in range(n):
                if abs(sample - highest) < apart:
                    statistic[sample] = -np.inf
            stands = True
            for other in range(found):
                stands = stands and parted(samples, highest, peaks[other], three_sigma)
            if stands:
                peaks[found] = highest
                found += 1
    return found


@kernel
def parted(samples: np.ndarray, one: int, other: int, three_sigma: np.float32) -> bool:
    """Return whether a valley parts two peaks: a tenth of the lower one, and three sigma of the noise."""
    lower = min(smoothed(samples, one), smoothed(samples, other))
    valley = np.float32(np.inf)
    for sample in range(min(one, other) + 1, max(one, other)):
        valley = min(valley, smoothed(samples, sample))
    return bool(lower - valley > max(np.float32(0.1) * lower, three_sigma))
