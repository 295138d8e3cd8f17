"""Effects of noise on the shipped detectors, from their settings: false alarms, noise in sunlight, crosstalk."""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.detector.analysis.false_alarms import false_trigger_fraction
from rso_lidar.detector.settings.empirical import Empirical
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.settings.noise import noise_rms
from rso_lidar.detector.stages.array_effects import draw_shift_m

_GROWTH_STEP = 0.113_328_685_307_003_3  # log 1.12 of noise in sunlight over that in the dark, between levels
_NO_GROWTH = 0.019_802_627_296_179_73  # log 1.02: less sunlight counts as none


def false_alarms_of_gsfl(gsfl: Gsfl, range_m: np.ndarray) -> np.ndarray:
    """Return the probability (range) of a false alarm of the full chain before light from there comes."""
    if gsfl.gate is not None:
        return np.full(np.shape(range_m), gsfl.gate.false_alarm_probability)
    return false_trigger_fraction(gsfl, _find_armed_s(gsfl, range_m))


def false_alarms_of_empirical(empirical: Empirical, range_m: np.ndarray) -> np.ndarray:
    """Return the probability (range) of a false alarm of the empirical detector before light from there comes."""
    before: np.ndarray = -np.expm1(-empirical.false_alarms_per_s * _find_armed_s(empirical, range_m))
    return before


def _find_armed_s(detector: Gsfl | Empirical, range_m: np.ndarray) -> np.ndarray:
    """Return how long a pixel has been armed before light from ranges [m] arrives [s]."""
    armed_m = np.clip(range_m, detector.armed_from_m, detector.armed_to_m) - detector.armed_from_m
    armed_s: np.ndarray = armed_m / units.RANGE_PER_DELAY_M_S
    return armed_s


def noise_growth_gsfl(gsfl: Gsfl, background_photons_per_s: float) -> float:
    """Return the rms noise of the full chain under sunlight [photons/s] over that in the dark."""
    dark = gsfl.noise_electrons
    return gsfl.noise_in_light(background_photons_per_s) / dark if dark > 0.0 else float("inf")


def split_sunlight(gsfl: Gsfl, background_photons_per_s: np.ndarray) -> list[tuple[float, np.ndarray]]:
    """Split sunlight between levels of the noise that it makes, a factor of 1.12 apart, for linear interpolation.

    Parameters
    ----------
    gsfl : the detector.
    background_photons_per_s : (pixel) sunlight [photons/s].

    Returns
    -------
    levels of sunlight [photons/s], each with the weights (pixel) of what is computed at it. They sum to 1 in each pixel.
    """
    amplifier, apd = gsfl.amplifier, gsfl.apd
    dark_variance = gsfl.noise_electrons**2
    shot = float(noise_rms(apd, gsfl.quantum_efficiency, 0.0, amplifier.pole_s, amplifier.integration_s)) ** 2
    if dark_variance == 0.0:  # no noise that could grow: sunlight is a few steps of its own
        dark_variance = shot * max(float(background_photons_per_s.max(initial=0.0)), 1.0) * 1e-3
    growth = 0.5 * np.log1p(background_photons_per_s * (shot / dark_variance))
    place = np.where(growth < _NO_GROWTH, 0.0, growth / _GROWTH_STEP)
    split = []
    for k in np.unique([np.floor(place), np.ceil(place)]):
        weight = np.maximum(1.0 - np.abs(place - k), 0.0)
        split.append((float(np.expm1(2.0 * k * _GROWTH_STEP) * dark_variance / shot), weight))
    return split


def draw_crosstalk_gsfl_m(gsfl: Gsfl, together_fraction: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw the range errors of the full chain's pixels from others that latch with them.

    Parameters
    ----------
    gsfl : the detector.
    together_fraction : (pixel) share of the array that latches with each.
    rng : generator of the errors.

    Returns
    -------
    (pixel) errors [m]; zero without crosstalk, or behind a gate.
    """
    if gsfl.crosstalk is None or gsfl.gate is not None:
        return np.zeros(np.shape(together_fraction))
    return draw_shift_m(gsfl.crosstalk, together_fraction, rng)
