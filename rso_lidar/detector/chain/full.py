"""The whole chain of a detector: what it stores of a flash, and what it says of that."""

from __future__ import annotations

import numpy as np

from rso_lidar.detector.chain.gated import store_gate
from rso_lidar.detector.chain.measure import measure
from rso_lidar.detector.chain.timing import shape_pulse
from rso_lidar.detector.chain.traces import store_traces
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.records import Photons, Reading, Waveforms


def store_waveforms(gsfl: Gsfl, photons: Photons, rng: np.random.Generator) -> Waveforms:
    """Simulate what the pixels store of one flash.

    Parameters
    ----------
    gsfl : the detector.
    photons : light on every pixel.
    rng : random generator.
    """
    return store_gate(gsfl, photons, rng) if gsfl.gate else store_traces(gsfl, photons, rng)


def run_chain(gsfl: Gsfl, photons: Photons, rng: np.random.Generator) -> tuple[Reading, Waveforms]:
    """Simulate what the sensor says of one flash, and the samples it says so from.

    Parameters
    ----------
    gsfl : the detector.
    photons : light on every pixel.
    rng : random generator.
    """
    waveforms = store_waveforms(gsfl, photons, rng)
    return measure(gsfl, waveforms, shape_pulse(gsfl, photons), rng), waveforms
