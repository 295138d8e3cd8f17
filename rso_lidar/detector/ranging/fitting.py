"""Range algorithms as loops over traces: the first pulse of a trace, or all of them, fitted by the matched filter.

A trace that needs a pattern of samples whose weights the filter does not know says so in `unknown`. Tuples of arrays are
taken apart where traces are gone through: a function called for each would count references to them, for a third more time.
"""

from typing import NamedTuple

import numpy as np

from rso_lidar.arithmetic import loop
from rso_lidar.detector.matched import PHASES, Known


class Filter(NamedTuple):
    """What fits pulses: rounds of a trace without clipped samples and with, half its window and the pulse's FWHM [samples].

    `wanted` is the mask of the samples in which a pulse has to show, bit k for the k-th sample of the window.
    """

    rounds: np.ndarray
    half: int
    fwhm: float
    wanted: int
    known: Known


class Curve(NamedTuple):
    """A pulse of unit peak by its `table`, which begins `from_step` steps of its own after the peak."""

    table: np.ndarray
    from_step: float
    steps_per_sample: float


class Pulses(NamedTuple):
    """What is filled (trace, slot): whether there is a pulse, its place [samples] and its height."""

    alive: np.ndarray
    place: np.ndarray
    height: np.ndarray


@loop
def unclipped(
    clipped: np.ndarray, trace: int, middle: int, low: int, high: int, half: int, wanted: int, inside: np.int64
) -> np.int64:
    """Return the pattern of samples `low` to `high` not clipped; `inside`, where the pulse shows in fewer than three."""
    pattern, shown = np.int64(0), 0
    for sample in range(low, high):
        if not clipped[trace, sample]:
            bit = np.int64(1) << (sample - middle + half)
            pattern |= bit
            shown += (wanted & bit) != 0
    return pattern if shown >= 3 else inside


