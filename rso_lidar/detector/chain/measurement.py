"""From stored samples to range and intensity: the digital end of the chain."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rso_lidar import units
from rso_lidar.detector.chain.report_flags import Flagger
from rso_lidar.detector.ranging.gate_threshold import GateThresholds
from rso_lidar.detector.ranging.location import Locator, locate, locate_all
from rso_lidar.detector.ranging.range_walk import correct_walk
from rso_lidar.detector.settings.focal_plane import Crosstalk
from rso_lidar.detector.settings.readout import Readout
from rso_lidar.detector.stages.array_effects import draw_shift_m, latch_share
from rso_lidar.detector.stages.nonuniformity import CameraPixels
from rso_lidar.kernels import kernel, packed
from rso_lidar.parallel import run_in_threads
from rso_lidar.records import Reading, Waveforms

_TRACES_AT_ONCE = 1024  # for one thread: some 0.3 ms
_LOOKED_FOR = 8  # returns in a trace: more do not fit between its ends
FIRST, STRONGEST, LAST = range(3)  # of the returns, is reported as range and intensity
_CHOICES = {"first": FIRST, "strongest": STRONGEST, "last": LAST}


@dataclass(frozen=True, eq=False)
class RangeProcessor:
    """The digital end of a camera: what it knows of its samples, and what it reports; None for what is off."""

    pixels: CameraPixels
    readout: Readout
    locator: Locator
    pixel_jitter_s: float  # of a frame, 1 sigma
    frame_jitter_s: float  # of a frame, 1 sigma
    rail_counts: float | None  # samples above it are on the rail of an amplifier that saturates
    unknown_fraction: float  # of the maps, what no calibration has removed
    walk: tuple[np.ndarray, np.ndarray] | None  # amplitudes [counts], and the bias of delay [s] there
    crossing_lead_s: float | None  # of a timing channel: when a return crosses zero after its nominal delay
    crosstalk: Crosstalk | None
    gate_thresholds: GateThresholds | None
    returns: str
    max_returns: int
    full_scale_counts: int
    flagger: Flagger | None

    def select(self, pixel: np.ndarray) -> RangeProcessor:
        """Return that of some pixels, or of the same ones several times."""
        return replace(self, pixels=self.pixels.select(pixel))


def measure(
    processor: RangeProcessor, waveforms: Waveforms, rng: np.random.Generator, threads: int | None = 1
) -> Reading:
    """Measure range and intensity of the stored samples."""
    n_pixels = waveforms.shape[0] * waveforms.shape[1]
    pixels = processor.pixels
    jitter_s = _draw_normal(waveforms.pixel, n_pixels, rng) * processor.pixel_jitter_s
    jitter_s += rng.standard_normal() * processor.frame_jitter_s
    samples = waveforms.samples_counts - np.float32(waveforms.baseline_counts)
    if waveforms.clipped is None:
        clipped = waveforms.samples_counts >= processor.readout.full_scale_counts
    else:
        clipped = waveforms.clipped.copy()
    railed = None
    if processor.rail_counts is not None:
        railed = clipped | _is_on_rail(processor.rail_counts, processor.readout, waveforms, pixels.offset_counts)
    unknown = processor.unknown_fraction
    if unknown < 1.0:
        samples = samples - ((1.0 - unknown) * pixels.offset_counts[waveforms.pixel, None]).astype(np.float32)
    found_s, amplitude = _locate_returns(processor, waveforms, samples, clipped, railed, threads)
    if processor.walk is not None:
        found_s = correct_walk(found_s, amplitude, processor.walk)
    if waveforms.zero_crossing_s is not None and processor.crossing_lead_s is not None:
        timed_s = (waveforms.zero_crossing_s - processor.crossing_lead_s - waveforms.start_s)[:, None]
        found_s = np.where(np.isfinite(timed_s), timed_s, found_s)
    delay_s = waveforms.start_s[:, None] + found_s + (jitter_s + unknown * pixels.t0_s[waveforms.pixel])[:, None]
    if unknown < 1.0:
        gain = 1.0 + (pixels.gain[waveforms.pixel] - 1.0) * (1.0 - unknown)
        amplitude = amplitude / gain[:, None]
    range_m = delay_s * units.RANGE_PER_DELAY_M_S
    range_m = np.where(range_m > 0.0, range_m, np.nan)  # nothing is reported from behind the lens
    if processor.crosstalk is not None:
        share = latch_share(waveforms.latch_s, waveforms.latch_s, waveforms.sample_s, n_pixels)
        range_m = range_m + draw_shift_m(processor.crosstalk, share, rng)[:, None]
    held = clipped if railed is None else railed
    reading = _report_returns(
        waveforms.shape,
        waveforms.pixel,
        range_m,
        amplitude / processor.readout.counts_per_intensity,
        held,
        returns=processor.returns,
        max_returns=processor.max_returns,
        full_scale_counts=processor.full_scale_counts,
    )
    if processor.flagger is None:
        return reading
    return processor.flagger.flag(reading, waveforms, samples, held, range_m, found_s, amplitude)


def _draw_normal(pixel: np.ndarray, n_pixels: int, rng: np.random.Generator) -> np.ndarray:
    """Return a standard normal number for each of some pixels, which does not depend on the other pixels given.

    Each pixel of the array has a word of 32 bits; only the words of the given pixels are converted to normal numbers.

    Parameters
    ----------
    pixel : (trace) numbers of the pixels
    """
    from scipy.special import ndtri

    words = rng.integers(0, 2**32, n_pixels, dtype=np.uint32)[pixel]
    normal: np.ndarray = ndtri((words + 0.5) * 2.0**-32)
    return normal


def _is_on_rail(rail_counts: float, readout: Readout, waveforms: Waveforms, offset_counts: np.ndarray) -> np.ndarray:
    """Return which samples (trace, sample) the amplifier's rail holds down, where it is below that of the converter.

    Parameters
    ----------
    rail_counts : the rail [counts], above the baseline
    offset_counts : (pixel) offset of the pixels
    """
    rail = waveforms.baseline_counts + rail_counts
    low, within = readout.low_gain, 1.0
    if low is not None and rail > readout.full_scale_counts:
        within = low.ratio * (1.0 + 3.0 * low.noise_counts)
    held: np.ndarray = waveforms.samples_counts > rail + offset_counts[waveforms.pixel, None] - within
    return held


def _locate_returns(
    processor: RangeProcessor,
    waveforms: Waveforms,
    samples: np.ndarray,
    clipped: np.ndarray,
    railed: np.ndarray | None,
    threads: int | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return delays since the first sample [s] and amplitudes [counts] of the returns (trace, return), near to far.

    Parameters
    ----------
    samples : (trace, sample) [counts] above the baseline, calibrated
    clipped : (trace, sample) whether a sample is at the converter's rail
    railed : (trace, sample) whether it is there or at the amplifier's rail; None where the amplifier does not saturate
    """
    locator, gate_thresholds = processor.locator, processor.gate_thresholds
    if gate_thresholds is None and processor.max_returns == 1 and processor.returns == "first":
        start = np.full(len(samples), processor.readout.pretrigger_samples)

        def locate_some(block: slice) -> tuple[np.ndarray, np.ndarray]:
            some, mask = samples[block], _where_any(clipped[block])
            held = None if railed is None else railed[block]
            return locate(some, start[block], locator, mask, held)

        blocks = [slice(k, k + _TRACES_AT_ONCE) for k in range(0, max(len(samples), 1), _TRACES_AT_ONCE)]
        located = zip(*run_in_threads(threads, locate_some, blocks), strict=True)
        delay_s, amplitude = (np.concatenate(pieces)[:, None] for pieces in located)
        return delay_s, amplitude
    least = np.full(len(samples), locator.threshold_counts)
    if gate_thresholds is not None:
        rate = waveforms.base_per_s
        dark = gate_thresholds.apd.dark_electrons_per_s
        least = gate_thresholds.solve(np.full(len(waveforms.pixel), dark) if rate is None else rate)
    lowest = float(least.min(initial=np.inf)) if len(least) else locator.threshold_counts
    delay_s, amplitude = locate_all(samples, locator, _LOOKED_FOR, _where_any(clipped), railed, lowest)
    low = amplitude < least[:, None]
    delay_s, amplitude = np.where(low, np.nan, delay_s), np.where(low, 0.0, amplitude)
    # A pulse that peaks beyond the stored samples shows only a flank, which does not give its place.
    place = (delay_s + locator.matched.pulse.peak_s) / waveforms.sample_s
    with np.errstate(invalid="ignore"):
        outside = (place < -0.49) | (place > samples.shape[1] - 0.51)
    delay_s, amplitude = np.where(outside, np.nan, delay_s), np.where(outside, 0.0, amplitude)
    if gate_thresholds is not None:
        return _sort_by_range(delay_s, amplitude)
    # What latched is reported, even where its fitted amplitude is below the threshold that noise helped it over.
    none = np.flatnonzero(~np.isfinite(delay_s).any(axis=1))
    start = np.full(len(none), processor.readout.pretrigger_samples)
    held = None if railed is None else railed[none]
    delay_s[none, 0], amplitude[none, 0] = locate(samples[none], start, locator, _where_any(clipped[none]), held)
    return _sort_by_range(delay_s, amplitude)


