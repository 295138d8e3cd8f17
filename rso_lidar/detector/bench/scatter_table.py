"""Scatter of reported ranges by photons, depth and sunlight: a table that the chain fills once by trials."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from rso_lidar import units
from rso_lidar.detector.bench.prediction import find_saturation_photons
from rso_lidar.detector.bench.trial import make_plate, run_trial
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.records import Photons

_SEED = 91  # random seed of the trials

# Grid of the table: photons over those of the threshold, and depth in pulse lengths.
_LEVELS = np.array(
    [0.5, 0.65, 0.8, 0.95, 1.1, 1.3, 1.6, 2.0, 2.8, 4.0, 6.5, 12.0, 25.0, 60.0, 120.0, 180.0, 350.0, 1000.0, 3000.0]
)
_DEPTHS = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.5, 7.0])
_PLATE_M, _ARMED_M = 1000.0, 200.0  # range of the returns, and greatest length of the armed window around it
_TRIALS = 600  # of each level and depth: a standard error of 3 %, 1 / sqrt(2 n)
_FEWEST_TRIALS = 150  # where many pulses are averaged: 6 %
_GATE_UNIT = 0.4  # of the trigger's threshold: inside a gate, the algorithm needs no trigger to find the pulse
_FAINT_TRIALS = 4  # factor on the trials below the threshold, where few returns are detected
_FEWEST_REPORTS = 30  # from which a scatter is estimated: a standard error of 13 %
_CERTAIN = 1.5  # level above which nearly all returns are reported, so that detection does not bias the scatter
_OUTLIER = 5.0  # times the scatter by the quartiles: an error beyond is a false trigger close to the return


def read_scatter_m(
    gsfl: Gsfl, photons: Photons, sunlight_per_s: float, light: np.ndarray, depth_s: np.ndarray
) -> np.ndarray:
    """Interpolate the scatter of range (lit) [m] in the table of trials, linearly in the logarithms of scatter and photons.

    Parameters
    ----------
    sunlight_per_s : sunlight on the pixels [photons/s]
    light, depth_s : (lit) photons of each pixel, and depth of the light in delay [s]
    """
    armed_m = min(gsfl.armed_to_m - gsfl.armed_from_m, _ARMED_M)
    window = {"armed_from_m": _PLATE_M - 0.5 * armed_m, "armed_to_m": _PLATE_M + 0.5 * armed_m}
    gate = None if gsfl.gate is None else gsfl.gate.replace(delay_ns=1000.0)
    alone = gsfl.alone().replace(gate=gate, camera_seed=0, **window)
    pulse = LaserPulse.of(photons)
    at = np.clip(depth_s / photons.pulse_fwhm_s, _DEPTHS[0], _DEPTHS[-1])
    left = np.clip(np.searchsorted(_DEPTHS, at, side="right") - 1, 0, len(_DEPTHS) - 2)
    share = (at - _DEPTHS[left]) / (_DEPTHS[left + 1] - _DEPTHS[left])
    level = np.log(light / threshold_of_returns(gsfl))
    log_m = np.zeros(len(light))
    for column in np.unique(np.concatenate([left, left[share > 0.0] + 1])).tolist():
        weight = np.where(left == column, 1.0 - share, np.where(left + 1 == column, share, 0.0))
        of = np.flatnonzero(weight > 0.0)
        if len(of):
            scatter_m = _try_levels(alone, pulse, sunlight_per_s, float(_DEPTHS[column]))
            log_m[of] += weight[of] * np.interp(level[of], np.log(_LEVELS), np.log(scatter_m))
    sigma_m: np.ndarray = np.hypot(np.exp(log_m), gsfl.frame_jitter_s * units.RANGE_PER_DELAY_M_S)
    return sigma_m


def threshold_of_returns(gsfl: Gsfl) -> float:
    """Return the photons of a return that is detected in about half of all flashes: level 1 of the table."""
    return gsfl.traits.threshold_photons * (1.0 if gsfl.gate is None else _GATE_UNIT / math.sqrt(gsfl.gate.pulses))


@lru_cache(maxsize=512)
def _try_levels(gsfl: Gsfl, pulse: LaserPulse, sunlight_per_s: float, depth: float) -> np.ndarray:
    """Measure by trials the scatter of range (level) [m] of returns of one depth in separate pixels."""
    trials = np.where(_LEVELS < 1.0, _FAINT_TRIALS, 1) * max(_TRIALS // gsfl.traits.pulses, _FEWEST_TRIALS)
    number = np.repeat(np.arange(len(_LEVELS)), trials)
    n = len(number)
    middle_m = 0.5 * (gsfl.sees_from_m + gsfl.sees_to_m)
    bright, taps = _LEVELS[number] * threshold_of_returns(gsfl), (pulse.step_s, pulse.power_per_s)
    light = make_plate(bright, n, taps, pulse.fwhm_s, middle_m - 0.5)
    light = replace(light, depth_spread_s=np.full(n, depth * pulse.fwhm_s))
    if sunlight_per_s > 0.0:
        light = replace(light, background_photons_per_s=np.full((1, n), sunlight_per_s))
    trial = run_trial(gsfl, light, np.random.Generator(np.random.Philox(_SEED)))
    level = number[trial.detected]
    scatter_m, count = np.full(len(_LEVELS), np.nan), np.zeros(len(_LEVELS))
    for k in range(len(_LEVELS)):
        errors_m = trial.range_error_m[level == k]
        if len(errors_m) < _FEWEST_REPORTS:
            continue
        low, middle, high = np.quantile(errors_m, [0.25, 0.5, 0.75])
        within = np.abs(errors_m - middle) <= _OUTLIER * (high - low) / 1.349 + 1e-6
        scatter_m[k], count[k] = max(errors_m[within].std(), 1e-6), len(errors_m)
    is_linear = _LEVELS * threshold_of_returns(gsfl) < find_saturation_photons(gsfl, pulse)
    usual = (_LEVELS >= _CERTAIN) & is_linear & (count > 0)
    scatter_m[usual] = _smooth(scatter_m[usual], _LEVELS[usual], count[usual])
    known = np.flatnonzero(np.isfinite(scatter_m))
    if not len(known):  # light of this depth is never reported: assume a report from anywhere in it
        return np.full(len(_LEVELS), max(depth, 1.0) * pulse.fwhm_s * units.RANGE_PER_DELAY_M_S / math.sqrt(12.0))
    filled: np.ndarray = scatter_m[known[np.clip(np.searchsorted(known, np.arange(len(_LEVELS))), 0, len(known) - 1)]]
    return filled


def _smooth(scatter_m: np.ndarray, level: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Smooth scatter by a fit of jitter, shot noise and constant noise, σ² = a + b/n + c/n².

    Parameters
    ----------
    scatter_m : (level) [m]
    level : (level) photons n, in any unit
    count : (level) number of reports of each scatter

    Returns
    -------
    (level) the fit [m], or the given scatter if its chi-square per degree of freedom is above 2.
    """
    from scipy.optimize import nnls

    if len(level) < 5:
        return scatter_m
    error = scatter_m**2 * np.sqrt(2.0 / count)
    terms = np.stack([np.ones(len(level)), 1.0 / level, 1.0 / level**2], axis=1) / error[:, None]
    factors, norm = nnls(terms, scatter_m**2 / error)
    if norm**2 > 2.0 * (len(level) - 3):
        return scatter_m
    law: np.ndarray = np.sqrt(terms @ factors * error)
    return law
