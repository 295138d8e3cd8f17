"""Predictions of a detector's reports: in closed form where it has one, else by trials."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from rso_lidar import units
from rso_lidar.detector.analysis.closed_form import Prediction
from rso_lidar.detector.bench.trial import make_plate, run_trial
from rso_lidar.detector.detection import AnyDetector, predict_closed_form
from rso_lidar.detector.ranging.pulse import LaserPulse, Pulse
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.errors import ScenarioError

_TRIALS, _FEWEST = 200, 20  # pixels for each return: the standard error of a probability is at most 0.035
_MOST_SAMPLES = 8_000_000  # that all trials together may take
_FARTHEST_M = 1e6
_SEED = 17  # random seed of the trials
_FARTHEST_LIGHT = 1e3  # times the threshold, and its inverse: between them the light of a given probability is sought
_SECTIONS, _ROUNDS = 7, 4  # of this interval in logarithm, whose ends are then a factor 1.006 apart


def predict(
    detector: AnyDetector,
    pulse: LaserPulse,
    photons: np.ndarray,
    depth_s: np.ndarray,
    *,
    only_probability: bool = False,
) -> Prediction:
    """Predict what a detector reports of returns.

    Parameters
    ----------
    detector : a part, or an object that follows the protocol `Detector`
    pulse : the laser's pulse
    photons, depth_s : (return) expected photons, and the time over which a surface stretches them [s]
    only_probability : whether the other members of the prediction are not needed, which is faster for some detectors

    Returns
    -------
    probability, precision, signal over noise and saturation of each return.
    """
    known = predict_closed_form(detector, pulse, photons, depth_s, only_probability=only_probability)
    return _predict_by_trial(detector, pulse, photons, depth_s) if known is None else known


def find_photons(detector: AnyDetector, pulse: LaserPulse, probability: np.ndarray) -> np.ndarray | None:
    """Find the photons of a return from a facing surface that is detected with given probabilities, in the dark.

    Parameters
    ----------
    detector : a part, or an object that follows the protocol `Detector`
    pulse : the laser's pulse
    probability : (case) probabilities of detection, if no false alarm comes before

    Returns
    -------
    photons (case), infinite where no light is detected so often; None for a detector without a closed form for this
    pulse.
    """
    wanted = np.atleast_1d(np.asarray(probability, dtype=float))
    if not isinstance(detector, Gsfl):
        return _find_photons(detector, pulse, wanted)
    photons = _find_photons_gsfl(detector, pulse, tuple(wanted.tolist()))
    return None if photons is None else photons.copy()


@lru_cache(maxsize=64)
def _find_photons_gsfl(gsfl: Gsfl, pulse: LaserPulse, probability: tuple[float, ...]) -> np.ndarray | None:
    """Find the photons once for each camera, since the orthants of the closed form take half a second."""
    return _find_photons(gsfl, pulse, np.array(probability))


def _find_photons(detector: AnyDetector, pulse: LaserPulse, wanted: np.ndarray) -> np.ndarray | None:
    """Find the photons as `find_photons` does, by sections of an interval."""
    start = detector.traits.threshold_photons
    start = start if 0.0 < start < math.inf else 1.0
    low, high = np.full(len(wanted), start / _FARTHEST_LIGHT), np.full(len(wanted), start * _FARTHEST_LIGHT)
    case = np.arange(len(wanted))
    for _ in range(_ROUNDS):
        light = np.geomspace(low, high, _SECTIONS + 1, axis=1)
        try:
            known = predict_closed_form(detector, pulse, light.ravel(), np.zeros(light.size), only_probability=True)
        except ScenarioError:  # such as an amplifier that is too fast for the closed form of the pulse
            known = None
        if known is None:
            return None
        reached = known.probability.reshape(light.shape)
        above = np.clip((reached < wanted[:, None]).sum(axis=1), 1, _SECTIONS)
        low, high = light[case, above - 1], light[case, above]
        low_found, high_found = reached[case, above - 1], reached[case, above]
    share = (wanted - low_found) / np.maximum(high_found - low_found, np.finfo(float).tiny)
    photons: np.ndarray = np.where(share <= 1.0, low + np.clip(share, 0.0, 1.0) * (high - low), np.inf)
    return photons


def find_saturation_photons(detector: AnyDetector, pulse: LaserPulse) -> float:
    """Find the photons of a return from a facing surface whose intensity clips.

    Those of the full chain are without noise: the peak of the pulse behind the amplifier reaches the converter's full scale,
    or the amplifier's rail. Half of all flashes are saturated there, within 2 %, if samples meet the peak. They are 2.38 ns
    apart by default, so that a pulse of 2 ns is flagged on the rail from up to 10 % more.

    Parameters
    ----------
    detector : a part, or an object that follows the protocol `Detector`
    pulse : the laser's pulse

    Returns
    -------
    float
        Of detectors without an amplifier, `DetectorTraits.saturation_photons`; infinite where nothing clips.
    """
    if not isinstance(detector, Gsfl):
        return detector.traits.saturation_photons
    amplifier = detector.amplifier
    peak = Pulse.after(pulse.step_s, pulse.power_per_s, amplifier.pole_s, amplifier.integration_s).peak
    return detector.clip_electrons / (detector.electrons_per_photon * peak)


def _predict_by_trial(detector: AnyDetector, pulse: LaserPulse, photons: np.ndarray, depth_s: np.ndarray) -> Prediction:
    """Predict, as `predict` does, from pixels that each meet one return, in the middle of what the detector sees."""
    photons, depth_s = (np.asarray(values, dtype=float) for values in np.broadcast_arrays(photons, depth_s))
    traits, levels = detector.traits, photons.size
    n = max(min(_TRIALS, _MOST_SAMPLES // (traits.samples * traits.pulses * max(levels, 1))), _FEWEST)
    middle_m = 0.5 * (traits.sees_from_m + min(traits.sees_to_m, _FARTHEST_M))
    light = make_plate(np.repeat(photons, n), n * levels, (pulse.step_s, pulse.power_per_s), pulse.fwhm_s, middle_m)
    light = replace(light, depth_spread_s=np.repeat(depth_s.ravel(), n))
    trial = run_trial(detector, light, np.random.Generator(np.random.Philox(_SEED)))
    level = np.flatnonzero(trial.detected) // n
    precision_m, snr = np.full(levels, np.inf), np.zeros(levels)
    jitter_m = pulse.timing_jitter_ns / math.sqrt(traits.pulses) * units.NS * units.RANGE_PER_DELAY_M_S
    for k in np.unique(level):
        errors_m, counts = trial.range_error_m[level == k], trial.intensity_counts[level == k].astype(float)
        if len(errors_m) > 1:
            precision_m[k] = np.hypot(errors_m.std(), jitter_m)
            snr[k] = counts.mean() / max(counts.std(), 1e-9)
    shape = photons.shape
    return Prediction(
        trial.detected.reshape(levels, n).mean(axis=1).reshape(shape),
        precision_m.reshape(shape),
        snr.reshape(shape),
        photons >= traits.saturation_photons,
    )
