"""The whole chain of a detector: the samples that it stores of a flash, and its reading of them."""

from __future__ import annotations

import numpy as np

from rso_lidar.detector.chain.analog import simulate_analog
from rso_lidar.detector.chain.camera import FlashCamera
from rso_lidar.detector.chain.charge_spill import spill_charge
from rso_lidar.detector.chain.measurement import measure
from rso_lidar.detector.chain.taps import cut_steps, tap_stages
from rso_lidar.detector.chain.traces import store_traces
from rso_lidar.detector.stages.sampling import merge_low_gain, store_samples
from rso_lidar.detector.stages.time_axis import place_gate_rows
from rso_lidar.records import Photons, Reading, Taps, Waveforms


def run_chain(
    camera: FlashCamera,
    photons: Photons,
    rng: np.random.Generator,
    *,
    with_taps: bool = False,
    threads: int | None = 1,
) -> tuple[Reading, Waveforms, Taps | None]:
    """Return the reading of one flash, the stored samples, and the signals between the stages (None unless requested)."""
    waveforms, taps = store_waveforms(camera, photons, rng, with_taps=with_taps, threads=threads)
    return measure(camera.processor, waveforms, rng, threads), waveforms, taps


def store_waveforms(
    camera: FlashCamera, photons: Photons, rng: np.random.Generator, *, with_taps: bool = False, threads: int | None = 1
) -> tuple[Waveforms, Taps | None]:
    """Return the samples that the pixels store of one flash, and the signals between the stages (None unless requested)."""
    if camera.bloom is not None:
        photons = spill_charge(camera.bloom, photons, camera.electrons_per_photon)
    store = _store_gate if camera.gate else store_traces
    return store(camera, photons, rng, with_taps=with_taps, threads=threads)


def _store_gate(
    camera: FlashCamera,
    photons: Photons,
    rng: np.random.Generator,
    *,
    with_taps: bool = False,
    threads: int | None = 1,
) -> tuple[Waveforms, Taps | None]:
    """Simulate the samples of the gate that all pixels store, averaged over its pulses; nothing triggers."""
    assert camera.gate is not None
    gate, readout, pixels = camera.gate, camera.readout, camera.front.pixels
    n_pixels = photons.shape[0] * photons.shape[1]
    plan = camera.plan(0.0)
    n_samples = gate.n_samples(readout.sample_s)
    rows, sample = place_gate_rows(gate, readout, plan, n_pixels)
    axis = camera.axis(rows.length)
    first = np.full(n_pixels, plan.before)
    total = np.zeros((n_pixels, n_samples), np.float32)
    clipped = np.zeros((n_pixels, n_samples), bool)
    n_steps = n_samples * plan.steps_per_sample if with_taps else 0
    primaries, analog = (np.zeros((n_pixels, n_steps), np.float32) for _ in range(2))
    for light in photons.split_pulses(gate.pulses):
        signals = simulate_analog(camera.front, axis, light, rows, rng, threads)
        amplitude = signals.amplitude
        primaries += cut_steps(signals.primaries, rows.pixel, first, n_steps)
        analog += cut_steps(amplitude, rows.pixel, first, n_steps)
        counts = store_samples(
            readout, amplitude, rows.pixel, first, plan.steps_per_sample, n_samples, pixels.offset_counts
        )
        if readout.low_gain is None:
            clipped |= counts >= readout.full_scale_counts
        else:
            clipped |= merge_low_gain(
                readout,
                amplitude,
                rows,
                rows.pixel,
                first,
                plan.steps_per_sample,
                pixels.offset_counts,
                counts,
                rng,
            )
        total += counts
    alive = np.flatnonzero(~pixels.dead)
    base = camera.front.base_rate_per_s(photons)[alive]
    waveforms = Waveforms(
        shape=photons.shape,
        sample_s=readout.sample_s,
        baseline_counts=readout.baseline_counts,
        pixel=alive,
        start_s=np.full(len(alive), sample * readout.sample_s),
        latch_s=np.full(len(alive), np.nan),
        samples_counts=total[alive] / np.float32(gate.pulses),
        clipped=clipped[alive],
        base_per_s=base,
    )
    if not with_taps:
        return waveforms, None
    pulses = np.float32(gate.pulses)
    taps = tap_stages(
        photons.shape,
        plan.step_s,
        pixel=alive,
        start_s=waveforms.start_s,
        threshold=np.full(len(alive), np.nan, np.float32),
        primaries=primaries[alive] / pulses + (base[:, None] * plan.step_s).astype(np.float32),
        amplitude=analog[alive] / pulses,
    )
    return waveforms, taps
