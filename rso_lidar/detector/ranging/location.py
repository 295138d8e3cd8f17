"""Range algorithms of a flash lidar: arrival time and height of pulses from their samples.

Delays count from sample 0 and refer to the return's nominal delay: the known delay of optical pulse and amplifier is
subtracted. Amplitudes are fitted peak amplitudes for every algorithm of the delay. `samples` (trace, sample) are counts
above the baseline, float32.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rso_lidar import units
from rso_lidar.detector.ranging.clipped_pulse import Edges, locate_clipped_pulses, tabulate_edges
from rso_lidar.detector.ranging.fitting import fit_all_pulses, fit_first_pulses
from rso_lidar.detector.ranging.matched_filter import Matched
from rso_lidar.detector.ranging.peaks import locate_vertices, raise_to_highest
from rso_lidar.detector.ranging.pulse import Pulse
from rso_lidar.detector.settings.algorithm import Ranging


@dataclass(frozen=True, eq=False)
class Locator:
    """A range algorithm, with what it knows of the pulse, the noise and the samples.

    Parameters
    ----------
    ranging : the algorithm
    matched : the matched filter, with the pulse behind the amplifier
    sigma_counts : rms of the noise [counts]
    threshold_counts : level of the algorithm leading_edge, and least height of a pulse [counts]
    recovery_s : time constant of the amplifier's recovery from saturation, 0 without [s]
    """

    ranging: Ranging
    matched: Matched
    sigma_counts: float
    threshold_counts: float
    recovery_s: float = 0.0

    @staticmethod
    def of(
        pulse: Pulse,
        ranging: Ranging,
        *,
        sample_s: float,
        sigma_counts: float,
        pole_s: float,
        threshold_counts: float,
        recovery_s: float = 0.0,
    ) -> Locator:
        """Build the locator of a pulse.

        Parameters
        ----------
        ranging, sigma_counts, threshold_counts, recovery_s : as for `Locator`
        sample_s, pole_s : time between samples and τ of the amplifier's poles [s]
        """
        matched = Matched.of(pulse, sample_s, pole_s, sigma_counts)
        return Locator(ranging, matched, sigma_counts, threshold_counts, recovery_s)

    @cached_property
    def edges(self) -> Edges:
        """Edges of the pulse, which give the place of one that clips."""
        return tabulate_edges(self.matched, self.recovery_s)

    @cached_property
    def known_lag(self) -> float:
        """Mean lag [samples] of parabola or centroid behind the nominal delay of a pulse without noise, over all phases."""
        matched, phase = self.matched, (np.arange(64) + 0.5) / 64
        place = matched.half + 2 + phase
        samples = matched.curve(2 * matched.half + 6, place)
        peak = samples.argmax(axis=1)
        return float((_measure_place(samples, peak, self) - place).mean()) + matched.lead


def locate(
    samples: np.ndarray,
    start: np.ndarray,
    locator: Locator,
    clipped: np.ndarray | None = None,
    railed: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Locate one pulse in each trace.

    Parameters
    ----------
    start : (trace) the first sample after the latch. The pulse is the first peak from there on
    clipped : (trace, sample) samples at the converter's rail. The fit leaves them out where 3 others are in the pulse; else
        the edges of the pulse give its place
    railed : (trace, sample) samples at the rail of the converter or of an amplifier that saturates; None without the latter.
        Then the edges give the place of any pulse that reaches it

    Returns
    -------
    (trace) arrival [s after sample 0], and fitted peak amplitude [counts]. A delay is NaN where the samples do not show the
    crossing that the algorithm looks for.
    """
    matched = locator.matched
    samples = np.ascontiguousarray(samples, np.float32)
    peak, place, height = fit_first_pulses(samples, start, 0.5 * locator.threshold_counts, matched, clipped)
    if locator.ranging.algorithm != "matched_filter":
        place = _place(samples, peak, locator, locator.threshold_counts) + matched.lead
    elif (held := clipped if railed is None else railed) is not None:
        place = _relocate(samples, held, peak, place, locator)
    return (place - matched.lead) * matched.sample_s, height


def _relocate(
    samples: np.ndarray, held: np.ndarray, peak: np.ndarray, place: np.ndarray, locator: Locator
) -> np.ndarray:
    """Return the places (trace) [samples] of pulses, by their edges where samples held at a rail spoil the fit.

    Parameters
    ----------
    held : (trace, sample) samples at a rail
    peak, place : (trace) sample of the peak, and fitted place [samples]
    """
    return locate_clipped_pulses(
        samples,
        held,
        peak,
        place,
        locator.matched,
        lambda: locator.edges,
        locator.sigma_counts,
        locator.recovery_s,
    )


def _place(samples: np.ndarray, peak: np.ndarray, locator: Locator, threshold_counts: float) -> np.ndarray:
    """Return the nominal delay of each pulse [samples], by an algorithm other than the matched filter.

    Parameters
    ----------
    peak : (trace) sample of the peak
    threshold_counts : level of leading_edge [counts]
    """
    matched, ranging = locator.matched, locator.ranging
    if ranging.algorithm == "constant_fraction":
        level = ranging.fraction * samples[np.arange(len(samples)), peak]
        return _crossing(samples, peak, level) - matched.pulse.rise_s(ranging.fraction) / matched.sample_s
    if ranging.algorithm == "leading_edge":
        # A pulse that passed the threshold between two samples crosses it, as far as they show, at its peak.
        level = np.minimum(threshold_counts, samples[np.arange(len(samples)), peak])
        return _crossing(samples, peak, level) - matched.pulse.rise_s(0.5) / matched.sample_s
    return _measure_place(samples, peak, locator) - locator.known_lag


