"""Waveforms of a bench: noise before a return, the return, and what follows it, stored whole as under a range gate."""

from __future__ import annotations

import math

import numpy as np

from rso_lidar import units
from rso_lidar.detector.bench.prediction import find_saturation_photons
from rso_lidar.detector.bench.trial import make_plate
from rso_lidar.detector.detection import AnyDetector, detect, isolate
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.detector.settings.gate import Gate
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.errors import ScenarioError
from rso_lidar.records import Waveforms

_LEAST_PLATE_M = 300.0  # range of the plate; it is farther out where the dark samples before its light need more time
_LEVELS = 32  # of light below, and above saturation
_FAINTEST = 30.0  # peak over noise of the faintest return
_LINEAR = 0.8  # of saturation: brightest return that is measured as one that does not clip
_STRONGEST = 30.0  # times saturation
_BEFORE, _BEHIND = 3.0, 12.0  # pulses and poles before the plate, and behind it, that are stored
_SEED = 29  # random seed of the noise


def simulate_long_traces(
    detector: AnyDetector, pulse: LaserPulse, traces: int, dark_samples: int = 128
) -> tuple[Waveforms, int]:
    """Simulate waveforms of returns from a facing plate, half of them below saturation and half above.

    Amplifier and converter are those of the detector; a gate lets all pixels store more samples than a trigger would.

    Parameters
    ----------
    detector : of type `gsfl`
    pulse : the laser's pulse
    traces : number of waveforms
    dark_samples : samples before the light of the plate

    Returns
    -------
    waveforms, and how many samples at their start have no light of the plate.

    Raises
    ------
    ScenarioError
        If the detector has no waveforms.
    """
    if not isinstance(detector, Gsfl):
        raise ScenarioError("detector: has no waveforms of an amplifier; give a camera with one of type 'gsfl'")
    sample_ns = detector.readout.sample_ns
    length_ns = pulse.fwhm_s / units.NS + detector.amplifier.pole_s / units.NS
    before_ns = dark_samples * sample_ns + _BEFORE * length_ns
    plate_m = max(_LEAST_PLATE_M, before_ns * units.NS * units.RANGE_PER_DELAY_M_S)  # a gate opens after the flash
    gate = Gate(delay_ns=max(plate_m / units.RANGE_PER_DELAY_M_S / units.NS - before_ns, 0.0),
                width_ns=before_ns + (_BEFORE + _BEHIND) * length_ns + sample_ns)  # fmt: skip
    stored = detector.replace(gate=gate, zero_crossing=None, returns="first", max_returns=1, maps=None, defects=None)
    full = find_saturation_photons(stored, pulse)
    faintest = min(_FAINTEST * stored.noise_electrons / stored.clip_electrons, 0.5 * _LINEAR) * full
    levels = np.concatenate(
        [np.geomspace(faintest, _LINEAR * full, _LEVELS), np.geomspace(1.5 * full, _STRONGEST * full, _LEVELS)]
    )
    n = max(math.ceil(traces / len(levels)), 1) * len(levels)
    light = make_plate(np.resize(levels, n), n, (pulse.step_s, pulse.power_per_s), pulse.fwhm_s, plate_m)
    _, waveforms = detect(light, isolate(stored), np.random.Generator(np.random.Philox(_SEED)))
    assert waveforms is not None  # of a gate all pixels store samples
    return waveforms, dark_samples
