"""Pixels that trigger themselves: the first crossing latches, and a few samples about it are stored."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rso_lidar import units
from rso_lidar.detector.chain.analog import Analog, simulate_analog
from rso_lidar.detector.chain.camera import FlashCamera
from rso_lidar.detector.chain.taps import cut_steps, tap_stages
from rso_lidar.detector.chain.timing import TimeAxis
from rso_lidar.detector.ranging.bipolar_pulse import differentiate, find_zero_crossings
from rso_lidar.detector.settings.apd import noise_rms
from rso_lidar.detector.settings.zero_crossing import ZeroCrossing
from rso_lidar.detector.stages.amplification import amplify
from rso_lidar.detector.stages.comparator import (
    NEAR,
    NEVER,
    find_crossings_between,
    find_latches,
    mark_watched,
    refine_crossings,
)
from rso_lidar.detector.stages.false_triggers import Comparators, draw_false_traces, draw_first_false
from rso_lidar.detector.stages.neighbour_coupling import gather_light
from rso_lidar.detector.stages.row_noise import AMPLIFIER, RowNoise
from rso_lidar.detector.stages.sampling import convert, merge_low_gain, store_samples
from rso_lidar.detector.stages.time_axis import Rows, place_rows
from rso_lidar.parallel import run_in_threads
from rso_lidar.records import Photons, Taps, Waveforms

_DARK = 1e-3  # of the threshold: so little light on a pixel changes nothing of when noise triggers it
_CERTAIN_DETECTION = 10.0  # light over threshold above which a row of any shape latches
_TIMED_AT_ONCE = 1024


def store_traces(
    camera: FlashCamera,
    photons: Photons,
    rng: np.random.Generator,
    *,
    with_taps: bool = False,
    threads: int | None = 1,
) -> tuple[Waveforms, Taps | None]:
    """Simulate the stored samples of self-triggering pixels.

    The first crossing of a threshold, by signal or by noise, starts a trace.
    """
    comparators, readout, pixels = camera.comparators, camera.readout, camera.front.pixels
    plan = camera.plan(_earliest_s(camera, photons))
    step_s, per_sample = plan.step_s, plan.steps_per_sample
    dark = _DARK * camera.threshold_photons
    sure = _CERTAIN_DETECTION * (1.0 + 5.0 * comparators.trigger.threshold_spread_fraction) * camera.threshold_photons
    seen = photons
    if camera.front.amplitude_crosstalk is not None:
        seen, sure = _gather_light(camera, photons, dark), math.inf  # a pixel that has latched still couples
    rows, arming = arm_rows(comparators, place_rows(seen, plan, dark, sure), step_s)
    axis = camera.axis(rows.length)
    signals = simulate_analog(camera.front, axis, photons, rows, rng, threads)
    base = camera.front.base_rate_per_s(photons)
    threshold = (comparators.trigger.threshold_electrons * pixels.threshold[rows.pixel]).astype(np.float32)
    stored_before = readout.pretrigger_samples * per_sample
    latch = latch_rows(comparators, axis, signals, threshold, base[rows.pixel], arming, stored_before, rng)
    fired = np.flatnonzero((latch >= 0.0) & ~pixels.dead[rows.pixel])
    row = fired[np.diff(rows.pixel[fired], prepend=-1) != 0]  # the first of each pixel
    pixel, latch_step = rows.pixel[row], rows.start[row] + latch[row]

    sunlight = None if photons.background_photons_per_s is None else base - pixels.dark_per_s
    noisy, false_s = draw_first_false(comparators, sunlight, rng)
    unwatched = ~_is_watched(rows, step_s, noisy, false_s)
    noisy, false_s = noisy[unwatched], false_s[unwatched]
    place, both = _find(pixel, noisy)
    late = both & (false_s >= np.append(latch_step, 0.0)[place] * step_s)
    real = np.ones(len(pixel), bool)
    real[place[both & ~late]] = False
    noisy, false_s = noisy[~late], false_s[~late]

    row, pixel, latch_step = row[real], pixel[real], latch_step[real]
    sample = np.floor(latch_step / per_sample).astype(np.int64) - readout.pretrigger_samples
    offset = pixels.offset_counts
    first = sample * per_sample - rows.start[row]
    counts = store_samples(readout, signals.amplitude, row, first, per_sample, readout.samples, offset[pixel])
    clipped = crossing_s = None
    if readout.low_gain is not None:
        clipped = merge_low_gain(readout, signals.amplitude, rows, row, first, per_sample, offset[pixel], counts, rng)
    if camera.zero_crossing is not None:
        latched = latch_step - rows.start[row]
        crossing_s = _time_crossings(camera.zero_crossing, axis, signals, row, latched, rng, threads)
    latch_s = latch_step * step_s
    n_steps = readout.samples * per_sample
    tapped = (
        [
            threshold[row],
            cut_steps(signals.primaries, row, first, n_steps) + (base[pixel, None] * step_s).astype(np.float32),
            cut_steps(signals.amplitude, row, first, n_steps),
        ]
        if with_taps
        else []
    )
    if len(noisy):
        level = comparators.trigger.threshold_electrons * pixels.threshold[noisy]
        noise, noise_sample = draw_false_traces(
            comparators.apd, comparators.amplifier, readout, false_s, level, base[noisy], rng
        )
        order = np.argsort(np.concatenate([pixel, noisy]))  # no pixel is in both
        if with_taps:
            between = np.full((len(noisy), n_steps), np.nan, np.float32)
            between[:, ::per_sample] = noise
            own = np.broadcast_to(base[noisy, None] * step_s, between.shape)
            added = level, own, between
            tapped = [_merge(first, other, order) for first, other in zip(tapped, added, strict=True)]
        counts = _merge(counts, convert(readout, noise, offset[noisy, None]), order)
        if clipped is not None:
            clipped = _merge(clipped, np.zeros(noise.shape, bool), order)
        if crossing_s is not None:
            crossing_s = _merge(crossing_s, np.full(len(noisy), np.nan), order)
        pixel, sample = _merge(pixel, noisy, order), _merge(sample, noise_sample, order)
        latch_s = _merge(latch_s, false_s, order)
    waveforms = Waveforms(
        shape=photons.shape,
        sample_s=readout.sample_s,
        baseline_counts=readout.baseline_counts,
        pixel=pixel,
        start_s=sample * readout.sample_s,
        latch_s=latch_s,
        samples_counts=counts,
        clipped=clipped,
        zero_crossing_s=crossing_s,
    )
    if not with_taps:
        return waveforms, None
    level, primaries, amplitude = tapped
    taps = tap_stages(
        photons.shape,
        step_s,
        pixel=pixel,
        start_s=waveforms.start_s,
        threshold=level,
        primaries=primaries,
        amplitude=amplitude,
    )
    return waveforms, taps


def arm_rows(comparators: Comparators, rows: Rows, step_s: float) -> tuple[Rows, np.ndarray]:
    """Restrict the watched part of rows to the armed window; also return which rows begin as the window opens."""
    opens, closes = (np.ceil(at_s / step_s) for at_s in (comparators.from_s, comparators.to_s))
    first = np.maximum(rows.first, (opens - rows.start).astype(np.int64))
    last = np.minimum(rows.last, (closes - rows.start).astype(np.int64))
    return replace(rows, first=first, last=last), first > rows.first


def latch_rows(
    comparators: Comparators,
    axis: TimeAxis,
    made: Analog,
    threshold: np.ndarray,
    base_per_s: np.ndarray,
    arming: np.ndarray,
    stored_before: int,
    rng: np.random.Generator,
) -> np.ndarray:
    """Return where (row) [steps] each row's comparator latches, the crossing of its threshold, or -1.

    Parameters
    ----------
    comparators : hysteresis, and the noise that they meet
    threshold : (row) [electrons]
    base_per_s : (row) primaries that no pulse makes [1/s]
    arming : (row) which rows begin as the pixel is armed
    stored_before : steps that are stored before a latch
    """
    rows, amplitude, bridge, step_s = made.rows, made.amplitude, axis.bridge, axis.step_s
    amplifier = comparators.amplifier
    latch = find_latches(
        amplitude,
        made.primaries,
        threshold,
        base_per_s,
        rows.first,
        rows.last,
        arming,
        hysteresis=comparators.trigger.hysteresis_electrons,
        step_s=step_s,
        quiet_electrons=amplifier.noise_electrons,
        shot_electrons_rs=float(noise_rms(comparators.apd, 1.0, 0.0, amplifier.pole_s, amplifier.integration_s)),
        reach=bridge.reach * bridge.sigma,
    )
    crossing = np.full(len(latch), float(NEVER))
    above = np.flatnonzero(latch >= 0)
    # A row that is above the threshold when its watch begins crossed before that, and is searched as far back as it holds
    # the samples of its trace. A row that continues another, or begins as the pixel is armed, was not above before.
    back = ~arming & (np.diff(rows.pixel, prepend=-1) != 0)
    earliest = np.where(back, np.minimum(stored_before, rows.first), rows.first)
    crossing[above] = refine_crossings(amplitude, above, threshold[above], latch[above], earliest[above])
    missed = np.flatnonzero(latch == NEAR)
    if not len(missed):
        return crossing
    watched = mark_watched(rows.length, rows.first[missed], rows.last[missed])
    sigma = comparators.noise_sigma(made.primaries[missed] / step_s + base_per_s[missed, None])
    crossing[missed] = find_crossings_between(
        amplitude[missed], made.mean(missed), threshold[missed], watched, sigma, bridge, rng
    )
    return crossing


def _gather_light(camera: FlashCamera, photons: Photons, least_photons: float) -> Photons:
    """Return light that marks when pixels have a signal of their own or of their neighbours, to place rows by."""
    crosstalk, saturation = camera.front.amplitude_crosstalk, camera.front.saturation
    assert crosstalk is not None
    most = math.inf
    if saturation is not None:
        most = saturation.rail_electrons / (camera.electrons_per_photon * camera.pulse.peak)
    return gather_light(crosstalk, photons, least_photons, most)


def _earliest_s(camera: FlashCamera, photons: Photons) -> float:
    """Return how long before its delay the brightest pixel's light can pass half the threshold [s]; 0 where it does not."""
    brightest = float(np.bincount(photons.pixel, photons.photons).max(initial=0.0)) if len(photons.pixel) else 0.0
    pulse = camera.pulse
    over = brightest * camera.electrons_per_photon * pulse.peak / camera.comparators.trigger.threshold_electrons
    return max(-pulse.rise_s(0.5 / over), 0.0) if over > 1.0 else 0.0


