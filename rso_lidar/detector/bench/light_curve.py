"""What a detector reports of returns over their light: detection, range and intensity, by trials of separate pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.confidence_intervals import wilson_interval
from rso_lidar.detector.bench.prediction import find_photons
from rso_lidar.detector.bench.trial import Surroundings, Trial, make_plate, run_trial
from rso_lidar.detector.detection import AnyDetector, list_neglected_effects, predict_closed_form
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.detector.settings.traits import DetectorTraits
from rso_lidar.errors import ScenarioError

CONFIDENCE = 0.95  # of all intervals
_SEED = 38  # random seed of the trials
_MOST_SAMPLES = 40_000_000  # that the trials of all levels together may take
_FEWEST_TRIALS, _FEWEST_REPORTS = 50, 20
_MARGIN_M = 20.0  # from the start of the armed window to the plate: few false alarms come before it
_PULSES_BEFORE = 3.0  # of this many pulse lengths, where that is longer
_QUARTILES = 1.166  # standard error of a scatter by quartiles, times √n over the scatter
# Levels of a search by trials: first over three decades about the threshold, then where the probability rises.
_COARSE, _FINE = 49, 33
_FIRST_FROM, _FIRST_TO = 1.0 / 30.0, 30.0
_CERTAIN = 0.999
# Levels of the closed form between which the ends of intervals are interpolated, and their span over the photons found.
_LADDER, _BELOW, _ABOVE = 65, 0.4, 1.8


@dataclass(frozen=True, eq=False)
class LightCurve:
    """Reports of a return against its light; arrays (level), NaN where nothing is known.

    Parameters
    ----------
    trials : number of trials of each level
    photons : expected photons on the pixel, ascending
    detected_fraction : share of the trials that report the return
    detected_low, detected_high : its interval of 95 % confidence (Wilson)
    closed_form_probability : of detection, without false alarms
    range_sigma_m : scatter of a single range by the quartiles [m], 1 sigma
    range_sigma_error_m : standard error of the scatter [m]
    closed_form_sigma_m : scatter in closed form [m]
    range_bias_m, range_bias_error_m : mean error of range, and its standard error [m]
    snr : signal over noise in closed form, as amplitudes
    intensity_counts, intensity_sigma_counts : mean and standard deviation of the reported counts
    """

    trials: int
    photons: np.ndarray
    detected_fraction: np.ndarray
    detected_low: np.ndarray
    detected_high: np.ndarray
    closed_form_probability: np.ndarray
    range_sigma_m: np.ndarray
    range_sigma_error_m: np.ndarray
    closed_form_sigma_m: np.ndarray
    range_bias_m: np.ndarray
    range_bias_error_m: np.ndarray
    snr: np.ndarray
    intensity_counts: np.ndarray
    intensity_sigma_counts: np.ndarray


@dataclass(frozen=True, eq=False)
class DetectionPhotons:
    """Photons of a return that is detected with given probabilities; arrays (case).

    Parameters
    ----------
    probability : of detection, if no false alarm comes before
    photons : infinite where no light is detected so often
    low, high : interval of 95 % confidence of the photons, by trials
    how : how the photons were found
    """

    probability: np.ndarray
    photons: np.ndarray
    low: np.ndarray
    high: np.ndarray
    how: str


def simulate_light_curve(
    detector: AnyDetector, pulse: LaserPulse, photons: np.ndarray, trials: int = 4000
) -> LightCurve:
    """Simulate what a detector reports of returns over their light, the same draws each time.

    Each trial is a pixel of a separate flash that a facing plate fills, near the start of the armed window or in the middle
    of a gate. Ranges are spread over a metre. Effects of other pixels are off, the laser's timing jitter is on.

    Parameters
    ----------
    detector : a part, or an object that follows the protocol `Detector`
    pulse : the laser's pulse
    photons : (level) expected photons on the pixel
    trials : of each level; fewer for detectors that store much or average many pulses

    Returns
    -------
    LightCurve
        Of the levels in ascending order.

    Raises
    ------
    ScenarioError
        If photons are not positive, finite numbers, or there are fewer than 50 trials.
    """
    photons = np.sort(np.asarray(photons, dtype=float).ravel())
    if not len(photons) or not np.all(np.isfinite(photons) & (photons > 0.0)):
        raise ScenarioError("photons: a light curve needs at least one positive, finite number; correct them")
    n = _limit_trials(detector.traits, len(photons), trials)
    trial = _try_levels(detector, pulse, photons, n)
    hits = trial.detected.reshape(len(photons), n).sum(axis=1)
    columns = {name: np.full(len(photons), np.nan) for name in _BY_REPORTS}
    for level, (first, last) in enumerate(zip(np.cumsum(hits) - hits, np.cumsum(hits), strict=True)):
        reports = slice(int(first), int(last))
        if last - first >= _FEWEST_REPORTS:
            seen = Trial(trial.detected[:0], trial.range_error_m[reports], trial.intensity_counts[reports])
            columns["range_sigma_m"][level], columns["range_bias_m"][level] = seen.range_noise_m, seen.range_bias_m
            root = math.sqrt(last - first)
            columns["range_sigma_error_m"][level] = _QUARTILES * seen.range_noise_m / root
            columns["range_bias_error_m"][level] = float(seen.range_error_m.std()) / root
            columns["intensity_counts"][level] = float(seen.intensity_counts.mean())
            columns["intensity_sigma_counts"][level] = float(seen.intensity_counts.std())
    intervals = np.array([wilson_interval(share, n, CONFIDENCE) for share in hits / n])
    closed = _try_closed_form(detector, pulse, photons)
    return LightCurve(
        trials=n,
        photons=photons,
        detected_fraction=hits / n,
        detected_low=intervals[:, 0],
        detected_high=intervals[:, 1],
        **closed,
        **columns,
    )


_BY_REPORTS = (
    "range_sigma_m",
    "range_sigma_error_m",
    "range_bias_m",
    "range_bias_error_m",
    "intensity_counts",
    "intensity_sigma_counts",
)


def _try_closed_form(detector: AnyDetector, pulse: LaserPulse, photons: np.ndarray) -> dict[str, np.ndarray]:
    """Return the columns of a light curve that have a closed form, NaN for a detector or a pulse without one."""
    try:
        known = predict_closed_form(detector, pulse, photons, np.zeros(len(photons)))
    except ScenarioError:  # such as an amplifier that is too fast for the closed form of the pulse
        known = None
    unknown = np.full(len(photons), np.nan)
    if known is None:
        return dict.fromkeys(("closed_form_probability", "closed_form_sigma_m", "snr"), unknown)
    return {
        "closed_form_probability": known.probability,
        "closed_form_sigma_m": known.range_precision_m,
        "snr": known.snr,
    }


def estimate_detection_photons(
    detector: AnyDetector, pulse: LaserPulse, probability: np.ndarray, trials: int = 4000
) -> DetectionPhotons:
    """Estimate the photons of a return from a facing surface that is detected with given probabilities, in the dark.

    They are those of the closed form, where it counts all settings. Trials of that light then give their uncertainty:
    photons whose probability, corrected by the interval of the trials, is the wanted one. Otherwise trials over light give
    the photons, made monotone and interpolated.

    Parameters
    ----------
    detector : a part, or an object that follows the protocol `Detector`
    pulse : the laser's pulse
    probability : (case) probabilities of detection, above 0 and below 1
    trials : of each level of light; fewer for detectors that store much or average many pulses

    Returns
    -------
    DetectionPhotons
        Of each probability.

    Raises
    ------
    ScenarioError
        If a probability is not between 0 and 1, or there are fewer than 50 trials.
    """
    wanted = np.atleast_1d(np.asarray(probability, dtype=float))
    if not np.all((wanted > 0.0) & (wanted < 1.0)):
        raise ScenarioError("probability: is never or always reached; give numbers between 0 and 1")
    known = None if list_neglected_effects(detector) else find_photons(detector, pulse, wanted)
    if known is None:
        return _search_by_trials(detector, pulse, wanted, trials)
    reached = np.isfinite(known)
    low, high = known.copy(), known.copy()
    n = _limit_trials(detector.traits, max(int(reached.sum()), 1), trials)
    if reached.any():
        trial = _try_levels(detector, pulse, known[reached], n)
        shares = trial.detected.reshape(-1, n).mean(axis=1)
        bounds = np.array([wilson_interval(share, n, CONFIDENCE) for share in shares])
        corrected = np.clip(2.0 * wanted[reached] - bounds.T[::-1], 1e-4, 1.0 - 1e-6)
        ladder = np.geomspace(_BELOW * known[reached].min(), _ABOVE * known[reached].max(), _LADDER)
        seen = predict_closed_form(detector, pulse, ladder, np.zeros(_LADDER), only_probability=True)
        assert seen is not None, "a closed form of some light is one of all"
        low[reached], high[reached] = _cross(ladder, np.maximum.accumulate(seen.probability), corrected)
    return DetectionPhotons(wanted, known, low, high, f"closed form, {n:,} trials")


def _search_by_trials(detector: AnyDetector, pulse: LaserPulse, wanted: np.ndarray, trials: int) -> DetectionPhotons:
    """Find the photons of wanted probabilities (case) by trials alone."""
    from scipy.optimize import isotonic_regression

    start = detector.traits.threshold_photons
    start = start if 0.0 < start < math.inf else 1.0
    photons = np.geomspace(_FIRST_FROM * start, _FIRST_TO * start, _COARSE)
    few = _limit_trials(detector.traits, _COARSE, max(trials // 10, _FEWEST_TRIALS))
    share = _try_levels(detector, pulse, photons, few).detected.reshape(_COARSE, few).mean(axis=1)
    least = max(int(np.argmax(share > 0.5 * wanted.min())) - 1, 0)
    most = min(int(np.argmax(share >= min(_CERTAIN, share.max()))) + 1, _COARSE - 1)
    photons = np.geomspace(photons[least], photons[max(most, least + 1)], _FINE)
    n = _limit_trials(detector.traits, _FINE, trials)
    share = _try_levels(detector, pulse, photons, n).detected.reshape(_FINE, n).mean(axis=1)
    rising = isotonic_regression(share).x  # light does not make a return less likely
    bounds = np.array([wilson_interval(value, n, CONFIDENCE) for value in rising])
    value, low, high = (_cross(photons, curve, wanted) for curve in (rising, bounds[:, 1], bounds[:, 0]))
    return DetectionPhotons(wanted, value, low, high, f"{_FINE} x {n:,} trials")


def _cross(photons: np.ndarray, rising: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return where a rising probability (level) reaches wanted ones (case) [photons]; infinite where never."""
    first = np.searchsorted(rising, wanted)  # the first level that reaches each
    inside = np.clip(first, 1, len(photons) - 1)
    low, high = rising[inside - 1], rising[inside]
    share = np.clip((wanted - low) / np.maximum(high - low, 1e-12), 0.0, 1.0)
    between = photons[inside - 1] * (photons[inside] / photons[inside - 1]) ** share
    reached: np.ndarray = np.where(first == 0, photons[0], np.where(first == len(photons), np.inf, between))
    return reached


