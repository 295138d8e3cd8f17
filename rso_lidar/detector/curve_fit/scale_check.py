"""Measured curves beside the detector that a fit starts from: a wrong unit shows as a shift by a power of ten."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rso_lidar.detector.bench.prediction import predict
from rso_lidar.detector.curve_fit.curve_prediction import CurvePredictor
from rso_lidar.detector.curve_fit.measured_curve import MeasuredCurve
from rso_lidar.detector.detection import AnyDetector
from rso_lidar.errors import ScenarioError

_MOST_FACTOR = 5.0  # between a curve and the detector that its fit starts from
_FARTHEST = 1e9  # factor of light up to which the shift of a detection curve is sought, and its inverse
_POINTS = 400  # factors of light for which detection is computed
_POWER_WITHIN = 0.4  # decades from a power of ten, within which a factor is called that power
_MODERATE = 3.0  # times the threshold: light that is always detected, and does not clip
_NEAR_M = 5.0  # mean error of range from which it is no error of a camera


def check_scale(predictor: CurvePredictor, detector: AnyDetector, curve: MeasuredCurve) -> None:
    """Refuse a curve that lies a factor of more than five beside that of the detector, or metres beside its ranges.

    Parameters
    ----------
    detector : at the start of the fit

    Raises
    ------
    ScenarioError
        With the factor, and the power of ten that it is near to.
    """
    if curve.quantity == "noise_correlation":  # a share, of any sign, which has no unit
        return
    if curve.quantity in ("range_mean", "walk"):
        values = curve.value - (np.median(curve.value) if curve.quantity == "walk" else 0.0)
        worst = int(np.argmax(np.abs(values)))
        if abs(values[worst]) > _NEAR_M:
            raise ScenarioError(
                f"{curve.name}: the mean range is {values[worst]:.4g} m beside the plate at {curve.photons[worst]:.4g} "
                "photons; correct its unit, range_m or range_offset_m"
            )
        return
    if curve.quantity == "detection_rate":
        factor = _find_shift(predictor, detector, curve)
        if factor is not None and not 1.0 / _MOST_FACTOR < factor < _MOST_FACTOR:
            raise ScenarioError(
                f"{curve.name}: its photons are {_name_factor(factor)} those at which the detector reports as often; "
                "correct their unit (photons_per_unit, density), or start nearer (start)"
            )
        return
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = curve.value / predictor.predict(detector, curve)
    known = ratio[np.isfinite(ratio) & (ratio > 0.0)]
    if not len(known):
        if curve.quantity == "dark_counts":  # none in the dark, which is a measurement
            return
        if curve.quantity == "counts_mean":
            _check_counted_light(predictor, detector, curve)
        raise ScenarioError(
            f"{curve.name}: the detector reports nothing at these photons; correct their unit (photons_per_unit, density), "
            "or start nearer (start)"
        )
    factor = float(np.median(known))
    # Noise rises steeply with the threshold, and a variance is a square.
    most = _MOST_FACTOR ** {"dark_counts": 4, "area_variance": 2}.get(curve.quantity, 1)
    if not 1.0 / most < factor < most:
        raise ScenarioError(
            f"{curve.name}: its values are {_name_factor(factor)} those of the detector; correct their unit (unit), that of "
            "the photons, or start nearer (start)"
        )


def _check_counted_light(predictor: CurvePredictor, detector: AnyDetector, curve: MeasuredCurve) -> None:
    """Refuse counts whose light is so far from theirs that the detector sees none of it, or clips all of it."""
    middle = _MODERATE * detector.traits.threshold_photons
    per_photon = (
        float(predictor.predict(detector, replace(curve, photons=np.full(len(curve.value), middle)))[0]) / middle
    )
    factor = float(np.median(curve.photons * per_photon / curve.value))
    if math.isfinite(factor) and not 1.0 / _MOST_FACTOR < factor < _MOST_FACTOR:
        raise ScenarioError(
            f"{curve.name}: its photons are {_name_factor(factor)} those that give so many counts; correct their unit "
            "(photons_per_unit, density), or start nearer (start)"
        )


def _find_shift(predictor: CurvePredictor, detector: AnyDetector, curve: MeasuredCurve) -> float | None:
    """Return the measured over the detector's photons of equal detection; None of a curve that stays at 0 or 1."""
    if not np.any((curve.value > 0.02) & (curve.value < 0.98)) and np.ptp(curve.value) < 0.5:
        return None
    middle = detector.traits.threshold_photons
    light = np.geomspace(middle / 50.0, middle * 50.0, _POINTS)
    rate = predict(detector, predictor.pulse, light, np.zeros(_POINTS), only_probability=True).probability
    shifts = np.geomspace(1.0 / _FARTHEST, _FARTHEST, 2000)
    at = np.log(curve.photons / shifts[:, None])
    expected = np.clip(np.interp(at, np.log(light), rate), 1e-3, 1.0 - 1e-3)
    likelihood = (curve.trials * (curve.value * np.log(expected) + (1.0 - curve.value) * np.log(1.0 - expected))).sum(
        axis=1
    )
    return float(shifts[likelihood.argmax()])


def _name_factor(factor: float) -> str:
    """Return a factor in words, with the power of ten that it is near to."""
    power = round(math.log10(factor))
    if power and abs(math.log10(factor) - power) < _POWER_WITHIN:
        return f"{10 ** abs(power):,} times too {'high' if power > 0 else 'low'}, it seems ({factor:.3g} times)"
    return f"{factor:.3g} times"