def _is_watched(rows: Rows, step_s: float, pixel: np.ndarray, at_s: np.ndarray) -> np.ndarray:
    """Return whether rows, rather than rates, decide what noise does to pixels at given times, one for each [s]."""
    row, end = np.searchsorted(rows.pixel, pixel), np.searchsorted(rows.pixel, pixel, "right")
    watched = np.zeros(len(pixel), bool)
    while (row < end).any():  # a pixel has few rows
        some = np.flatnonzero(row < end)
        step, of = at_s[some] / step_s - rows.start[row[some]], row[some]
        watched[some] |= (step >= rows.first[of]) & (step <= rows.last[of] - 1)  # `last` itself is not looked at
        row = row + 1
    return watched


def _merge(one: np.ndarray, other: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Return the entries of two arrays in a given order, with the type of the first.

    Parameters
    ----------
    order : places in the first array followed by the second
    """
    merged: np.ndarray = np.concatenate([one, other], dtype=one.dtype, casting="unsafe")[order]
    return merged


def _find(pixel: np.ndarray, asked: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the index of each pixel `asked` among ascending ones, or where it would be, and whether it is there."""
    place = np.searchsorted(pixel, asked)
    return place, np.append(pixel, -1)[place] == asked


def _time_crossings(
    settings: ZeroCrossing,
    axis: TimeAxis,
    made: Analog,
    row: np.ndarray,
    latch: np.ndarray,
    rng: np.random.Generator,
    threads: int | None = 1,
) -> np.ndarray:
    """Return when (trace) the bipolar pulses of some rows cross zero [s since emission], NaN where they do not arm.

    Signal and shot noise are those of the sampled channel. The noise of this channel's amplifier is drawn apart, behind the
    differentiator, which comes before it.

    Parameters
    ----------
    row, latch : (trace) row, and where its comparator latched [steps]
    """
    still, rows, step_s = made.still, made.rows, axis.step_s
    assert still is not None
    assert axis.timing is not None
    n, (quiet, noisy) = rows.length, axis.timing
    noise = RowNoise.of(rows, rng)
    crossing = np.empty(len(row))

    def time_block(block: slice) -> None:
        some = row[block]
        signal, added = (np.empty((len(some), n), np.float32) for _ in range(2))
        nothing = np.zeros((len(some), n), np.float32)
        words = RowNoise(noise.key, noise.pixel[some], noise.start[some]).draw(AMPLIFIER, 1, n)[0]
        amplify(quiet, still.mean[some], still.excess[some], still.gain[some], words, signal)
        amplify(noisy, nothing, nothing, still.gain[some], words, added)
        bipolar = differentiate(signal, settings.differentiator_s, step_s)
        bipolar += added
        earliest = latch[block] - settings.hold_ns * units.NS / step_s
        crossing[block] = find_zero_crossings(settings, bipolar, earliest, step_s)

    run_in_threads(threads, time_block, [slice(k, k + _TIMED_AT_ONCE) for k in range(0, len(row), _TIMED_AT_ONCE)])
    crossing_s: np.ndarray = (rows.start[row] + crossing) * step_s
    return crossing_s
