"""Pixels that trigger themselves: the first crossing latches, and a few samples about it are stored."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rso_lidar import units
from rso_lidar.detector.chain.analog import Analog, base_rate_per_s, simulate_analog
from rso_lidar.detector.chain.bipolar_channel import time_crossings
from rso_lidar.detector.chain.camera import build_camera
from rso_lidar.detector.chain.taps import cut_steps, tap_stages
from rso_lidar.detector.chain.timing import plan_time, shape_pulse
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.settings.noise import noise_rms
from rso_lidar.detector.stages.comparator import (
    NEAR,
    NEVER,
    find_crossings_between,
    find_latches,
    make_bridge,
    mark_watched,
    refine_crossings,
)
from rso_lidar.detector.stages.false_triggers import Armed, draw_false_traces, draw_first_false
from rso_lidar.detector.stages.nonuniformity import CameraPixels
from rso_lidar.detector.stages.sampling import convert, merge_low_gain, store_samples
from rso_lidar.detector.stages.time_axis import Rows, place_rows
from rso_lidar.records import Photons, Taps, Waveforms

_DARK = 1e-3  # of the threshold: so little light on a pixel changes nothing of when noise triggers it
_CERTAIN_DETECTION = 10.0  # light over threshold above which a row of any shape latches


def store_traces(
    gsfl: Gsfl,
    photons: Photons,
    rng: np.random.Generator,
    *,
    with_taps: bool = False,
    threads: int | None = 1,
    camera: CameraPixels | None = None,
) -> tuple[Waveforms, Taps | None]:
    """Simulate the stored samples of self-triggering pixels.

    The first crossing of a threshold, by signal or by noise, starts a trace.

    Parameters
    ----------
    gsfl : the detector, without a gate.
    photons : light on every pixel.
    rng : random generator.
    with_taps : also return the signals between the stages.
    threads : number of threads (None: one for each core). The result is the same to the bit.
    camera : the pixels that look (None: those of the detector's camera).

    Returns
    -------
    the stored samples, and the signals between the stages (None unless requested).
    """
    n_pixels = photons.shape[0] * photons.shape[1]
    camera = camera or build_camera(gsfl, n_pixels)
    plan = plan_time(gsfl, photons.pulse_fwhm_s, _earliest_s(gsfl, photons))
    per_sample = plan.steps_per_sample
    dark = _DARK * gsfl.traits.threshold_photons
    sure = _CERTAIN_DETECTION * (1.0 + 5.0 * gsfl.trigger.threshold_spread_fraction) * gsfl.traits.threshold_photons
    rows, arming = arm_rows(gsfl, place_rows(photons, plan, dark, sure), plan.step_s)
    made = simulate_analog(gsfl, photons, rows, plan, camera, rng, threads)
    base = base_rate_per_s(gsfl.quantum_efficiency, camera, photons)
    threshold = (gsfl.trigger.threshold_electrons * camera.threshold[rows.pixel]).astype(np.float32)
    latch = latch_rows(gsfl, made, threshold, base[rows.pixel], arming, plan.step_s, rng)
    fired = np.flatnonzero((latch >= 0.0) & ~camera.dead[rows.pixel])
    row = fired[np.diff(rows.pixel[fired], prepend=-1) != 0]  # the first of each pixel
    pixel, latch_step = rows.pixel[row], rows.start[row] + latch[row]

    sunlight = None if photons.background_photons_per_s is None else base - camera.dark_per_s
    noisy, false_s = draw_first_false(arm_comparators(gsfl, camera), sunlight, rng)
    unwatched = ~_is_watched(rows, plan.step_s, noisy, false_s)
    noisy, false_s = noisy[unwatched], false_s[unwatched]
    place, both = _find(pixel, noisy)
    late = both & (false_s >= np.append(latch_step, 0.0)[place] * plan.step_s)
    real = np.ones(len(pixel), bool)
    real[place[both & ~late]] = False
    noisy, false_s = noisy[~late], false_s[~late]

    row, pixel, latch_step = row[real], pixel[real], latch_step[real]
    sample = np.floor(latch_step / per_sample).astype(np.int64) - gsfl.readout.pretrigger_samples
    offset = camera.offset_counts
    first = sample * per_sample - rows.start[row]
    counts = store_samples(gsfl.readout, made.amplitude, row, first, per_sample, gsfl.readout.samples, offset[pixel])
    clipped = crossing_s = None
    if gsfl.readout.low_gain is not None:
        clipped = merge_low_gain(gsfl.readout, made.amplitude, rows, row, first, per_sample, offset[pixel], counts, rng)
    if gsfl.zero_crossing is not None:
        crossing_s = time_crossings(gsfl, made, row, latch_step - rows.start[row], plan.step_s, rng, threads)
    latch_s = latch_step * plan.step_s
    n_steps = gsfl.readout.samples * per_sample
    tapped = (
        [
            threshold[row],
            cut_steps(made.primaries, row, first, n_steps) + (base[pixel, None] * plan.step_s).astype(np.float32),
            cut_steps(made.amplitude, row, first, n_steps),
        ]
        if with_taps
        else []
    )
    if len(noisy):
        level = gsfl.trigger.threshold_electrons * camera.threshold[noisy]
        noise, noise_sample = draw_false_traces(
            gsfl.apd, gsfl.amplifier, gsfl.readout, false_s, level, base[noisy], rng
        )
        order = np.argsort(np.concatenate([pixel, noisy]))  # no pixel is in both
        if with_taps:
            between = np.full((len(noisy), n_steps), np.nan, np.float32)
            between[:, ::per_sample] = noise
            own = np.broadcast_to(base[noisy, None] * plan.step_s, between.shape)
            added = level, own, between
            tapped = [_merge(one, other, order) for one, other in zip(tapped, added, strict=True)]
        counts = _merge(counts, convert(gsfl.readout, noise, offset[noisy, None]), order)
        if clipped is not None:
            clipped = _merge(clipped, np.zeros(noise.shape, bool), order)
        if crossing_s is not None:
            crossing_s = _merge(crossing_s, np.full(len(noisy), np.nan), order)
        pixel, sample = _merge(pixel, noisy, order), _merge(sample, noise_sample, order)
        latch_s = _merge(latch_s, false_s, order)
    waveforms = Waveforms(
        shape=photons.shape,
        sample_s=gsfl.readout.sample_s,
        baseline_counts=gsfl.readout.baseline_counts,
        pixel=pixel,
        start_s=sample * gsfl.readout.sample_s,
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
        plan.step_s,
        pixel=pixel,
        start_s=waveforms.start_s,
        threshold=level,
        primaries=primaries,
        amplitude=amplitude,
    )
    return waveforms, taps


def arm_rows(gsfl: Gsfl, rows: Rows, step_s: float) -> tuple[Rows, np.ndarray]:
    """Restrict the watched part of rows to the armed window; also return which rows begin as the window opens.

    Parameters
    ----------
    gsfl : the detector.
    rows : stretches of time.
    step_s : length of a step [s].

    Returns
    -------
    the rows, and a mask (row) of those that begin as the window opens.
    """
    opens, closes = (np.ceil(m / units.RANGE_PER_DELAY_M_S / step_s) for m in (gsfl.armed_from_m, gsfl.armed_to_m))
    first = np.maximum(rows.first, (opens - rows.start).astype(np.int64))
    last = np.minimum(rows.last, (closes - rows.start).astype(np.int64))
    return replace(rows, first=first, last=last), first > rows.first


def latch_rows(
    gsfl: Gsfl,
    made: Analog,
    threshold: np.ndarray,
    base_per_s: np.ndarray,
    arming: np.ndarray,
    step_s: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """Return where (row) [steps] each row's comparator latches, the crossing of its threshold, or -1.

    Parameters
    ----------
    gsfl : the detector.
    made : the amplifier's output.
    threshold : (row) [electrons].
    base_per_s : (row) primaries that no pulse makes [1/s].
    arming : (row) which rows begin as the pixel is armed.
    step_s : length of a step [s].
    rng : random generator of the noise between the steps.
    """
    rows, amplitude, bridge, amplifier = (
        made.rows,
        made.amplitude,
        make_bridge(gsfl.amplifier.pole_s, step_s),
        gsfl.amplifier,
    )
    latch = find_latches(
        amplitude,
        made.primaries,
        threshold,
        base_per_s,
        rows.first,
        rows.last,
        arming,
        hysteresis=gsfl.trigger.hysteresis_electrons,
        step_s=step_s,
        quiet_electrons=amplifier.noise_electrons,
        shot_electrons_rs=float(noise_rms(gsfl.apd, 1.0, 0.0, amplifier.pole_s, amplifier.integration_s)),
        reach=bridge.reach * bridge.sigma,
    )
    crossing = np.full(len(latch), float(NEVER))
    above = np.flatnonzero(latch >= 0)
    # A row that is above the threshold when its watch begins crossed before that, and is searched as far back as it holds
    # the samples of its trace. A row that continues another, or begins as the pixel is armed, was not above before.
    back = ~arming & (np.diff(rows.pixel, prepend=-1) != 0)
    stored_before = gsfl.readout.pretrigger_samples * round(gsfl.readout.sample_s / step_s)
    earliest = np.where(back, np.minimum(stored_before, rows.first), rows.first)
    crossing[above] = refine_crossings(amplitude, above, threshold[above], latch[above], earliest[above])
    missed = np.flatnonzero(latch == NEAR)
    if not len(missed):
        return crossing
    watched = mark_watched(rows.length, rows.first[missed], rows.last[missed])
    sigma = noise_sigma(gsfl, made.primaries[missed] / step_s + base_per_s[missed, None])
    crossing[missed] = find_crossings_between(
        amplitude[missed], made.mean(missed), threshold[missed], watched, sigma, bridge, rng
    )
    return crossing


def noise_sigma(gsfl: Gsfl, rate_per_s: np.ndarray) -> np.ndarray:
    """Return the rms noise [electrons] at this rate of primaries [1/s], of any origin."""
    amplifier = gsfl.amplifier
    return noise_rms(gsfl.apd, rate_per_s, amplifier.noise_electrons, amplifier.pole_s, amplifier.integration_s)


def arm_comparators(gsfl: Gsfl, camera: CameraPixels) -> Armed:
    """Return the comparators of a camera as they wait for noise."""
    from_s, to_s = (m / units.RANGE_PER_DELAY_M_S for m in (gsfl.armed_from_m, gsfl.armed_to_m))
    return Armed(gsfl.apd, gsfl.amplifier, gsfl.trigger.threshold_electrons, camera, from_s, to_s)


def _earliest_s(gsfl: Gsfl, photons: Photons) -> float:
    """Return how long before its delay the brightest pixel's light can pass half the threshold [s]; 0 where it does not."""
    brightest = float(np.bincount(photons.pixel, photons.photons).max(initial=0.0)) if len(photons.pixel) else 0.0
    pulse = shape_pulse(gsfl, photons)
    over = brightest * gsfl.electrons_per_photon * pulse.peak / gsfl.trigger.threshold_electrons
    return max(-pulse.rise_s(0.5 / over), 0.0) if over > 1.0 else 0.0


def _is_watched(rows: Rows, step_s: float, pixel: np.ndarray, at_s: np.ndarray) -> np.ndarray:
    """Return whether rows, rather than rates, decide what noise does to pixels at given times.

    Parameters
    ----------
    rows : stretches of time.
    step_s : length of a step [s].
    pixel, at_s : numbers of pixels, and a time for each [s].
    """
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
    one, other : what to merge.
    order : places in the first array followed by the second.
    """
    merged: np.ndarray = np.concatenate([one, other], dtype=one.dtype, casting="unsafe")[order]
    return merged


def _find(pixel: np.ndarray, asked: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the index of each pixel `asked` among ascending ones, or where it would be, and whether it is there."""
    place = np.searchsorted(pixel, asked)
    return place, np.append(pixel, -1)[place] == asked
