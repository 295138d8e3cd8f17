"""Fits of the matched filter, trace by trace: of the first pulse, or of all of them.

`samples` (trace, sample) are float32, and `clipped` (trace, sample) marks those at the rail: None without any, and empty in
kernels. A trace that needs a pattern of samples without known weights writes its key to `unknown` (trace). Kernels take
single arrays rather than tuples of arrays: references to those would be counted for each trace, which takes a third more
time.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rso_lidar.detector.ranging.gauss_newton import fit_pulse
from rso_lidar.detector.ranging.matched_filter import ROUNDS, ROUNDS_CLIPPED, Known, Matched
from rso_lidar.detector.ranging.peaks import (
    find_first_peak,
    find_highest_near,
    find_peaks,
    find_plateau,
    is_any_clipped,
    locate_vertex,
)
from rso_lidar.kernels import kernel, packed

_ROUNDS = np.array([ROUNDS, ROUNDS_CLIPPED])


class Filter(NamedTuple):
    """A matched filter as kernels take it.

    Parameters
    ----------
    rounds : (2) iterations of a trace without clipped samples, and with
    half : half the window [samples]
    fwhm : of the pulse [samples]
    codes : (3, width + 1) how samples of the window make the key of a pattern, and which are in the pulse
    known : patterns with their weights
    """

    rounds: np.ndarray
    half: int
    fwhm: float
    codes: np.ndarray
    known: Known


class Curve(NamedTuple):
    """A pulse of unit peak as a `table`, which begins `from_step` of its steps after the peak."""

    table: np.ndarray
    from_step: float
    steps_per_sample: float


class Pulses(NamedTuple):
    """Fitted pulses (trace, slot): whether there is one, its place [samples] and its height."""

    alive: np.ndarray
    place: np.ndarray
    height: np.ndarray


def fit_first_pulses(
    samples: np.ndarray, start: np.ndarray, least: float, matched: Matched, clipped: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the sample of the first peak of each trace, and place [samples] and height fitted there.

    Parameters
    ----------
    start : (trace) the peak comes at most one sample before
    least : lowest sample that can be a peak
    """
    peak, place, height, unknown = (np.empty(len(samples), kind) for kind in (np.int64, float, float, np.int64))
    start, mask = packed(start, np.int64), _mask(clipped)

    def fill(fitter: Filter) -> None:
        fit_first(samples, start, np.float32(least), mask, fitter, peak, place, height, unknown)

    _fill_with_known_weights(matched, fill, clipped, samples.shape[1], unknown, place)
    return peak, place, height


def fit_all_pulses(
    samples: np.ndarray,
    matched: Matched,
    threshold_counts: float,
    sigma_counts: float,
    most: int,
    clipped: np.ndarray | None,
) -> Pulses:
    """Return which of `most` pulses (trace, slot) there are, and place [samples] and height of each."""
    shape, pulse = (len(samples), most), matched.pulse
    pulses = Pulses(np.empty(shape, bool), np.empty(shape), np.empty(shape))
    unknown, unknown_at, mask = np.empty(len(samples), np.int64), np.empty(len(samples)), _mask(clipped)
    least, three_sigma = np.float32(threshold_counts), np.float32(3.0 * sigma_counts)
    height_weights = matched.height_weights().astype(np.float32)
    from_step = (pulse.from_s - pulse.peak_s) / pulse.step_s
    curve = Curve(pulse.table / pulse.peak, from_step, matched.sample_s / pulse.step_s)

    def fill(fitter: Filter) -> None:
        fit_all(samples, mask, least, three_sigma, height_weights, curve, fitter, pulses, unknown, unknown_at)

    _fill_with_known_weights(matched, fill, clipped, samples.shape[1], unknown, unknown_at)
    return pulses


def _fill_with_known_weights(
    matched: Matched,
    fill: Callable[[Filter], None],
    clipped: np.ndarray | None,
    n: int,
    unknown: np.ndarray,
    unknown_at: np.ndarray,
) -> None:
    """Run kernels that fill pulses, again with the weights of patterns that turn out to be unknown to the filter.

    Parameters
    ----------
    unknown : (trace) key of a pattern whose weights the filter lacks; 0 if it has all
    unknown_at : (trace) place [samples] at which that pattern is needed
    """
    asked = np.zeros((0, matched.width), bool)
    fitter = Filter(_ROUNDS, matched.half, float(matched.fwhm), matched.codes, matched.known())
    fill(fitter)
    while unknown.any():
        traces = np.flatnonzero(unknown)[np.unique(unknown[unknown != 0], return_index=True)[1]]
        patterns = [
            matched.pattern_at(float(unknown_at[k]), None if clipped is None else clipped[k], n) for k in traces
        ]
        asked = np.concatenate([asked, patterns])  # all of this call, in case they are dropped in between
        fitter = fitter._replace(known=matched.learn(asked))
        fill(fitter)


def _mask(clipped: np.ndarray | None) -> np.ndarray:
    return np.zeros((0, 0), bool) if clipped is None else np.ascontiguousarray(clipped, bool)