def place_plate_m(traits: DetectorTraits, pulse: LaserPulse) -> float:
    """Return the least range of a plate of a trial [m]: near the start of an armed window, in the middle of a gate.

    Parameters
    ----------
    traits : of the detector, which state when it looks
    pulse : the laser's pulse, whose begin must not fall before the window
    """
    middle_m = 0.5 * (traits.sees_from_m + min(traits.sees_to_m, 1e6)) - 0.5
    if traits.is_gated:
        return middle_m
    before_m = max(_MARGIN_M, _PULSES_BEFORE * pulse.fwhm_s * units.RANGE_PER_DELAY_M_S)
    return min(traits.sees_from_m + before_m, middle_m)


def _limit_trials(traits: DetectorTraits, levels: int, trials: int) -> int:
    """Return how many trials of each level are affordable."""
    if trials < _FEWEST_TRIALS:
        raise ScenarioError(f"trials: {trials} leave no interval that means anything; give at least {_FEWEST_TRIALS}")
    return max(min(trials, _MOST_SAMPLES // (traits.samples * traits.pulses * levels)), _FEWEST_TRIALS)


def _try_levels(detector: AnyDetector, pulse: LaserPulse, photons: np.ndarray, n: int) -> Trial:
    """Try levels of light (level) with n pixels each; the pixels of a level stand in a row."""
    taps, range_m = (pulse.step_s, pulse.power_per_s), place_plate_m(detector.traits, pulse)
    light = make_plate(np.repeat(photons, n), n * len(photons), taps, pulse.fwhm_s, range_m)
    around = Surroundings(timing_jitter_s=pulse.timing_jitter_ns * units.NS)
    return run_trial(detector, light, np.random.Generator(np.random.Philox(_SEED)), around=around)
