"""From stored samples to range and intensity: the digital end of the chain."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from rso_lidar import units
from rso_lidar.detector.chain.camera import build_camera
from rso_lidar.detector.ranging.bipolar_pulse import crossing_lead_s
from rso_lidar.detector.ranging.gate_threshold import solve_gate_thresholds
from rso_lidar.detector.ranging.location import locate, locate_all
from rso_lidar.detector.ranging.matched_filter import Matched
from rso_lidar.detector.ranging.pulse import Pulse
from rso_lidar.detector.ranging.range_walk import correct_walk, tabulate_walk
from rso_lidar.detector.ranging.report import report_returns
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.stages.array_effects import draw_shift_m, latch_share
from rso_lidar.detector.stages.nonuniformity import CameraPixels
from rso_lidar.parallel import run_in_threads
from rso_lidar.records import Reading, Waveforms

_TRACES_AT_ONCE = 1024  # for one thread: some 0.3 ms
_LOOKED_FOR = 8  # returns in a trace: more do not fit between its ends


def measure(
    gsfl: Gsfl,
    waveforms: Waveforms,
    pulse: Pulse,
    rng: np.random.Generator,
    threads: int | None = 1,
    camera: CameraPixels | None = None,
) -> Reading:
    """Measure range and intensity of the stored samples.

    Parameters
    ----------
    gsfl : the detector.
    waveforms : what it stored.
    pulse : shape of the pulse behind the amplifier, which the sensor uses as known.
    rng : random generator of its jitter.
    threads : number of threads (None: one for each core). The result is the same to the bit.
    camera : the pixels that look (None: those of the detector's camera).

    Returns
    -------
    range, intensity and saturation of all pixels.
    """
    n_pixels = waveforms.shape[0] * waveforms.shape[1]
    camera = camera or build_camera(gsfl, n_pixels)
    flashes = math.sqrt(gsfl.gate.pulses if gsfl.gate else 1)  # each jitters independently
    jitter_s = _draw_normal(waveforms.pixel, n_pixels, rng) * (gsfl.timing.pixel_jitter_ns * units.NS / flashes)
    jitter_s += rng.standard_normal() * (gsfl.timing.frame_jitter_ns * units.NS / flashes)
    samples = waveforms.samples_counts - np.float32(waveforms.baseline_counts)
    if waveforms.clipped is None:
        clipped = waveforms.samples_counts >= gsfl.readout.full_scale_counts
    else:
        clipped = waveforms.clipped.copy()
    railed = None
    if gsfl.saturation is not None:
        railed = clipped | _is_on_rail(gsfl.saturation.rail_electrons, gsfl, waveforms, camera)
    unknown = gsfl.maps.unknown_fraction if gsfl.maps is not None else 1.0
    if unknown < 1.0:
        samples = samples - ((1.0 - unknown) * camera.offset_counts[waveforms.pixel, None]).astype(np.float32)
    found_s, amplitude = _locate_returns(gsfl, waveforms, pulse, samples, clipped, railed, threads)
    if gsfl.ranging.walk_correction:
        found_s = correct_walk(found_s, amplitude, _tabulate_walk(gsfl, pulse))
    if waveforms.zero_crossing_s is not None and gsfl.zero_crossing is not None:
        lead_s = crossing_lead_s(pulse, gsfl.zero_crossing.differentiator_s)
        timed_s = (waveforms.zero_crossing_s - lead_s - waveforms.start_s)[:, None]
        found_s = np.where(np.isfinite(timed_s), timed_s, found_s)
    delay_s = waveforms.start_s[:, None] + found_s + (jitter_s + unknown * camera.t0_s[waveforms.pixel])[:, None]
    if unknown < 1.0:
        gain = 1.0 + (camera.gain[waveforms.pixel] - 1.0) * (1.0 - unknown)
        amplitude = amplitude / gain[:, None]
    range_m = delay_s * units.RANGE_PER_DELAY_M_S
    range_m = np.where(range_m > 0.0, range_m, np.nan)  # nothing is reported from behind the lens
    if gsfl.crosstalk is not None and not gsfl.gate:
        share = latch_share(waveforms.latch_s, waveforms.latch_s, waveforms.sample_s, n_pixels)
        range_m = range_m + draw_shift_m(gsfl.crosstalk, share, rng)[:, None]
    return report_returns(
        waveforms.shape,
        waveforms.pixel,
        range_m,
        amplitude / gsfl.readout.counts_per_intensity,
        clipped if railed is None else railed,
        returns=gsfl.returns,
        max_returns=gsfl.max_returns,
        full_scale_counts=gsfl.full_scale_counts,
    )


def _draw_normal(pixel: np.ndarray, n_pixels: int, rng: np.random.Generator) -> np.ndarray:
    """Return a standard normal number for each of some pixels, which does not depend on the other pixels given.

    Each pixel of the array has a word of 32 bits; only the words of the given pixels are converted to normal numbers.

    Parameters
    ----------
    pixel : (trace) numbers of the pixels.
    n_pixels : pixels of the array.
    rng : random generator.
    """
    from scipy.special import ndtri

    words = rng.integers(0, 2**32, n_pixels, dtype=np.uint32)[pixel]
    normal: np.ndarray = ndtri((words + 0.5) * 2.0**-32)
    return normal


def _is_on_rail(rail_electrons: float, gsfl: Gsfl, waveforms: Waveforms, camera: CameraPixels) -> np.ndarray:
    """Return which samples (trace, sample) the amplifier's rail holds down, where it is below that of the converter.

    Parameters
    ----------
    rail_electrons : the rail [electrons].
    gsfl : the detector.
    waveforms : what it stored.
    camera : the pixels.
    """
    rail = waveforms.baseline_counts + rail_electrons / gsfl.readout.electrons_per_count
    low, within = gsfl.readout.low_gain, 1.0
    if low is not None and rail > gsfl.readout.full_scale_counts:
        within = low.ratio * (1.0 + 3.0 * low.noise_counts)
    held: np.ndarray = waveforms.samples_counts > rail + camera.offset_counts[waveforms.pixel, None] - within
    return held


def _locate_returns(
    gsfl: Gsfl,
    waveforms: Waveforms,
    pulse: Pulse,
    samples: np.ndarray,
    clipped: np.ndarray,
    railed: np.ndarray | None,
    threads: int | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return delays since the first sample [s] and amplitudes [counts] of the returns (trace, return), near to far.

    Parameters
    ----------
    gsfl : the detector.
    waveforms : what it stored.
    pulse : shape of a return.
    samples : (trace, sample) [counts] above the baseline, calibrated.
    clipped : (trace, sample) whether a sample is at the converter's rail.
    railed : (trace, sample) whether it is there or at the amplifier's rail; None where the amplifier does not saturate.
    threads : number of threads (None: one for each core).
    """
    per_count = gsfl.readout.electrons_per_count
    threshold = gsfl.trigger.threshold_electrons / per_count
    known = {
        "sample_s": waveforms.sample_s,
        "sigma_counts": gsfl.noise_counts,
        "pole_s": gsfl.amplifier.pole_s,
        "recovery_s": gsfl.saturation.recovery_ns * units.NS if gsfl.saturation is not None else 0.0,
    }
    if gsfl.gate is None and gsfl.max_returns == 1 and gsfl.returns == "first":
        start = np.full(len(samples), gsfl.readout.pretrigger_samples)

        def locate_some(block: slice) -> tuple[np.ndarray, np.ndarray]:
            some, mask = samples[block], _where_any(clipped[block])
            held = None if railed is None else railed[block]
            return locate(
                some, start[block], pulse, gsfl.ranging, **known, threshold_counts=threshold, clipped=mask, railed=held
            )

        blocks = [slice(k, k + _TRACES_AT_ONCE) for k in range(0, max(len(samples), 1), _TRACES_AT_ONCE)]
        found = zip(*run_in_threads(threads, locate_some, blocks), strict=True)
        delay_s, amplitude = (np.concatenate(pieces)[:, None] for pieces in found)
        return delay_s, amplitude
    least = np.full(len(samples), threshold)
    if gsfl.gate is not None:
        least = _solve_gate_thresholds(gsfl, waveforms, pulse, known["sigma_counts"])
    lowest = float(least.min(initial=np.inf)) if len(least) else threshold
    delay_s, amplitude = locate_all(
        samples,
        pulse,
        gsfl.ranging,
        **known,
        threshold_counts=lowest,
        most=_LOOKED_FOR,
        clipped=_where_any(clipped),
        railed=railed,
    )
    low = amplitude < least[:, None]
    delay_s, amplitude = np.where(low, np.nan, delay_s), np.where(low, 0.0, amplitude)
    # A pulse that peaks beyond the stored samples shows only a flank, which does not give its place.
    place = (delay_s + pulse.peak_s) / waveforms.sample_s
    with np.errstate(invalid="ignore"):
        outside = (place < -0.49) | (place > samples.shape[1] - 0.51)
    delay_s, amplitude = np.where(outside, np.nan, delay_s), np.where(outside, 0.0, amplitude)
    if gsfl.gate is not None:
        return _sort_by_range(delay_s, amplitude)
    # What latched is reported, even where its fitted amplitude is below the threshold that noise helped it over.
    none = np.flatnonzero(~np.isfinite(delay_s).any(axis=1))
    start = np.full(len(none), gsfl.readout.pretrigger_samples)
    mask = _where_any(clipped[none])
    held = None if railed is None else railed[none]
    latched = locate(
        samples[none], start, pulse, gsfl.ranging, **known, threshold_counts=threshold, clipped=mask, railed=held
    )
    delay_s[none, 0], amplitude[none, 0] = latched
    return _sort_by_range(delay_s, amplitude)


def _sort_by_range(delay_s: np.ndarray, amplitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the returns (trace, return) without gaps: NaN after the last."""
    order = np.argsort(delay_s, axis=1)
    return np.take_along_axis(delay_s, order, axis=1), np.take_along_axis(amplitude, order, axis=1)


def _where_any(clipped: np.ndarray) -> np.ndarray | None:
    return clipped if clipped.any() else None


def _solve_gate_thresholds(gsfl: Gsfl, waveforms: Waveforms, pulse: Pulse, sigma_counts: float) -> np.ndarray:
    """Return the amplitude [counts] above which each trace's returns are reported, at constant false-alarm rate.

    Parameters
    ----------
    gsfl : the detector, with a gate.
    waveforms : what it stored.
    pulse : shape of a return.
    sigma_counts : rms of the noise.
    """
    assert gsfl.gate is not None
    rate = waveforms.base_per_s
    if rate is None:
        rate = np.full(len(waveforms.pixel), gsfl.apd.dark_electrons_per_s)
    matched = Matched.of(pulse, waveforms.sample_s, gsfl.amplifier.pole_s, sigma_counts)
    return solve_gate_thresholds(
        gsfl.gate,
        rate,
        apd=gsfl.apd,
        amplifier=gsfl.amplifier,
        readout=gsfl.readout,
        matched=matched,
        offset_counts=gsfl.maps.offset_spread_counts * gsfl.maps.unknown_fraction if gsfl.maps else 0.0,
    )


@lru_cache(maxsize=8)
def _tabulate_walk(gsfl: Gsfl, pulse: Pulse) -> tuple[np.ndarray, np.ndarray]:
    """Return the walk of this detector's algorithm: amplitudes [counts] and the bias of delay [s] there."""
    per_count = gsfl.readout.electrons_per_count
    return tabulate_walk(
        pulse,
        gsfl.ranging,
        sample_s=gsfl.readout.sample_s,
        sigma_counts=gsfl.noise_counts,
        pole_s=gsfl.amplifier.pole_s,
        threshold_counts=gsfl.trigger.threshold_electrons / per_count,
        full_scale_counts=int(gsfl.readout.clip_counts),
    )
