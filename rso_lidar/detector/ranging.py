"""When a pulse arrived and how high it was, from its samples: the range algorithms of a flash lidar.

Delays are counted from sample 0 and speak of the return's nominal delay: what the optical pulse and the amplifier add is
known and taken off. Amplitudes are those of the pulse's peak, fitted, whatever the algorithm of the delay.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, Strict

from rso_lidar import units
from rso_lidar.arithmetic import compiled
from rso_lidar.detector.matched import ROUNDS, ROUNDS_CLIPPED, Matched
from rso_lidar.detector.pulse import Pulse
from rso_lidar.part import Flag, Part

Algorithm = Literal["matched_filter", "constant_fraction", "centroid", "parabola", "leading_edge"]


_ROUNDS = np.array([ROUNDS, ROUNDS_CLIPPED])


class Ranging(Part):
    """How delays are taken from samples: the algorithm, and whether its walk with amplitude is calibrated away.

    `fraction` of the peak is where constant_fraction looks.
    """

    algorithm: Algorithm = "matched_filter"
    fraction: Annotated[float, Strict(), Field(gt=0.0, lt=1.0)] = 0.5
    walk_correction: Flag = False


def locate(
    samples: np.ndarray,
    start: np.ndarray,
    pulse: Pulse,
    ranging: Ranging,
    *,
    sample_s: float,
    sigma_counts: float,
    pole_s: float,
    threshold_counts: float,
    clipped: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return when one pulse in each trace arrived [s after sample 0] and its fitted peak amplitude [counts].

    Parameters
    ----------
    samples : (trace, sample) [counts] above the baseline, float32.
    start : (trace) the first sample after the latch: the pulse is the first peak from there on.
    pulse : what a return looks like behind the amplifier.
    sample_s, pole_s : time between samples and τ of the amplifier's poles [s].
    sigma_counts : rms of the noise [counts].
    threshold_counts : where leading_edge looks [counts].
    clipped : (trace, sample) samples at the rail. The fit leaves them out where 3 others are in the pulse.

    A delay is NaN where the samples do not show the crossing that an algorithm looks for.
    """
    matched = Matched.of(pulse, sample_s, pole_s, sigma_counts)
    samples = np.ascontiguousarray(samples, np.float32)
    if compiled() and matched.fits_in_a_word:
        peak, place, height = _first_pulses(samples, np.asarray(start), 0.5 * threshold_counts, matched, clipped)
    else:
        peak = _first_peak(samples, np.asarray(start), 0.5 * threshold_counts)
        guess = peak + _vertex(samples, peak)
        if clipped is not None:
            peak, guess = _middle_of_plateau(clipped, peak, guess)
        place, height = matched.fit(samples, guess, clipped)
    if ranging.algorithm != "matched_filter":
        place = _place(samples, peak, matched, ranging, threshold_counts) + matched.lead
    return (place - matched.lead) * sample_s, height


