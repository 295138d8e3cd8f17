"""When a pulse arrived and how high it was, from its samples: the range algorithms of a flash lidar.

Delays are counted from sample 0 and speak of the return's nominal delay: what the optical pulse and the amplifier add is
known and taken off. Amplitudes are those of the pulse's peak, fitted, whatever the algorithm of the delay.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field, Strict

from rso_lidar import units
from rso_lidar.arithmetic import compiled, packed
from rso_lidar.detector.matched import ROUNDS, ROUNDS_CLIPPED, Matched
from rso_lidar.detector.peaks import first_peak, highest_near, middle_of_plateau, peaks_of, vertex
from rso_lidar.detector.pulse import Pulse
from rso_lidar.part import Flag, Part

if TYPE_CHECKING:
    from rso_lidar.detector.ranging_loops import Filter

Algorithm = Literal["matched_filter", "constant_fraction", "centroid", "parabola", "leading_edge"]

_ROUNDS = np.array([ROUNDS, ROUNDS_CLIPPED])


class Ranging(Part):
    """How delays are taken from samples: the algorithm, and whether its walk with amplitude is calibrated away.

    `fraction` of the peak is where constant_fraction looks.
    """

    algorithm: Algorithm = Field(
        default="matched_filter",
        description=(
            "Algorithm that estimates the delay of a pulse from its samples. Default: a choice; Fuller et al. mention "
            "a digital filter."
        ),
    )
    fraction: Annotated[float, Strict(), Field(gt=0.0, lt=1.0)] = Field(
        default=0.5,
        description=(
            "Fraction of the peak at which `constant_fraction` takes the time. Default: a choice, used by "
            "`constant_fraction` alone."
        ),
    )
    walk_correction: Flag = Field(
        default=False,
        description="Whether the algorithm's range bias at each amplitude is subtracted. Default: a choice.",
    )


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
        peak = first_peak(samples, np.asarray(start), 0.5 * threshold_counts)
        guess = peak + vertex(samples, peak)
        if clipped is not None:
            peak, guess = middle_of_plateau(clipped, peak, guess)
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
    start, mask = packed(start, np.int64), _mask(clipped)

    def fill(fitter: Filter) -> None:
        first_pulses(samples, start, np.float32(least), mask, fitter, peak, place, height, unknown)

    _knowing(matched, fill, unknown)
    return peak, place, height


def _knowing(matched: Matched, fill: Callable[[Filter], None], unknown: np.ndarray) -> None:
    """Run loops that fill pulses, again with the weights of patterns that turn out to be `unknown` (trace) to the filter."""
    from rso_lidar.detector.ranging_loops import Filter

    asked = np.zeros(0, np.int64)
    fitter = Filter(_ROUNDS, matched.half, float(matched.fwhm), matched.wanted, matched.known())
    fill(fitter)
    while unknown.any():
        asked = np.union1d(asked, unknown[unknown > 0])  # all of this call, in case that they are forgotten meanwhile
        fitter = fitter._replace(known=matched.learn(asked))
        fill(fitter)


def _mask(clipped: np.ndarray | None) -> np.ndarray:
    return np.zeros((0, 0), bool) if clipped is None else np.ascontiguousarray(clipped, bool)


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
        peak + vertex(samples, peak) if ranging.algorithm == "parabola" else _centroid(samples, peak, matched)
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
    measured = peak + vertex(samples, peak) if algorithm == "parabola" else _centroid(samples, peak, matched)
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
                peak = highest_near(alone, peak)
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
    peaks = peaks_of(samples, matched, threshold_counts, sigma_counts, most)
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
                peak = highest_near(alone, peaks[rows, slot])
                guess = peak + vertex(alone, peak)
                if mask is not None:
                    guess = middle_of_plateau(mask, peak, guess)[1]
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
    from rso_lidar.detector.ranging_loops import Curve, Pulses, all_pulses

    shape, pulse = (len(samples), most), matched.pulse
    pulses = Pulses(np.empty(shape, bool), np.empty(shape), np.empty(shape))
    unknown, mask = np.empty(len(samples), np.int64), _mask(clipped)
    least, three_sigma = np.float32(threshold_counts), np.float32(3.0 * sigma_counts)
    height_weights = matched.height_weights().astype(np.float32)
    from_step = (pulse.from_s - pulse.peak_s) / pulse.step_s
    curve = Curve(pulse.table / pulse.peak, from_step, matched.sample_s / pulse.step_s)

    def fill(fitter: Filter) -> None:
        all_pulses(samples, mask, least, three_sigma, height_weights, curve, fitter, pulses, unknown)

    _knowing(matched, fill, unknown)
    return pulses


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
