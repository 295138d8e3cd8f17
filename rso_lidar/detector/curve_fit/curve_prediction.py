"""Values that a detector is expected to give at the points of measured curves: by closed form, and by its whole chain.

A fit asks for these values at many constants. Detection rates and scatters of range come from the detector's closed form,
rates of dark counts from the law of its noise, and the rest from trials with the same random numbers each time. What a
closed form lacks is added: a large trial at some constants of reference gives the difference, as a shift of the probit of
a rate or of the logarithm of a scatter. The shift is taken to be the same at constants nearby.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from functools import lru_cache
from typing import cast

import numpy as np

from rso_lidar.detector.analysis.closed_form import Prediction
from rso_lidar.detector.analysis.false_alarms import mean_false_alarms_per_s
from rso_lidar.detector.bench.prediction import predict
from rso_lidar.detector.curve_fit.measured_curve import (
    WAVEFORM_QUANTITIES,
    LevelStatistics,
    MeasuredCurve,
    simulate_levels,
)
from rso_lidar.detector.curve_fit.waveform_forms import predict_waveform
from rso_lidar.detector.detection import AnyDetector, false_alarm_probability, list_neglected_effects
from rso_lidar.detector.geiger.array import GeigerArray
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.detector.settings.empirical import Empirical
from rso_lidar.detector.settings.gsfl import Gsfl

_FEW_TRIALS = 8192  # pixels of a level where trials take the place of a closed form
_LEAST_BITS = 25.0  # variance of the number of detections in a large trial from which its rate corrects the closed form
_SEED = 38  # random seed of the trials


@dataclass(frozen=True, eq=False)
class CurveReference:
    """What a large trial at some constants says about a curve; arrays (point).

    Parameters
    ----------
    link : value of the large trial, as probit, logarithm or metres
    shift : to add to that of the closed form
    scatter : standard deviation of one report, in the unit of the curve; 1 where it has none
    kurtosis : of the reports; 3 where it has none
    trials : pixels of each level of the trial; infinite for a curve that needs none
    """

    link: np.ndarray
    shift: np.ndarray
    scatter: np.ndarray
    kurtosis: np.ndarray
    trials: float


@dataclass(frozen=True, eq=False)
class CurvePredictor:
    """Predictor of curves for one pulse of the laser.

    Parameters
    ----------
    pulse : the laser's pulse
    """

    pulse: LaserPulse

    def refer(
        self, detector: AnyDetector, curve: MeasuredCurve, trials: int, photons_scale: float = 1.0
    ) -> CurveReference:
        """Return what a large trial of a detector says about a curve.

        Parameters
        ----------
        trials : pixels of each level
        photons_scale : true over stated photons
        """
        n = len(curve.value)
        if (
            curve.quantity == "dark_counts" or curve.quantity in WAVEFORM_QUANTITIES
        ):  # of raw samples, no error by trials
            own = float(curve.quantity == "dark_counts")
            return CurveReference(np.zeros(n), np.zeros(n), np.full(n, own), np.full(n, 3.0), np.inf)
        levels = _Levels(curve.photons * photons_scale, curve.range_m)
        large = _simulate(cast(Hashable, detector), self.pulse, levels, trials)
        value, scatter, kurtosis = _pick(curve.quantity, large)
        link, shift = to_link(curve.quantity, value), np.zeros(n)
        if self.has_closed_form(detector, curve):
            shift = link - to_link(curve.quantity, self._predict_fast(detector, curve, levels))
        if curve.quantity == "detection_rate":  # of rates near 0 and 1 the closed form knows more than a trial
            shift = np.where(value * (1.0 - value) * trials > _LEAST_BITS, shift, 0.0)
        return CurveReference(link, shift, scatter, kurtosis, float(trials))

    def has_closed_form(self, detector: AnyDetector, curve: MeasuredCurve) -> bool:
        """Return whether the values of a curve come from a closed form, and not from trials."""
        if curve.quantity == "range_scatter":
            return not list_neglected_effects(detector)
        return curve.quantity in ("detection_rate", "dark_counts", *WAVEFORM_QUANTITIES)

    def predict(
        self,
        detector: AnyDetector,
        curve: MeasuredCurve,
        reference: CurveReference | None = None,
        photons_scale: float = 1.0,
    ) -> np.ndarray:
        """Return the expected values of a curve (point), NaN where the detector reports too little to have them.

        Parameters
        ----------
        reference : of a detector nearby, which corrects the fast value (None: uncorrected)
        photons_scale : true over stated photons
        """
        if curve.quantity == "dark_counts":
            return _expect_dark_counts(detector, curve)
        if curve.quantity in WAVEFORM_QUANTITIES:
            if not isinstance(detector, Gsfl):
                return np.full(len(curve.value), np.nan)
            return predict_waveform(detector, self.pulse, curve, photons_scale)
        fast = self._predict_fast(detector, curve, _Levels(curve.photons * photons_scale, curve.range_m))
        if reference is None:
            return fast
        return from_link(curve.quantity, to_link(curve.quantity, fast) + reference.shift)

    def _predict_fast(self, detector: AnyDetector, curve: MeasuredCurve, levels: _Levels) -> np.ndarray:
        """Return the values of a curve (point) by closed form, or by trials."""
        if curve.quantity == "detection_rate":
            known = _predict_form(cast(Hashable, detector), self.pulse, levels)
            false = 0.0 if isinstance(detector, GeigerArray) else false_alarm_probability(detector, curve.range_m)
            return np.asarray(known.probability * (1.0 - false))
        if self.has_closed_form(detector, curve):
            return _predict_form(cast(Hashable, detector), self.pulse, levels).range_precision_m
        return _pick(curve.quantity, _simulate(cast(Hashable, detector), self.pulse, levels, _FEW_TRIALS))[0]


class _Levels:
    """Levels of light and range that hash by their content."""

    def __init__(self, photons: np.ndarray, range_m: np.ndarray) -> None:
        self.photons, self.range_m = photons, range_m
        self._key = (photons.tobytes(), range_m.tobytes())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Levels) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)


@lru_cache(maxsize=64)
def _predict_form(detector: Hashable, pulse: LaserPulse, levels: _Levels) -> Prediction:
    """Predict levels of light by closed form, kept for curves that were measured at the same points."""
    return predict(cast(AnyDetector, detector), pulse, levels.photons, np.zeros(len(levels.photons)))


@lru_cache(maxsize=64)
def _simulate(detector: Hashable, pulse: LaserPulse, levels: _Levels, trials: int) -> LevelStatistics:
    """Simulate levels of light, kept for the several curves that were measured at the same points."""
    return simulate_levels(cast(AnyDetector, detector), pulse, levels.photons, levels.range_m, trials, _SEED)


def to_link(quantity: str, value: np.ndarray) -> np.ndarray:
    """Return the numbers on whose scale the fast values of a quantity are corrected."""
    from scipy.special import ndtri

    if quantity == "detection_rate":
        return np.asarray(ndtri(np.clip(value, _RARE, 1.0 - _RARE)))
    if quantity in ("range_mean", "walk"):
        return value
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.log(value))


def from_link(quantity: str, number: np.ndarray) -> np.ndarray:
    """Return the values of a quantity from the numbers of `to_link`."""
    from scipy.special import ndtr

    if quantity == "detection_rate":
        return np.asarray(ndtr(number))
    return number if quantity in ("range_mean", "walk") else np.asarray(np.exp(number))


_RARE = 1e-9


def _pick(quantity: str, levels: LevelStatistics) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the value of a quantity at each level, the scatter of one report and its kurtosis."""
    if quantity == "detection_rate":
        return levels.share, np.ones(len(levels.share)), np.full(len(levels.share), 3.0)
    if quantity.startswith("counts"):
        mean, scatter, kurtosis = levels.counts_mean, levels.counts_scatter, levels.counts_kurtosis
    else:
        mean, scatter, kurtosis = levels.range_mean_m, levels.range_scatter_m, levels.range_kurtosis
    return scatter if quantity.endswith("scatter") else mean, scatter, kurtosis


def _expect_dark_counts(detector: AnyDetector, curve: MeasuredCurve) -> np.ndarray:
    """Return the expected number of triggers without light (point)."""
    if isinstance(detector, GeigerArray):
        return detector.dark_count_rate_hz * curve.trials
    if isinstance(detector, Empirical):
        return detector.false_alarms_per_s * curve.trials
    if not isinstance(detector, Gsfl):
        return np.full(len(curve.value), np.nan)
    trigger = detector.trigger
    thresholds = np.where(np.isnan(curve.threshold_electrons), trigger.threshold_electrons, curve.threshold_electrons)
    rates = [
        mean_false_alarms_per_s(detector.replace(trigger=trigger.replace(threshold_electrons=threshold)))
        for threshold in thresholds.tolist()
    ]
    expected: np.ndarray = np.array(rates) * curve.trials
    return expected
