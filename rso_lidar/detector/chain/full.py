"""The whole chain of a detector: the samples that it stores of a flash, and its reading of them."""

from __future__ import annotations

import numpy as np

from rso_lidar.detector.chain.charge_spill import spill_charge
from rso_lidar.detector.chain.measurement import measure
from rso_lidar.detector.chain.range_gate import store_gate
from rso_lidar.detector.chain.timing import shape_pulse
from rso_lidar.detector.chain.traces import store_traces
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.stages.nonuniformity import CameraPixels
from rso_lidar.records import Photons, Reading, Taps, Waveforms


def store_waveforms(gsfl: Gsfl, photons: Photons, rng: np.random.Generator, threads: int | None = 1) -> Waveforms:
    """Return the samples that the pixels store of one flash, by simulation.

    Parameters
    ----------
    gsfl : the detector.
    photons : light on every pixel.
    rng : random generator.
    threads : number of threads (None: one for each core). The result is the same to the bit.
    """
    return _store(gsfl, photons, rng, threads=threads)[0]


def run_chain(
    gsfl: Gsfl,
    photons: Photons,
    rng: np.random.Generator,
    *,
    with_taps: bool = False,
    threads: int | None = 1,
    camera: CameraPixels | None = None,
) -> tuple[Reading, Waveforms, Taps | None]:
    """Return the reading of one flash, the stored samples, and the signals between the stages (None unless requested).

    Parameters
    ----------
    gsfl : the detector.
    photons : light on every pixel.
    rng : random generator.
    with_taps : also return the signals between the stages.
    threads : number of threads (None: one for each core). The result is the same to the bit.
    camera : the pixels that look (None: those of the detector's camera).
    """
    waveforms, taps = _store(gsfl, photons, rng, with_taps=with_taps, threads=threads, camera=camera)
    return measure(gsfl, waveforms, shape_pulse(gsfl, photons), rng, threads, camera), waveforms, taps


def _store(
    gsfl: Gsfl,
    photons: Photons,
    rng: np.random.Generator,
    *,
    with_taps: bool = False,
    threads: int | None = 1,
    camera: CameraPixels | None = None,
) -> tuple[Waveforms, Taps | None]:
    """Return the stored samples, and the signals between the stages (None unless requested).

    Parameters
    ----------
    gsfl, photons, rng, with_taps, threads, camera : as for `run_chain`.
    """
    if gsfl.bloom is not None:
        photons = spill_charge(gsfl.bloom, photons, gsfl.electrons_per_photon)
    store = store_gate if gsfl.gate else store_traces
    return store(gsfl, photons, rng, with_taps=with_taps, threads=threads, camera=camera)