def _sort_by_range(delay_s: np.ndarray, amplitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the returns (trace, return) without gaps: NaN after the last."""
    order = np.argsort(delay_s, axis=1)
    return np.take_along_axis(delay_s, order, axis=1), np.take_along_axis(amplitude, order, axis=1)


def _where_any(clipped: np.ndarray) -> np.ndarray | None:
    return clipped if clipped.any() else None


def _report_returns(
    shape: tuple[int, int],
    pixel: np.ndarray,
    range_m: np.ndarray,
    amplitude: np.ndarray,
    clipped: np.ndarray,
    *,
    returns: str,
    max_returns: int,
    full_scale_counts: int,
) -> Reading:
    """Return the reading of a focal plane; one of a pixel's returns is its range and intensity.

    Parameters
    ----------
    pixel : (trace) number of the pixel
    range_m, amplitude : (trace, return) [m] and [counts], near to far, NaN and 0 where there are fewer
    clipped : (trace, sample) whether a sample is at the rail
    returns : which one is reported: first, strongest or last
    max_returns : how many are listed beside it; 1 lists none
    """
    n_pixels = shape[0] * shape[1]
    most = max_returns if max_returns > 1 else 0
    one_m, one_counts = np.full(n_pixels, np.nan, np.float32), np.zeros(n_pixels, np.uint16)
    saturated = np.zeros(n_pixels, np.uint8)
    several_m, several_counts = np.full((n_pixels, most), np.nan, np.float32), np.zeros((n_pixels, most), np.uint16)
    report_traces(
        packed(pixel, np.int64),
        packed(range_m, np.float64),
        packed(amplitude, np.float64),
        packed(clipped, np.bool_),
        _CHOICES[returns],
        float(full_scale_counts),
        one_m,
        one_counts,
        saturated,
        several_m,
        several_counts,
    )
    several = (several_m.reshape(*shape, most), several_counts.reshape(*shape, most)) if most else ()
    return Reading(one_m.reshape(shape), one_counts.reshape(shape), saturated.reshape(shape), *several)


@kernel
def report_traces(
    pixel: np.ndarray,
    range_m: np.ndarray,
    amplitude: np.ndarray,
    clipped: np.ndarray,
    choice: int,
    full_scale: float,
    one_m: np.ndarray,
    one_counts: np.ndarray,
    saturated: np.ndarray,
    several_m: np.ndarray,
    several_counts: np.ndarray,
) -> None:
    """Fill the report of each pixel: one return as range and intensity, and lists as many as `several` can hold.

    What is filled holds NaN and 0 before.

    Parameters
    ----------
    pixel : (trace) number of the pixel
    range_m, amplitude : (trace, return), near to far
    clipped : (trace, sample) whether a sample is at the rail
    full_scale : greatest amplitude [counts]
    one_m, one_counts, saturated : (pixel) filled
    several_m, several_counts : (pixel, return) filled
    """
    for trace in range(range_m.shape[0]):
        at, chosen = pixel[trace], -1
        for k in range(range_m.shape[1]):
            if not np.isfinite(range_m[trace, k]):
                continue
            better = choice == LAST or (choice == STRONGEST and amplitude[trace, k] > amplitude[trace, max(chosen, 0)])
            chosen = k if chosen < 0 or better else chosen
            if k < several_m.shape[1]:
                several_m[at, k] = range_m[trace, k]
                several_counts[at, k] = min(max(np.rint(amplitude[trace, k]), 1.0), full_scale)
        if chosen < 0:
            continue
        one_m[at] = range_m[trace, chosen]
        counts = min(max(np.rint(amplitude[trace, chosen]), 1.0), full_scale)
        one_counts[at] = counts
        some = counts >= full_scale
        for sample in range(clipped.shape[1]):
            some = some or clipped[trace, sample]
        saturated[at] = some
