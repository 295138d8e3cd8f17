"""The whole chain of a detector: the samples that it stores of a flash, and its reading of them."""

from __future__ import annotations

import numpy as np

from rso_lidar.detector.chain.camera import FlashCamera
from rso_lidar.detector.chain.charge_spill import spill_charge
from rso_lidar.detector.chain.measurement import measure
from rso_lidar.detector.chain.range_gate import store_gate
from rso_lidar.detector.chain.traces import store_traces
from rso_lidar.records import Photons, Reading, Taps, Waveforms


def run_chain(
    camera: FlashCamera,
    photons: Photons,
    rng: np.random.Generator,
    *,
    with_taps: bool = False,
    threads: int | None = 1,
) -> tuple[Reading, Waveforms, Taps | None]:
    """Return the reading of one flash, the stored samples, and the signals between the stages (None unless requested).

    Parameters
    ----------
    threads : number of threads (None: one for each core). The result is the same to the bit
    """
    waveforms, taps = store_waveforms(camera, photons, rng, with_taps=with_taps, threads=threads)
    return measure(camera.processor, waveforms, rng, threads), waveforms, taps


def store_waveforms(
    camera: FlashCamera, photons: Photons, rng: np.random.Generator, *, with_taps: bool = False, threads: int | None = 1
) -> tuple[Waveforms, Taps | None]:
    """Return the samples that the pixels store of one flash, and the signals between the stages (None unless requested).

    Parameters
    ----------
    threads : as for `run_chain`
    """
    if camera.bloom is not None:
        photons = spill_charge(camera.bloom, photons, camera.electrons_per_photon)
    store = store_gate if camera.gate else store_traces
    return store(camera, photons, rng, with_taps=with_taps, threads=threads)
