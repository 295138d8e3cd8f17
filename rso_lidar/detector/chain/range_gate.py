"""Pixels under a range gate: all store the same stretch of time."""

from __future__ import annotations

import numpy as np

from rso_lidar.detector.chain.analog import base_rate_per_s, simulate_analog
from rso_lidar.detector.chain.camera import build_camera
from rso_lidar.detector.chain.taps import cut_steps, tap_stages
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.stages.nonuniformity import CameraPixels
from rso_lidar.detector.stages.sampling import merge_low_gain, store_samples
from rso_lidar.detector.stages.time_axis import place_gate_rows
from rso_lidar.records import Photons, Taps, Waveforms


def store_gate(
    gsfl: Gsfl,
    photons: Photons,
    rng: np.random.Generator,
    *,
    with_taps: bool = False,
    threads: int | None = 1,
    camera: CameraPixels | None = None,
) -> tuple[Waveforms, Taps | None]:
    """Simulate the samples of the gate that all pixels store, averaged over its pulses; nothing triggers.

    Parameters
    ----------
    gsfl : the detector, with a gate.
    photons : light on every pixel.
    rng : random generator.
    with_taps : also return the signals between the stages.
    threads : number of threads (None: one for each core). The result is the same to the bit.
    camera : the pixels that look (None: those of the detector's camera).

    Returns
    -------
    the stored samples, and the signals between the stages (None unless requested).
    """
    assert gsfl.gate is not None
    n_pixels = photons.shape[0] * photons.shape[1]
    camera = camera or build_camera(gsfl, n_pixels)
    plan = plan_time(gsfl, photons.pulse_fwhm_s)
    n_samples = gsfl.gate.n_samples(gsfl.readout.sample_s)
    rows, sample = place_gate_rows(gsfl.gate, gsfl.readout, plan, n_pixels)
    first = np.full(n_pixels, plan.before)
    total = np.zeros((n_pixels, n_samples), np.float32)
    clipped = np.zeros((n_pixels, n_samples), bool)
    n_steps = n_samples * plan.steps_per_sample if with_taps else 0
    primaries, analog = (np.zeros((n_pixels, n_steps), np.float32) for _ in range(2))
    for light in photons.split_pulses(gsfl.gate.pulses):
        made = simulate_analog(gsfl, light, rows, plan, camera, rng, threads)
        amplitude = made.amplitude
        primaries += cut_steps(made.primaries, rows.pixel, first, n_steps)
        analog += cut_steps(amplitude, rows.pixel, first, n_steps)
        counts = store_samples(
            gsfl.readout, amplitude, rows.pixel, first, plan.steps_per_sample, n_samples, camera.offset_counts
        )
        if gsfl.readout.low_gain is None:
            clipped |= counts >= gsfl.readout.full_scale_counts
        else:
            clipped |= merge_low_gain(
                gsfl.readout,
                amplitude,
                rows,
                rows.pixel,
                first,
                plan.steps_per_sample,
                camera.offset_counts,
                counts,
                rng,
            )
        total += counts
    alive = np.flatnonzero(~camera.dead)
    base = base_rate_per_s(gsfl.quantum_efficiency, camera, photons)[alive]
    waveforms = Waveforms(
        shape=photons.shape,
        sample_s=gsfl.readout.sample_s,
        baseline_counts=gsfl.readout.baseline_counts,
        pixel=alive,
        start_s=np.full(len(alive), sample * gsfl.readout.sample_s),
        latch_s=np.full(len(alive), np.nan),
        samples_counts=total[alive] / np.float32(gsfl.gate.pulses),
        clipped=clipped[alive],
        base_per_s=base,
    )
    if not with_taps:
        return waveforms, None
    pulses = np.float32(gsfl.gate.pulses)
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
