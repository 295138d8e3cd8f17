"""The whole chain of a detector: what it stores of a flash, and what it says of that."""

from __future__ import annotations

import numpy as np

from rso_lidar.detector.chain.measurement import measure
from rso_lidar.detector.chain.range_gate import store_gate
from rso_lidar.detector.chain.timing import shape_pulse
from rso_lidar.detector.chain.traces import store_traces
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.records import Photons, Reading, Taps, Waveforms


def store_waveforms(gsfl: Gsfl, photons: Photons, rng: np.random.Generator, threads: int | None = 1) -> Waveforms:
    """Simulate what the pixels store of one flash.

    Parameters
    ----------
    gsfl : the detector.
    photons : light on every pixel.
    rng : random generator.
    threads : number of threads (None: one for each core). The result is the same to the bit.
    """
    return _store(gsfl, photons, rng, threads=threads)[0]


def run_chain(
    gsfl: Gsfl, photons: Photons, rng: np.random.Generator, *, with_taps: bool = False, threads: int | None = 1
) -> tuple[Reading, Waveforms, Taps | None]:
    """Simulate what the sensor says of one flash, and the samples it says so from.

    Parameters
    ----------
    gsfl : the detector.
    photons : light on every pixel.
    rng : random generator.
    with_taps : also return the signals between the stages.
    threads : number of threads (None: one for each core). The result is the same to the bit.
    """
    waveforms, taps = _store(gsfl, photons, rng, with_taps=with_taps, threads=threads)
    return measure(gsfl, waveforms, shape_pulse(gsfl, photons), rng, threads), waveforms, taps


def _store(
    gsfl: Gsfl, photons: Photons, rng: np.random.Generator, *, with_taps: bool = False, threads: int | None = 1
) -> tuple[Waveforms, Taps | None]:
    store = store_gate if gsfl.gate else store_traces
    return store(gsfl, photons, rng, with_taps=with_taps, threads=threads)