@kernel
def fit_first(
    samples: np.ndarray,
    start: np.ndarray,
    least: np.float32,
    clipped: np.ndarray,
    matched: Filter,
    peaks: np.ndarray,
    place: np.ndarray,
    height: np.ndarray,
    unknown: np.ndarray,
) -> None:
    """Fit the first pulse of each trace.

    Parameters
    ----------
    start : (trace) the peak comes at most one sample before
    least : lowest sample that can be a peak
    peaks, place, height : (trace) filled with the peak, and with place [samples] and height of the fit
    """
    rounds, half, fwhm, codes, (keys, weights) = matched
    none = np.zeros((0, 0), np.bool_)
    for trace in range(samples.shape[0]):
        counts = samples[trace]
        peak = find_first_peak(counts, start[trace] - 1, least)
        peak = find_highest_near(counts, peak)
        guess = peak + locate_vertex(counts, peak)
        some = is_any_clipped(clipped, trace)
        low, high = find_plateau(clipped, trace, peak)
        if high > low:
            peak, guess = (low + high) // 2, 0.5 * (low + high)
        peaks[trace] = peak
        place[trace], height[trace], unknown[trace] = fit_pulse(
            counts, clipped if some else none, trace, guess, rounds[some * 1], half, fwhm, codes, keys, weights
        )


@kernel
def subtract_pulse(
    alone: np.ndarray, table: np.ndarray, from_step: float, steps_per_sample: float, place: float, height: float
) -> None:
    """Subtract a pulse from the samples of one trace.

    Parameters
    ----------
    alone : (sample) changed in place
    table, from_step, steps_per_sample : those of `Curve`
    place, height : of the pulse [samples] and [counts]
    """
    for sample in range(alone.shape[0]):
        at = (sample - place) * steps_per_sample - from_step
        if 0.0 <= at < table.shape[0] - 2.0:
            k = np.int64(at)
            alone[sample] -= np.float32(height) * np.float32(table[k] + (at - k) * (table[k + 1] - table[k]))


@kernel
def fit_all(
    samples: np.ndarray,
    clipped: np.ndarray,
    threshold: np.float32,
    three_sigma: np.float32,
    height_weights: np.ndarray,
    curve: Curve,
    matched: Filter,
    pulses: Pulses,
    unknown: np.ndarray,
    unknown_at: np.ndarray,
) -> None:
    """Fit all pulses of each trace, each with the others subtracted.

    Parameters
    ----------
    height_weights : (width) weights that give the height of a pulse in the middle of a window
    """
    alive, place, height = pulses
    table, from_step, steps_per_sample = curve
    rounds, half, fwhm, codes, (keys, weights) = matched
    none = np.zeros((0, 0), np.bool_)
    n, most = samples.shape[1], alive.shape[1]
    statistic, alone, peaks = np.empty(n, np.float32), np.empty(n, np.float32), np.empty(most, np.int64)
    for trace in range(samples.shape[0]):
        unknown[trace] = 0
        n_peaks = find_peaks(
            samples[trace],
            half,
            height_weights,
            np.float32(0.8) * threshold,
            max(1.0, fwhm - 1.0),
            three_sigma,
            statistic,
            peaks,
        )
        for slot in range(most):
            alive[trace, slot], place[trace, slot], height[trace, slot] = slot < n_peaks, np.nan, 0.0
        if n_peaks == 0:
            continue
        rail = clipped if is_any_clipped(clipped, trace) else none
        several = n_peaks > 1
        for sweep in range(4):
            for slot in range(n_peaks):
                if not alive[trace, slot] or (sweep > 0 and not several):
                    continue
                alone[:] = samples[trace]
                for other in range(n_peaks):
                    if other != slot and height[trace, other] > 0.0:
                        subtract_pulse(
                            alone, table, from_step, steps_per_sample, place[trace, other], height[trace, other]
                        )
                guess = place[trace, slot]
                if sweep == 0:
                    peak = find_highest_near(alone, peaks[slot])
                    low, high = find_plateau(rail, trace, peak)
                    guess = 0.5 * (low + high) if high > low else peak + locate_vertex(alone, peak)
                place[trace, slot], height[trace, slot], missing = fit_pulse(
                    alone,
                    rail,
                    trace,
                    guess,
                    rounds[int(rail.shape[0] > 0)],
                    half,
                    fwhm,
                    codes,
                    keys,
                    weights,
                )
                if missing > unknown[trace]:
                    unknown[trace], unknown_at[trace] = missing, place[trace, slot]
            if sweep == 1:
                left = drop_weak_pulses(
                    place[trace, :n_peaks], height[trace, :n_peaks], alive[trace, :n_peaks], threshold, 0.75 * fwhm
                )
                several = left > 1
        for slot in range(n_peaks):
            alive[trace, slot] = alive[trace, slot] and height[trace, slot] >= threshold


@kernel
def drop_weak_pulses(
    place: np.ndarray, height: np.ndarray, alive: np.ndarray, threshold: np.float32, apart: float
) -> int:
    """Drop pulses below the threshold, and pulses close to a higher one; return how many are left.

    Parameters
    ----------
    place, height, alive : (slot) of the pulses, changed in place
    apart : least distance [samples]
    """
    left = 0
    for slot in range(alive.shape[0]):
        alive[slot] = height[slot] >= threshold
        for other in range(alive.shape[0]):
            if height[other] > height[slot] and abs(place[other] - place[slot]) < apart:
                alive[slot] = False
        left += alive[slot] * 1
    for slot in range(alive.shape[0]):
        if not alive[slot]:
            place[slot], height[slot] = np.nan, 0.0
    return left
