"""The threshold of the full chain for a wanted probability of detection, or a wanted rate of false alarms."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from rso_lidar.detector.analysis.closed_form import predict_gsfl
from rso_lidar.detector.analysis.false_alarms import mean_false_alarms_per_s
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.settings.threshold_condition import ThresholdCondition
from rso_lidar.errors import ScenarioError

_DIGITS = 6  # of a solved threshold
_TOLERANCE = 1e-7  # relative, of a threshold
_LOWEST, _HIGHEST = 0.5, 1e4  # times the noise, between which thresholds are sought
_LEAST_RATE = 1e-9  # false alarms a second that are told from none


def solve_threshold(gsfl: Gsfl, pulse: LaserPulse) -> Gsfl:
    """Solve the threshold of a detector for its condition `solve`.

    Parameters
    ----------
    gsfl : the detector; without a condition it stays as it is
    pulse : of the return whose detection is wanted; not used for a rate of false alarms

    Returns
    -------
    Gsfl
        With the solved `trigger.threshold_electrons`, to six digits, and without the condition.

    Raises
    ------
    ScenarioError
        If no threshold fulfils the condition.
    """
    return gsfl if gsfl.solve is None else _solve(gsfl, gsfl.solve, pulse)


@lru_cache(maxsize=32)
def _solve(gsfl: Gsfl, condition: ThresholdCondition, pulse: LaserPulse) -> Gsfl:
    """Solve the threshold for a condition, kept: a lidar is made several times while a scenario is read."""
    from scipy.optimize import brentq
    from scipy.special import ndtri

    def set_threshold(log_electrons: float) -> Gsfl:
        return gsfl.replace(solve=None, trigger=gsfl.trigger.replace(threshold_electrons=math.exp(log_electrons)))

    def miss_detection(log_electrons: float) -> float:
        assert condition.photons is not None
        light = np.array([condition.photons])
        seen = predict_gsfl(set_threshold(log_electrons), pulse, light, np.zeros(1), only_probability=True)
        return float(ndtri(np.clip(seen.probability[0], 1e-15, 1.0 - 1e-15)) - ndtri(condition.pd))

    def miss_rate(log_electrons: float) -> float:
        assert condition.false_alarms_per_s is not None
        rate = mean_false_alarms_per_s(set_threshold(log_electrons))
        return math.log(max(rate, _LEAST_RATE) / condition.false_alarms_per_s)

    is_rate = condition.false_alarms_per_s is not None
    miss = miss_rate if is_rate else miss_detection
    scale = gsfl.noise_electrons or gsfl.electrons_per_photon
    low, high = math.log(_LOWEST * scale), math.log(_HIGHEST * scale)
    if not is_rate:
        assert condition.photons is not None
        high = math.log(max(_HIGHEST * scale, 100.0 * condition.photons * gsfl.electrons_per_photon))
    if gsfl.saturation is not None:  # no signal reaches a threshold at the rail
        high = min(high, math.log(gsfl.saturation.rail_electrons * (1.0 - _TOLERANCE)))
    if high <= low or miss(low) <= 0.0 or miss(high) >= 0.0:
        wanted = (
            f"false_alarms_per_s = {condition.false_alarms_per_s:g}"
            if is_rate
            else f"pd = {condition.pd:g} at {condition.photons:g} photons"
        )
        raise ScenarioError(
            f"detector.solve: no threshold from {_LOWEST:g} times the noise of {gsfl.noise_electrons:.4g} electrons on "
            f"gives {wanted}; change the condition or the noise"
        )
    solved = math.exp(brentq(miss, low, high, xtol=_TOLERANCE))
    return gsfl.replace(solve=None, trigger=gsfl.trigger.replace(threshold_electrons=float(f"{solved:.{_DIGITS}g}")))