def _first_pulses(
    samples: np.ndarray, start: np.ndarray, least: float, matched: Matched, clipped: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the sample of the first peak of each trace, and place [samples] and height fitted there, by the loops."""
    from rso_lidar.detector.ranging_loops import first_pulses

    peak, place, height, unknown = (np.empty(len(samples), kind) for kind in (np.int64, float, float, np.int64))
    masks, weights = matched.known()
    while True:
        first_pulses(
            samples,
            np.ascontiguousarray(start, np.int64),
            np.float32(least),
            _mask(clipped),
            _ROUNDS,
            matched.half,
            float(matched.fwhm),
            matched.wanted,
            masks,
            weights,
            peak,
            place,
            height,
            unknown,
        )
        if not unknown.any():
            return peak, place, height
        masks, weights = matched.learn(unknown[unknown > 0])


def _mask(clipped: np.ndarray | None) -> np.ndarray:
    return np.zeros((0, 0), bool) if clipped is None else np.ascontiguousarray(clipped, bool)


def _first_peak(samples: np.ndarray, start: np.ndarray, least: float) -> np.ndarray:
    """Return the sample of the first peak not more than one sample before `start`, after smoothing by 1, 2, 1."""
    smooth = _smoothed(samples)
    top = (samples >= least) & (np.arange(samples.shape[1]) >= start[:, None] - 1)
    top[:, 1:] &= smooth[:, 1:] >= smooth[:, :-1]
    top[:, :-1] &= smooth[:, :-1] > smooth[:, 1:]
    peak = top.argmax(axis=1)
    row = np.arange(len(samples))
    none = np.flatnonzero(~top[row, peak])
    peak[none] = samples[none].argmax(axis=1)
    return _highest_near(samples, peak)


def _smoothed(samples: np.ndarray) -> np.ndarray:
    """Return the samples smoothed by 1, 2, 1, the first and last as if repeated."""
    smooth: np.ndarray = 0.5 * samples
    smooth[:, 1:] += 0.25 * samples[:, :-1]
    smooth[:, :-1] += 0.25 * samples[:, 1:]
    smooth[:, 0] += 0.25 * samples[:, 0]
    smooth[:, -1] += 0.25 * samples[:, -1]
    return smooth


def _highest_near(samples: np.ndarray, peak: np.ndarray) -> np.ndarray:
    """Return the highest of each peak and its two neighbours."""
    row, last = np.arange(len(samples)), samples.shape[1] - 1
    near = np.stack([peak, np.maximum(peak - 1, 0), np.minimum(peak + 1, last)])
    highest: np.ndarray = near[samples[row, near].argmax(axis=0), row]
    return highest


def _middle_of_plateau(clipped: np.ndarray, peak: np.ndarray, guess: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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


def _vertex(samples: np.ndarray, peak: np.ndarray) -> np.ndarray:
    """Return how far the vertex of the parabola through the peak and its neighbours lies behind the peak [samples]."""
    row = np.arange(len(samples))
    middle = np.clip(peak, 1, samples.shape[1] - 2)
    left, top, right = (samples[row, middle + k].astype(float) for k in (-1, 0, 1))
    bend = left - 2.0 * top + right
    shift = np.divide(0.5 * (left - right), bend, out=np.zeros_like(bend), where=bend < 0.0)
    return np.where(middle == peak, np.clip(shift, -1.0, 1.0), 0.0)


def _place(
    samples: np.ndarray, peak: np.ndarray, matched: Matched, ranging: Ranging, threshold_counts: float
) -> np.ndarray:
    """Return the nominal delay of each pulse [samples], by an algorithm other than the matched filter."""
    if ranging.algorithm == "constant_fraction":
        level = ranging.fraction * samples[np.arange(len(samples)), peak]
        return _crossing(samples, peak, level) - matched.pulse.rise_s(ranging.fraction) / matched.sample_s
    if ranging.algorithm == "leading_edge":
        # A pulse that passed the threshold between two samples crosses it, as far as they show, at its peak.
        level = np.minimum(threshold_counts, samples[np.arange(len(samples)), peak])
        return _crossing(samples, peak, level) - matched.pulse.rise_s(0.5) / matched.sample_s
    known = _known_lead(matched, ranging.algorithm)
    return (
        peak + _vertex(samples, peak) if ranging.algorithm == "parabola" else _centroid(samples, peak, matched)
    ) - known


def _crossing(samples: np.ndarray, peak: np.ndarray, level: np.ndarray) -> np.ndarray:
    """Return where the straight lines between samples last pass `level` upward before the peak [samples], or NaN."""
    n, row = samples.shape[1], np.arange(len(samples))
    below = (samples < level[:, None]) & (np.arange(n) < peak[:, None])
    before = n - 1 - below[:, ::-1].argmax(axis=1)
    found = below[row, before]
    before = np.where(found, before, 0)
    low, high = samples[row, before].astype(float), samples[row, before + 1].astype(float)
    share = np.divide(level - low, high - low, out=np.zeros_like(low), where=found & (high > low))
    return np.where(found, before + share, np.nan)


def _centroid(samples: np.ndarray, peak: np.ndarray, matched: Matched) -> np.ndarray:
    """Return the centroid of the samples within 2 sigma of the peak [samples]; sigma is that of a Gaussian of its FWHM."""
    reach = max(1, int(2.0 * matched.fwhm / units.FWHM_PER_SIGMA))
    offset = np.arange(-reach, reach + 1)
    index = peak[:, None] + offset
    inside = (index >= 0) & (index < samples.shape[1])
    near = np.take_along_axis(samples, np.clip(index, 0, samples.shape[1] - 1), axis=1).astype(float) * inside
    total = near.sum(axis=1)
    shift = np.divide((near * offset).sum(axis=1), total, out=np.zeros_like(total), where=total > 0.0)
    centroid: np.ndarray = peak + np.clip(shift, -reach, reach)
    return centroid


@lru_cache(maxsize=64)
def _known_lead(matched: Matched, algorithm: Algorithm) -> float:
    """Return by how many samples an algorithm puts the pulse without noise behind its nominal delay, over all phases."""
    phase = (np.arange(64) + 0.5) / 64
    place = matched.half + 2 + phase
    samples = matched.curve(2 * matched.half + 6, place)
    peak = samples.argmax(axis=1)
    measured = peak + _vertex(samples, peak) if algorithm == "parabola" else _centroid(samples, peak, matched)
    return float((measured - place).mean()) + matched.lead


def locate_all(
    samples: np.ndarray,
    pulse: Pulse,
    ranging: Ranging,
    *,
    sample_s: float,
    sigma_counts: float,
    pole_s: float,
    threshold_counts: float,
    most: int,
    clipped: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return delays [s after sample 0] and peak amplitudes [counts] of up to `most` pulses in each trace, near to far.

    Both have as many columns as the fullest trace needs; NaN and 0 where there are fewer. Pulses are peaks at least about
    one FWHM apart whose fitted height is above the threshold, each fitted with the others taken away. Parameters are those
    of `locate`.
    """
    matched = Matched.of(pulse, sample_s, pole_s, sigma_counts)
    samples = np.ascontiguousarray(samples, np.float32)
    fitted = _all_pulses if compiled() and matched.fits_in_a_word else _all_fitted
    alive, place, height = fitted(samples, matched, threshold_counts, sigma_counts, most, clipped)
    slots = int(np.flatnonzero(alive.any(axis=0)).max(initial=0)) + 1
    alive, place, height = alive[:, :slots], place[:, :slots], height[:, :slots]
    found = place - matched.lead
    if ranging.algorithm != "matched_filter":
        for slot in range(slots):
            rows = np.flatnonzero(alive[:, slot])
            alone = _without_others(samples[rows], matched, place[rows], height[rows], slot)
            peak = np.clip(np.rint(place[rows, slot]), 0, samples.shape[1] - 1).astype(np.intp)
            if clipped is None:
                peak = _highest_near(alone, peak)
            found[rows, slot] = _place(alone, peak, matched, ranging, threshold_counts)
    alive &= np.isfinite(found)
    found = np.where(alive, found, np.nan)
    order = np.argsort(found, axis=1)
    delay_s = np.take_along_axis(found, order, axis=1) * sample_s
    return delay_s, np.take_along_axis(np.where(alive, height, 0.0), order, axis=1)


def _all_fitted(
    samples: np.ndarray,
    matched: Matched,
    threshold_counts: float,
    sigma_counts: float,
    most: int,
    clipped: np.ndarray | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which of `most` pulses (trace, slot) there are, and place [samples] and height of each."""
    peaks = _peaks(samples, matched, threshold_counts, sigma_counts, most)
    place = np.full(peaks.shape, np.nan)
    height = np.zeros(peaks.shape)
    alive = peaks >= 0
    place[alive] = peaks[alive]
    for sweep in range(4):
        several = alive.sum(axis=1) > 1
        for slot in range(most):
            rows = np.flatnonzero(alive[:, slot] & several if sweep else alive[:, slot])
            alone = _without_others(samples[rows], matched, place[rows], height[rows], slot)
            mask = None if clipped is None else clipped[rows]
            guess = place[rows, slot]
            if sweep == 0:
                peak = _highest_near(alone, peaks[rows, slot])
                guess = peak + _vertex(alone, peak)
                if mask is not None:
                    guess = _middle_of_plateau(mask, peak, guess)[1]
            place[rows, slot], height[rows, slot] = matched.fit(alone, guess, mask)
        if sweep == 1:
            alive &= height >= threshold_counts
            alive &= ~_shadowed(place, height, 0.75 * matched.fwhm)
            place[~alive], height[~alive] = np.nan, 0.0
    return alive & (height >= threshold_counts), place, height


def _all_pulses(
    samples: np.ndarray,
    matched: Matched,
    threshold_counts: float,
    sigma_counts: float,
    most: int,
    clipped: np.ndarray | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what `_all_fitted` does, by the loops."""
    from rso_lidar.detector.ranging_loops import all_pulses

    shape, pulse = (len(samples), most), matched.pulse
    alive, place, height = np.empty(shape, bool), np.empty(shape), np.empty(shape)
    unknown = np.empty(len(samples), np.int64)
    masks, weights = matched.known()
    while True:
        all_pulses(
            samples,
            _mask(clipped),
            np.float32(threshold_counts),
            np.float32(3.0 * sigma_counts),
            matched.height_weights().astype(np.float32),
            pulse.table / pulse.peak,
            (pulse.from_s - pulse.peak_s) / pulse.step_s,
            matched.sample_s / pulse.step_s,
            _ROUNDS,
            matched.half,
            float(matched.fwhm),
            matched.wanted,
            masks,
            weights,
            alive,
            place,
            height,
            unknown,
        )
        if not unknown.any():
            return alive, place, height
        masks, weights = matched.learn(unknown[unknown > 0])


def _peaks(
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


def _without_others(
    samples: np.ndarray, matched: Matched, place: np.ndarray, height: np.ndarray, slot: int
) -> np.ndarray:
    """Return the samples less all fitted pulses but that of `slot`; `place` and `height` are (trace, slot)."""
    alone = samples.copy()
    for other in range(place.shape[1]):
        rows = np.flatnonzero(height[:, other] > 0.0) if other != slot else np.zeros(0, np.intp)
        if len(rows):
            curve = matched.curve(samples.shape[1], place[rows, other])
            alone[rows] -= height[rows, other, None].astype(np.float32) * curve
    return alone


def _shadowed(place: np.ndarray, height: np.ndarray, apart: float) -> np.ndarray:
    """Return which pulses (trace, slot) stand closer than `apart` [samples] to a higher one."""
    with np.errstate(invalid="ignore"):
        near = np.abs(place[:, :, None] - place[:, None, :]) < apart
    shadowed: np.ndarray = (near & (height[:, :, None] < height[:, None, :])).any(axis=2)
    return shadowed