@loop
def climb(
    samples: np.ndarray,
    clipped: np.ndarray,
    trace: int,
    guess: float,
    rounds: int,
    half: int,
    wanted: int,
    masks: np.ndarray,
    weights: np.ndarray,
) -> tuple[float, float, np.int64]:
    """Return place [samples], height and 0; or the pattern whose weights are not known."""
    n, last = samples.shape[0], masks.shape[0] - 1
    place, height, before = guess, 0.0, np.int64(-1) << 40
    for _ in range(rounds):
        step = np.int64(np.rint(place * PHASES)) + PHASES // 2
        if step == before:  # and so would all that follows be
            break
        before = step
        middle = min(max(step // PHASES, 0), n - 1)
        phase = min(max(step - middle * PHASES, 0), PHASES - 1)
        low, high, window = max(middle - half, 0), min(middle + half + 1, n), middle - half
        mask = (np.int64(1) << (high - window)) - (np.int64(1) << (low - window))
        if clipped.shape[0]:
            mask = unclipped(clipped, trace, middle, low, high, half, wanted, mask)
        pattern = last if masks[last] <= mask else np.searchsorted(masks, mask)
        if masks[pattern] != mask:
            return place, height, mask
        height, moment = 0.0, 0.0
        for sample in range(low, high):
            value = np.float64(samples[sample])
            height += value * weights[pattern, phase, 0, sample - window]
            moment += value * weights[pattern, phase, 1, sample - window]
        shift = moment / height if height > 0.0 else 0.0
        here = middle + (phase - PHASES // 2) / PHASES
        place = min(max(here + min(max(shift, -0.75), 0.75), -0.5), n - 0.5)
    return place, height, np.int64(0)


@loop
def fit(
    samples: np.ndarray,
    clipped: np.ndarray,
    trace: int,
    guess: float,
    rounds: int,
    half: int,
    fwhm: float,
    wanted: int,
    masks: np.ndarray,
    weights: np.ndarray,
) -> tuple[float, float, np.int64]:
    """Return place [samples] and height of the pulse nearest to `guess`, and the pattern that is not known, or 0."""
    place, height, unknown = climb(samples, clipped, trace, guess, rounds, half, wanted, masks, weights)
    if unknown == 0 and not (height > 0.0 and abs(place - guess) <= max(1.0, fwhm)):
        nearest = min(max(np.int64(np.rint(guess)), 0), samples.shape[0] - 1)
        return guess, np.float64(samples[nearest]), unknown
    return place, height, unknown


@loop
def smoothed(samples: np.ndarray, sample: int) -> np.float32:
    """Return a sample smoothed by 1, 2, 1, the first and last as if repeated."""
    last = samples.shape[0] - 1
    quarter = np.float32(0.25)
    inner = np.float32(0.5) * samples[sample] + quarter * samples[max(sample - 1, 0)]
    return np.float32(inner + quarter * samples[min(sample + 1, last)])


@loop
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


@loop
def highest_near(samples: np.ndarray, peak: int) -> int:
    """Return the highest of a peak and its two neighbours, the peak itself where they are no higher."""
    highest = peak
    if peak > 0 and samples[peak - 1] > samples[highest]:
        highest = peak - 1
    if peak < samples.shape[0] - 1 and samples[peak + 1] > samples[highest]:
        highest = peak + 1
    return highest


@loop
def vertex(samples: np.ndarray, peak: int) -> float:
    """Return how far the vertex of the parabola through the peak and its neighbours lies behind the peak [samples]."""
    if peak < 1 or peak > samples.shape[0] - 2:
        return 0.0
    left, right = np.float64(samples[peak - 1]), np.float64(samples[peak + 1])
    bend = left - 2.0 * np.float64(samples[peak]) + right
    return min(max(0.5 * (left - right) / bend, -1.0), 1.0) if bend < 0.0 else 0.0


@loop
def plateau(clipped: np.ndarray, trace: int, peak: int) -> tuple[int, int]:
    """Return the first and last of the run of clipped samples that the peak is in; the peak alone without."""
    low, high = peak, peak
    if clipped.shape[0] and clipped[trace, peak]:
        while low > 0 and clipped[trace, low - 1]:
            low -= 1
        while high < clipped.shape[1] - 1 and clipped[trace, high + 1]:
            high += 1
    return low, high


@loop
def any_of(clipped: np.ndarray, trace: int) -> bool:
    """Return whether a sample of the trace is clipped."""
    if clipped.shape[0]:
        for sample in range(clipped.shape[1]):
            if clipped[trace, sample]:
                return True
    return False


@loop
def first_pulses(
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
    """Fill peak, place and height (trace) of the first pulse from `start` (trace) on whose top is not below `least`."""
    rounds, half, fwhm, wanted, (masks, weights) = matched
    none = np.zeros((0, 0), np.bool_)
    for trace in range(samples.shape[0]):
        one = samples[trace]
        peak = first_peak(one, start[trace] - 1, least)
        peak = highest_near(one, peak)
        guess = peak + vertex(one, peak)
        some = any_of(clipped, trace)
        low, high = plateau(clipped, trace, peak)
        if high > low:
            peak, guess = (low + high) // 2, 0.5 * (low + high)
        peaks[trace] = peak
        place[trace], height[trace], unknown[trace] = fit(
            one, clipped if some else none, trace, guess, rounds[some * 1], half, fwhm, wanted, masks, weights
        )


@loop
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


@loop
def parted(samples: np.ndarray, one: int, other: int, three_sigma: np.float32) -> bool:
    """Return whether a valley parts two peaks: a tenth of the lower one, and three sigma of the noise."""
    lower = min(smoothed(samples, one), smoothed(samples, other))
    valley = np.float32(np.inf)
    for sample in range(min(one, other) + 1, max(one, other)):
        valley = min(valley, smoothed(samples, sample))
    return bool(lower - valley > max(np.float32(0.1) * lower, three_sigma))


@loop
def take_away(
    alone: np.ndarray, table: np.ndarray, from_step: float, steps_per_sample: float, place: float, height: float
) -> None:
    """Take the `Curve` of a pulse of this place [samples] and height off a trace."""
    for sample in range(alone.shape[0]):
        at = (sample - place) * steps_per_sample - from_step
        if 0.0 <= at < table.shape[0] - 2.0:
            k = np.int64(at)
            alone[sample] -= np.float32(height) * np.float32(table[k] + (at - k) * (table[k + 1] - table[k]))


@loop
def all_pulses(
    samples: np.ndarray,
    clipped: np.ndarray,
    threshold: np.float32,
    three_sigma: np.float32,
    height_weights: np.ndarray,
    curve: Curve,
    matched: Filter,
    pulses: Pulses,
    unknown: np.ndarray,
) -> None:
    """Fill `pulses` with those above `threshold`, each fitted with the others taken away."""
    alive, place, height = pulses
    table, from_step, steps_per_sample = curve
    rounds, half, fwhm, wanted, (masks, weights) = matched
    none = np.zeros((0, 0), np.bool_)
    n, most = samples.shape[1], alive.shape[1]
    statistic, alone, peaks = np.empty(n, np.float32), np.empty(n, np.float32), np.empty(most, np.int64)
    for trace in range(samples.shape[0]):
        unknown[trace] = 0
        found = find_peaks(
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
            alive[trace, slot], place[trace, slot], height[trace, slot] = slot < found, np.nan, 0.0
        if found == 0:
            continue
        rail = clipped if any_of(clipped, trace) else none
        several = found > 1
        for sweep in range(4):
            for slot in range(found):
                if not alive[trace, slot] or (sweep > 0 and not several):
                    continue
                alone[:] = samples[trace]
                for other in range(found):
                    if other != slot and height[trace, other] > 0.0:
                        take_away(alone, table, from_step, steps_per_sample, place[trace, other], height[trace, other])
                guess = place[trace, slot]
                if sweep == 0:
                    peak = highest_near(alone, peaks[slot])
                    low, high = plateau(rail, trace, peak)
                    guess = 0.5 * (low + high) if high > low else peak + vertex(alone, peak)
                place[trace, slot], height[trace, slot], missing = fit(
                    alone,
                    rail,
                    trace,
                    guess,
                    rounds[int(rail.shape[0] > 0)],
                    half,
                    fwhm,
                    wanted,
                    masks,
                    weights,
                )
                unknown[trace] = max(unknown[trace], missing)
            if sweep == 1:
                left = settle(place[trace, :found], height[trace, :found], alive[trace, :found], threshold, 0.75 * fwhm)
                several = left > 1
        for slot in range(found):
            alive[trace, slot] = alive[trace, slot] and height[trace, slot] >= threshold


@loop
def settle(place: np.ndarray, height: np.ndarray, alive: np.ndarray, threshold: np.float32, apart: float) -> int:
    """Take away pulses below the threshold, and those closer than `apart` [samples] to a higher one; return what is left."""
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
