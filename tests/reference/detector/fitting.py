"""Fits of the matched filter in NumPy, all traces at once: the oracle of `rso_lidar.detector.ranging.fitting`."""

import numpy as np

from rso_lidar.detector.ranging.matched_filter import PHASES, ROUNDS, ROUNDS_CLIPPED, Matched
from tests.reference.detector.peaks import locate_vertices, raise_to_highest


def fit_first_pulses(samples, start, least, matched, clipped):
    """Return the sample of the first peak of each trace, and place [samples] and height fitted there."""
    peak = first_peak(samples, np.asarray(start), least)
    guess = peak + locate_vertices(samples, peak)
    if clipped is not None:
        peak, guess = middle_of_plateau(clipped, peak, guess)
    return peak, *fit(matched, samples, guess, clipped)


def fit_all_pulses(
    samples: np.ndarray,
    matched: Matched,
    threshold_counts: float,
    sigma_counts: float,
    most: int,
    clipped: np.ndarray | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which of `most` pulses (trace, slot) there are, and place [samples] and height of each."""
    peaks = peaks_of(samples, matched, threshold_counts, sigma_counts, most)
    place = np.full(peaks.shape, np.nan)
    height = np.zeros(peaks.shape)
    alive = peaks >= 0
    place[alive] = peaks[alive]
    for sweep in range(4):
        several = alive.sum(axis=1) > 1
        for slot in range(most):
            rows = np.flatnonzero(alive[:, slot] & several if sweep else alive[:, slot])
            alone = subtract_others(samples[rows], matched, place[rows], height[rows], slot)
            mask = None if clipped is None else clipped[rows]
            guess = place[rows, slot]
            if sweep == 0:
                peak = raise_to_highest(alone, peaks[rows, slot])
                guess = peak + locate_vertices(alone, peak)
                if mask is not None:
                    guess = middle_of_plateau(mask, peak, guess)[1]
            place[rows, slot], height[rows, slot] = fit(matched, alone, guess, mask)
        if sweep == 1:
            alive &= height >= threshold_counts
            alive &= ~_shadowed(place, height, 0.75 * matched.fwhm)
            place[~alive], height[~alive] = np.nan, 0.0
    return alive & (height >= threshold_counts), place, height


def _shadowed(place: np.ndarray, height: np.ndarray, apart: float) -> np.ndarray:
    """Return which pulses (trace, slot) stand closer than `apart` [samples] to a higher one."""
    with np.errstate(invalid="ignore"):
        near = np.abs(place[:, :, None] - place[:, None, :]) < apart
    shadowed: np.ndarray = (near & (height[:, :, None] < height[:, None, :])).any(axis=2)
    return shadowed


def fit(
    matched: Matched, samples: np.ndarray, guess: np.ndarray, clipped: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return place of the peak [samples] and height of the pulse nearest to `guess` (row) [samples]."""
    place, height = _climb(matched, samples, guess, None, ROUNDS)
    if clipped is not None:
        some = np.flatnonzero(clipped.any(axis=1))
        place[some], height[some] = _climb(matched, samples[some], guess[some], clipped[some], ROUNDS_CLIPPED)
    lost = np.flatnonzero(~((height > 0.0) & (np.abs(place - guess) <= max(1.0, matched.fwhm))))
    place[lost] = guess[lost]
    height[lost] = samples[lost, np.clip(np.rint(guess[lost]).astype(np.intp), 0, samples.shape[1] - 1)]
    return place, height


def _climb(
    matched: Matched, samples: np.ndarray, guess: np.ndarray, clipped: np.ndarray | None, rounds: int
) -> tuple[np.ndarray, np.ndarray]:
    n, row = samples.shape[1], np.arange(len(samples))
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(samples, ((0, 0), (matched.half, matched.half))), matched.width, axis=1
    )
    free = np.pad(np.ones((1, n), bool) if clipped is None else ~clipped, ((0, 0), (matched.half, matched.half)))
    inside = np.lib.stride_tricks.sliding_window_view(
        np.pad(np.ones(n, bool), (matched.half, matched.half)), matched.width
    )
    usable = np.lib.stride_tricks.sliding_window_view(free, matched.width, axis=1)
    place, height = guess.astype(float), np.zeros(len(samples))
    for _ in range(rounds if len(samples) else 0):
        step = np.rint(place * PHASES).astype(np.intp) + PHASES // 2
        middle = np.clip(step // PHASES, 0, n - 1)
        phase = np.clip(step - middle * PHASES, 0, PHASES - 1)
        if clipped is None:
            patterns, pattern = inside[middle.min() : middle.max() + 1], middle - middle.min()
        else:
            patterns, pattern = _patterns(matched, usable[row, middle], inside[middle])
        weights = np.stack([matched.solve_weights(used) for used in patterns])[pattern, phase]
        found = np.einsum("tk,tck->tc", windows[row, middle], weights, dtype=float)
        height = found[:, 0]
        shift = np.divide(found[:, 1], height, out=np.zeros_like(height), where=height > 0.0)
        here = middle + (phase - PHASES // 2) / PHASES
        place = np.clip(here + np.clip(shift, -0.75, 0.75), -0.5, n - 0.5)
    return place, height


def _patterns(matched: Matched, usable: np.ndarray, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the different patterns (pattern, width) of samples to use, and which of them each row has."""
    few = (usable & matched.in_pulse).sum(axis=1) < 3
    usable = np.where(few[:, None], inside, usable)
    packed = np.packbits(usable, axis=1)
    _, first, pattern = np.unique(packed.view(f"V{packed.shape[1]}").ravel(), return_index=True, return_inverse=True)
    return usable[first], pattern.ravel()


def statistic(matched: Matched, samples: np.ndarray) -> np.ndarray:
    """Return the fitted height of a pulse that would peak at each sample; float32, what is outside counts as zero."""
    n = samples.shape[1]
    padded = np.pad(samples, ((0, 0), (matched.half, matched.half)))
    total = np.zeros(samples.shape, np.float32)
    for k, weight in enumerate(matched.height_weights()):
        total += np.float32(weight) * padded[:, k : k + n]
    return total


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
    return raise_to_highest(samples, peak)


def _smoothed(samples: np.ndarray) -> np.ndarray:
    """Return the samples smoothed by 1, 2, 1, the first and last as if repeated."""
    smooth: np.ndarray = 0.5 * samples
    smooth[:, 1:] += 0.25 * samples[:, :-1]
    smooth[:, :-1] += 0.25 * samples[:, 1:]
    smooth[:, 0] += 0.25 * samples[:, 0]
    smooth[:, -1] += 0.25 * samples[:, -1]
    return smooth


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
    height = np.where(top, statistic(matched, samples), -np.inf)
    height[height < 0.8 * threshold_counts] = -np.inf
    peaks = np.full((len(samples), most), -1)
    found = np.zeros(len(samples), np.intp)
    apart = max(1.0, matched.fwhm - 1.0)  # a place on the grid is good to half a sample
    while len(row):
        highest = height[row].argmax(axis=1)
        seen = np.isfinite(height[row, highest]) & (found[row] < most)
        row, highest = row[seen], highest[seen]
        height[row] = np.where(np.abs(np.arange(n) - highest[:, None]) < apart, -np.inf, height[row])
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


def subtract_others(
    samples: np.ndarray, matched: Matched, place: np.ndarray, height: np.ndarray, slot: int
) -> np.ndarray:
    """Return the samples without all fitted pulses but that of `slot`.

    Parameters
    ----------
    samples : (trace, sample) [counts].
    matched : the filter.
    place, height : (trace, slot) of the fitted pulses [samples] and [counts].
    slot : the pulse that stays.
    """
    alone = samples.copy()
    for other in range(place.shape[1]):
        rows = np.flatnonzero(height[:, other] > 0.0) if other != slot else np.zeros(0, np.intp)
        if len(rows):
            curve = matched.curve(samples.shape[1], place[rows, other])
            alone[rows] -= height[rows, other, None].astype(np.float32) * curve
    return alone
