"""The signal chain, stage by stage: photons become primaries, electrons, volts, a latch, samples and counts.

Each stage is a function of arrays and of its own part's settings, in the order of the photon's life; `traces` walks them for
pixels that trigger themselves, `gated` for pixels that all store one stretch of time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar import units
from rso_lidar.detector.amplifier import Filters, amplified, filters
from rso_lidar.detector.apd import multiply
from rso_lidar.detector.false_triggers import false_traces, first_false_s
from rso_lidar.detector.focal_plane import Camera
from rso_lidar.detector.noise import noise_rms
from rso_lidar.detector.overlap import Overlap, blocks
from rso_lidar.detector.trigger import NEAR, NEVER, crossed_between, crossing_places, first_or_near, watched_steps
from rso_lidar.detector.waveform import Laying, Plan, Rows, expected, laid, pulse_transfer, rows_about
from rso_lidar.records import Photons, Waveforms

if TYPE_CHECKING:
    from rso_lidar.detector.gsfl import Gsfl


# Fewer expected photoelectrons in a step are the rounding of the transform, or a tail that no one sees.
_LEAST_PRIMARIES = np.float32(1e-4)

_DARK = 1e-3  # of the threshold: so little light on a pixel changes nothing of when noise triggers it
_SURE = 10.0  # times the threshold: so much light in the watched part of a row latches, however it is spread there
_ROWS_AT_ONCE = 2048  # what is worked on stays in the cache, and threads do not wait for each other


@dataclass(frozen=True, eq=False)
class Analog:
    """The amplifier's output about the returns, with what led to it; arrays (row, step), rates per step."""

    rows: Rows
    light: np.ndarray  # expected photons, each return a flash of no length
    primaries: np.ndarray  # expected photoelectrons of the signal
    electrons: np.ndarray  # drawn, after the APD; dark current and background included
    amplitude: np.ndarray  # electrons above the baseline, after the amplifier
    transfer: np.ndarray  # what light is multiplied by, transformed along time, to be the mean of amplitude
    gain: np.ndarray | None = None  # relative to what the transfer reckons with: bias droop, gain of the pixels

    def mean(self, rows: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Return the amplitude (row, step) [electrons] of some rows without noise."""
        from scipy.fft import irfft, rfft

        light = self.light[rows] if self.gain is None else self.light[rows] * self.gain[rows]
        mean: np.ndarray = irfft(rfft(light, axis=1) * self.transfer, self.rows.length, axis=1)
        return mean


def quick(rng: np.random.Generator) -> np.random.Generator:
    """Return a generator for many draws, a fifth faster than the counter-based one that names each frame."""
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence(rng.integers(0, 2**32, 4).tolist())))


def base_rate_per_s(gsfl: Gsfl, camera: Camera, photons: Photons) -> np.ndarray:
    """Return the primaries of each pixel that no pulse makes [1/s]: dark current and sunlight."""
    rate = gsfl.dark_per_s(camera)
    if photons.background_photons_per_s is not None:
        rate += gsfl.quantum_efficiency * photons.background_photons_per_s.ravel()
    return rate


def speckled(gsfl: Gsfl, photons: Photons, rng: np.random.Generator) -> np.ndarray | None:
    """Return the factors (return) that speckle puts on the photons, one draw for each cluster; None without speckle."""
    if gsfl.speckle is None or not len(photons.pixel):
        return None
    cells = np.bincount(photons.cluster, photons.coherence_cells, len(photons.cluster_pixel))
    factors: np.ndarray = gsfl.speckle.factors(cells, rng)[photons.cluster]
    return factors


def analog(
    gsfl: Gsfl, photons: Photons, rows: Rows, plan: Plan, camera: Camera, rng: np.random.Generator | None
) -> Analog:
    """Return the amplifier's output over the rows; without a generator the mean of it, free of noise."""
    n, gain = rows.length, np.float32(gsfl.apd.gain)
    amplifier = filters(gsfl.amplifier, n, plan.step_s)
    light = expected(photons, rows, plan.step_s, speckled(gsfl, photons, rng) if rng else None)
    laying = _laying(
        amplifier,
        gsfl.quantum_efficiency,
        gsfl.apd.gain,
        photons.pulse_step_s,
        photons.pulse_power_per_s.tobytes(),
    )
    primaries, amplitude = (np.empty(light.shape, np.float32) for _ in range(2))
    electrons = primaries if rng is None else np.empty(light.shape, np.float32)
    base = (base_rate_per_s(gsfl, camera, photons) * plan.step_s).astype(np.float32)[rows.pixel]
    common = float(base.min(initial=np.inf)) if len(base) else 0.0
    pixel_gain = camera.gain[rows.pixel].astype(np.float32)

    overlap = Overlap.of(rows)
    wait = rng is not None and gsfl.droop is not None  # the whole array decides the gain
    waiting: list[tuple[np.ndarray, np.ndarray]] = []
    for block in blocks(rows, _ROWS_AT_ONCE):
        primaries[block], quiet = laid(light[block], laying, _LEAST_PRIMARIES)
        if rng is None:
            amplitude[block] = quiet * pixel_gain[block, None]
            continue
        again = overlap.part(block)
        again.carry(primaries[block])
        excess = primaries[block] + base[block, None]
        electrons[block] = multiply(excess, gsfl.apd, rng, base=common)
        again.carry(electrons[block])
        excess *= -gain
        excess += electrons[block]
        if wait:
            waiting.append((quiet, excess))
        else:
            amplitude[block] = amplified(amplifier, quiet, excess, pixel_gain[block], rng, again)
    relative = None
    if gsfl.maps is not None:
        relative = pixel_gain[:, None]
    if wait and rng is not None:
        steady = np.float32(gsfl.apd.gain) * base[:, None]
        sag = drooped_gain(gsfl, rows, electrons - steady, photons, plan.step_s) - np.float32(1.0)
        relative = (sag + np.float32(1.0)) * (np.float32(1.0) if relative is None else relative)
        for block, (quiet, excess) in zip(blocks(rows, _ROWS_AT_ONCE), waiting, strict=True):
            excess += electrons[block] * sag[block]
            amplitude[block] = amplified(amplifier, quiet, excess, pixel_gain[block], rng, overlap.part(block))
    if rng is None:
        electrons = gain * primaries
    if gsfl.saturation is not None:
        amplitude = gsfl.saturation.limited(amplitude, plan.step_s)
    return Analog(rows, light, primaries, electrons, amplitude, laying.amplified, relative)


@lru_cache(maxsize=16)
def _laying(amplifier: Filters, efficiency: float, gain: float, pulse_step_s: float, power_per_s: bytes) -> Laying:
    """Return what lays the laser's pulse over light, made once: to primaries, and on to the amplitude."""
    pulse = efficiency * pulse_transfer(pulse_step_s, np.frombuffer(power_per_s), amplifier.n, amplifier.step_s)
    return Laying.of(pulse, gain * pulse * amplifier.mean, amplifier.n)


def drooped_gain(gsfl: Gsfl, rows: Rows, electrons: np.ndarray, photons: Photons, step_s: float) -> np.ndarray:
    """Return the gain (row, step) relative to rest in the dark, while the whole array draws on the bias supply.

    Steady sunlight has sagged it before the flash, and the dark current belongs to rest: neither counts among the electrons
    of the flash. Rows of a pixel that overlap in time hold the same light once.

    Parameters
    ----------
    gsfl : the detector, with a droop.
    rows : stretches of time of the lit pixels.
    electrons : (row, step) electrons drawn at the gain of rest, less the mean of dark current and sunlight.
    photons : the light, for its steady background.
    step_s : length of a step [s].
    """
    assert gsfl.droop is not None
    if not len(rows.pixel):
        return electrons
    begin = int(rows.start.min())
    place = (rows.start - begin)[:, None] + np.arange(rows.length)
    again = np.diff(rows.pixel, prepend=-1) == 0
    covered = np.where(again, np.roll(rows.start, 1) + rows.length - begin, 0)
    drawn = np.where(place >= covered[:, None], electrons, np.float32(0.0))
    steady_per_s = 0.0
    if photons.background_photons_per_s is not None:
        steady_per_s = float(photons.background_photons_per_s.sum()) * gsfl.quantum_efficiency * gsfl.apd.gain
    span = int(place.max()) + 1
    if span > 2**24:  # far-apart returns: the supply recovers between them
        begins, place = np.unique(place, return_inverse=True)
        place, span = place.reshape(electrons.shape), len(begins)
    current = np.bincount(place.ravel(), drawn.ravel(), span)
    gain: np.ndarray = gsfl.droop.gain(current, step_s, steady_per_s).astype(np.float32)[place]
    return gain


def armed(gsfl: Gsfl, rows: Rows, step_s: float) -> tuple[Rows, np.ndarray]:
    """Return the rows watched only inside the armed window, and which of them begin to be watched as it opens."""
    opens, closes = (np.ceil(m / units.RANGE_PER_DELAY_M_S / step_s) for m in (gsfl.armed_from_m, gsfl.armed_to_m))
    first = np.maximum(rows.first, (opens - rows.start).astype(np.int64))
    last = np.minimum(rows.last, (closes - rows.start).astype(np.int64))
    return replace(rows, first=first, last=last), first > rows.first


def latched(
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
    rows, amplitude, bridge, amplifier = made.rows, made.amplitude, gsfl.bridge(step_s), gsfl.amplifier
    latch = first_or_near(
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
    crossing[above] = crossing_places(amplitude, above, threshold[above], latch[above], earliest[above])
    missed = np.flatnonzero(latch == NEAR)
    if not len(missed):
        return crossing
    watched = watched_steps(rows.length, rows.first[missed], rows.last[missed])
    sigma = noise_sigma(gsfl, made.primaries[missed] / step_s + base_per_s[missed, None])
    crossing[missed] = crossed_between(
        amplitude[missed], made.mean(missed), threshold[missed], watched, sigma, bridge, rng
    )
    return crossing


def noise_sigma(gsfl: Gsfl, rate_per_s: np.ndarray) -> np.ndarray:
    """Return the rms [electrons] of the noise where so many primaries come a second, of whatever origin."""
    amplifier = gsfl.amplifier
    return noise_rms(gsfl.apd, rate_per_s, amplifier.noise_electrons, amplifier.pole_s, amplifier.integration_s)


def traces(gsfl: Gsfl, photons: Photons, rng: np.random.Generator) -> Waveforms:
    """Return what pixels store that trigger themselves, on light or on noise: the first crossing latches."""
    rng = quick(rng)
    n_pixels = photons.shape[0] * photons.shape[1]
    camera = gsfl.camera(n_pixels)
    plan = gsfl.plan(photons.pulse_fwhm_s, _earliest_s(gsfl, photons))
    per_sample = plan.steps_per_sample
    dark = _DARK * gsfl.threshold_photons
    sure = _SURE * (1.0 + 5.0 * gsfl.trigger.threshold_spread_fraction) * gsfl.threshold_photons
    rows, arming = armed(gsfl, rows_about(photons, plan, n_pixels, dark, sure), plan.step_s)
    made = analog(gsfl, photons, rows, plan, camera, rng)
    base = base_rate_per_s(gsfl, camera, photons)
    threshold = (gsfl.trigger.threshold_electrons * camera.threshold[rows.pixel]).astype(np.float32)
    latch = latched(gsfl, made, threshold, base[rows.pixel], arming, plan.step_s, rng)
    fired = np.flatnonzero((latch >= 0.0) & ~camera.dead[rows.pixel])
    row = fired[np.diff(rows.pixel[fired], prepend=-1) != 0]  # the first of each pixel
    pixel, latch_step = rows.pixel[row], rows.start[row] + latch[row]

    sunlight = None if photons.background_photons_per_s is None else base - gsfl.dark_per_s(camera)
    noisy, false_s = first_false_s(gsfl, n_pixels, sunlight, rng)
    unwatched = ~_watched(rows, plan.step_s, noisy, false_s)
    noisy, false_s = noisy[unwatched], false_s[unwatched]
    place, both = _among(pixel, noisy)
    late = both & (false_s >= np.append(latch_step, 0.0)[place] * plan.step_s)
    real = np.ones(len(pixel), bool)
    real[place[both & ~late]] = False
    noisy, false_s = noisy[~late], false_s[~late]

    row, pixel, latch_step = row[real], pixel[real], latch_step[real]
    sample = np.floor(latch_step / per_sample).astype(np.int64) - gsfl.readout.pretrigger_samples
    offset = camera.offset_counts
    first = sample * per_sample - rows.start[row]
    counts = gsfl.readout.store(made.amplitude, row, first, per_sample, gsfl.readout.samples, offset[pixel])
    latch_s = latch_step * plan.step_s
    if len(noisy):
        level = gsfl.trigger.threshold_electrons * camera.threshold[noisy]
        noise, noise_sample = false_traces(gsfl, false_s, level, base[noisy], rng)
        at = np.searchsorted(pixel, noisy)
        counts = np.insert(counts, at, gsfl.readout.convert(noise, offset[noisy, None]), axis=0)
        pixel, sample = np.insert(pixel, at, noisy), np.insert(sample, at, noise_sample)
        latch_s = np.insert(latch_s, at, false_s)
    return Waveforms(
        shape=photons.shape,
        sample_s=gsfl.readout.sample_s,
        baseline_counts=gsfl.readout.baseline_counts,
        pixel=pixel,
        start_s=sample * gsfl.readout.sample_s,
        latch_s=latch_s,
        samples_counts=counts,
    )


def _earliest_s(gsfl: Gsfl, photons: Photons) -> float:
    """Return how long before its delay the brightest pixel's light can pass half the threshold [s]; 0 where it does not."""
    brightest = float(np.bincount(photons.pixel, photons.photons).max(initial=0.0)) if len(photons.pixel) else 0.0
    pulse = gsfl.pulse(photons)
    over = brightest * gsfl.electrons_per_photon * pulse.peak / gsfl.trigger.threshold_electrons
    return max(-pulse.rise_s(0.5 / over), 0.0) if over > 1.0 else 0.0


def _watched(rows: Rows, step_s: float, pixel: np.ndarray, at_s: np.ndarray) -> np.ndarray:
    """Return whether rows say what noise does to these pixels at these times [s]."""
    row, end = np.searchsorted(rows.pixel, pixel), np.searchsorted(rows.pixel, pixel, "right")
    watched = np.zeros(len(pixel), bool)
    while (row < end).any():  # a pixel has few rows
        some = np.flatnonzero(row < end)
        step, of = at_s[some] / step_s - rows.start[row[some]], row[some]
        watched[some] |= (step >= rows.first[of]) & (step <= rows.last[of] - 1)  # `last` itself is not looked at
        row = row + 1
    return watched


def _among(pixel: np.ndarray, asked: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where each pixel asked for stands, or would, among rising ones, and whether it is there."""
    place = np.searchsorted(pixel, asked)
    return place, np.append(pixel, -1)[place] == asked


def gated(gsfl: Gsfl, photons: Photons, rng: np.random.Generator) -> Waveforms:
    """Return what all pixels store of the gate, the average over its pulses; nothing triggers."""
    assert gsfl.gate is not None
    rng = quick(rng)
    n_pixels = photons.shape[0] * photons.shape[1]
    camera = gsfl.camera(n_pixels)
    plan = gsfl.plan(photons.pulse_fwhm_s)
    n_samples = gsfl.gate.n_samples(gsfl.readout.sample_s)
    rows, sample = gate_rows(gsfl, plan, n_pixels)
    first = np.full(n_pixels, plan.before)
    total = np.zeros((n_pixels, n_samples), np.float32)
    clipped = np.zeros((n_pixels, n_samples), bool)
    for _ in range(gsfl.gate.pulses):
        amplitude = analog(gsfl, photons, rows, plan, camera, rng).amplitude
        counts = gsfl.readout.store(
            amplitude, rows.pixel, first, plan.steps_per_sample, n_samples, camera.offset_counts
        )
        clipped |= counts >= gsfl.readout.full_scale_counts
        total += counts
    alive = np.flatnonzero(~camera.dead)
    return Waveforms(
        shape=photons.shape,
        sample_s=gsfl.readout.sample_s,
        baseline_counts=gsfl.readout.baseline_counts,
        pixel=alive,
        start_s=np.full(len(alive), sample * gsfl.readout.sample_s),
        latch_s=np.full(len(alive), np.nan),
        samples_counts=total[alive] / np.float32(gsfl.gate.pulses),
        clipped=clipped[alive],
        base_per_s=base_rate_per_s(gsfl, camera, photons)[alive],
    )


def gate_rows(gsfl: Gsfl, plan: Plan, n_pixels: int) -> tuple[Rows, int]:
    """Return one row for each pixel over the gate, and the number of the gate's first sample since emission."""
    from scipy.fft import next_fast_len

    assert gsfl.gate is not None
    sample = int(np.ceil(gsfl.gate.delay_ns * units.NS / gsfl.readout.sample_s - 1e-6))
    stored = gsfl.gate.n_samples(gsfl.readout.sample_s) * plan.steps_per_sample
    # The transform wraps around: as much room after the gate as the filter remembers, and half a pulse on both sides.
    length = int(next_fast_len(plan.before + stored + plan.rise, real=True))
    pixel = np.arange(n_pixels)
    start = np.full(n_pixels, sample * plan.steps_per_sample - plan.before)
    nothing = np.zeros(n_pixels, np.int64)
    return Rows(pixel, start, nothing, nothing, length), sample