def _measure_place(samples: np.ndarray, peak: np.ndarray, locator: Locator) -> np.ndarray:
    """Return the vertex of the parabola through each peak [samples], or the centroid about it."""
    if locator.ranging.algorithm == "parabola":
        vertex: np.ndarray = peak + locate_vertices(samples, peak)
        return vertex
    return _centroid(samples, peak, locator.matched)


def _crossing(samples: np.ndarray, peak: np.ndarray, level: np.ndarray) -> np.ndarray:
    """Return where lines between samples last cross a level (trace) [counts] upward before the peak [samples], or NaN."""
    n, row = samples.shape[1], np.arange(len(samples))
    below = (samples < level[:, None]) & (np.arange(n) < peak[:, None])
    before = n - 1 - below[:, ::-1].argmax(axis=1)
    is_crossed = below[row, before]
    before = np.where(is_crossed, before, 0)
    low, high = samples[row, before].astype(float), samples[row, before + 1].astype(float)
    share = np.divide(level - low, high - low, out=np.zeros_like(low), where=is_crossed & (high > low))
    return np.where(is_crossed, before + share, np.nan)


def _centroid(samples: np.ndarray, peak: np.ndarray, matched: Matched) -> np.ndarray:
    """Return the centroid of the samples within 2 sigma, that of a Gaussian of the filter's FWHM, of the peak [samples]."""
    reach = max(1, int(2.0 * matched.fwhm / units.FWHM_PER_SIGMA))
    offset = np.arange(-reach, reach + 1)
    index = peak[:, None] + offset
    inside = (index >= 0) & (index < samples.shape[1])
    near = np.take_along_axis(samples, np.clip(index, 0, samples.shape[1] - 1), axis=1).astype(float) * inside
    total = near.sum(axis=1)
    shift = np.divide((near * offset).sum(axis=1), total, out=np.zeros_like(total), where=total > 0.0)
    centroid: np.ndarray = peak + np.clip(shift, -reach, reach)
    return centroid


def locate_all(
    samples: np.ndarray,
    locator: Locator,
    most: int,
    clipped: np.ndarray | None = None,
    railed: np.ndarray | None = None,
    least_counts: float | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Locate all pulses in each trace.

    Pulses are peaks at least about one FWHM apart whose fitted height is above the threshold. Each is fitted with the others
    subtracted.

    Parameters
    ----------
    most : greatest number of pulses in a trace
    least_counts : least height of a pulse [counts] (None: the threshold)
    railed : as for `locate`

    Returns
    -------
    (trace, pulse) delays [s after sample 0] and peak amplitudes [counts], near to far. There are as many columns as the
    fullest trace needs, with NaN and 0 where a trace has fewer.
    """
    matched = locator.matched
    least = locator.threshold_counts if least_counts is None else least_counts
    samples = np.ascontiguousarray(samples, np.float32)
    alive, place, height = fit_all_pulses(samples, matched, least, locator.sigma_counts, most, clipped)
    slots = int(np.flatnonzero(alive.any(axis=0)).max(initial=0)) + 1
    alive, place, height = alive[:, :slots], place[:, :slots], height[:, :slots]
    crossing = place - matched.lead
    if locator.ranging.algorithm != "matched_filter":
        for slot in range(slots):
            rows = np.flatnonzero(alive[:, slot])
            alone = _without_others(samples[rows], matched, place[rows], height[rows], slot)
            peak = np.clip(np.rint(place[rows, slot]), 0, samples.shape[1] - 1).astype(np.intp)
            if clipped is None:
                peak = raise_to_highest(alone, peak)
            crossing[rows, slot] = _place(alone, peak, locator, least)
    elif (held := clipped if railed is None else railed) is not None:
        for slot in range(slots):
            rows = np.flatnonzero(alive[:, slot] & np.isfinite(place[:, slot]))
            peak = np.clip(np.rint(place[rows, slot]), 0, samples.shape[1] - 1).astype(np.intp)
            crossing[rows, slot] = _relocate(samples[rows], held[rows], peak, place[rows, slot], locator) - matched.lead
    alive &= np.isfinite(crossing)
    crossing = np.where(alive, crossing, np.nan)
    order = np.argsort(crossing, axis=1)
    delay_s = np.take_along_axis(crossing, order, axis=1) * matched.sample_s
    return delay_s, np.take_along_axis(np.where(alive, height, 0.0), order, axis=1)


def _without_others(
    samples: np.ndarray, matched: Matched, place: np.ndarray, height: np.ndarray, slot: int
) -> np.ndarray:
    """Return the samples without all fitted pulses but that of `slot`.

    Parameters
    ----------
    place, height : (trace, slot) of the fitted pulses [samples] and [counts]
    """
    alone = samples.copy()
    for other in range(place.shape[1]):
        rows = np.flatnonzero(height[:, other] > 0.0) if other != slot else np.zeros(0, np.intp)
        if len(rows):
            curve = matched.curve(samples.shape[1], place[rows, other])
            alone[rows] -= height[rows, other, None].astype(np.float32) * curve
    return alone
