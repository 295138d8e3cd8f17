"""Residuals of measured curves, whose squares add up to twice the loss of logarithmic likelihood (the deviance).

A rate is binomial, a number of dark counts is Poisson's, a mean is normal. A scatter is normal in its logarithm, with the
variance (kurtosis - 1) / 4 over the number of reports, which is that of a sample's standard deviation. The trials that the
prediction itself rests on, and errors that are common to all trials of a point, reduce the weight of the point.
"""

from __future__ import annotations

import numpy as np

from rso_lidar.detector.curve_fit.curve_prediction import CurveReference
from rso_lidar.detector.curve_fit.measured_curve import MeasuredCurve

_IMPOSSIBLE = 100.0  # residual of a point that the detector does not report at all


def find_residuals(curve: MeasuredCurve, expected: np.ndarray, reference: CurveReference) -> np.ndarray:
    """Return the residuals of a curve (point), each with variance 1 where the detector is the one that was measured.

    Parameters
    ----------
    expected : (point) expected values
    reference : of a detector nearby, with the scatter of its reports
    """
    value, n = curve.value, curve.trials
    trial_part = 1.0 / reference.trials
    if curve.quantity == "detection_rate":
        p = np.clip(expected, 0.5 / reference.trials, 1.0 - 0.5 / reference.trials)
        count = 1.0 / (1.0 / n + trial_part + curve.systematic**2 / (p * (1.0 - p)))
        deviance = 2.0 * count * (_xlogy(value, value / p) + _xlogy(1.0 - value, (1.0 - value) / (1.0 - p)))
        return _bounded(np.sign(value - p) * np.sqrt(np.maximum(deviance, 0.0)))
    if curve.quantity == "dark_counts":
        mean = np.maximum(expected, 1e-6)
        deviance = 2.0 * (_xlogy(value, value / mean) - (value - mean)) / (1.0 + curve.systematic**2 / mean)
        return _bounded(np.sign(value - mean) * np.sqrt(np.maximum(deviance, 0.0)))
    if curve.quantity.endswith("scatter"):
        variance = 0.25 * (reference.kurtosis - 1.0) * (1.0 / n + trial_part)
        variance += (curve.systematic / reference.scatter) ** 2
        with np.errstate(invalid="ignore", divide="ignore"):
            return _bounded(np.log(value / expected) / np.sqrt(variance))
    sigma = np.sqrt(reference.scatter**2 * (1.0 / n + trial_part) + curve.systematic**2)
    difference = value - expected
    if curve.quantity == "walk":
        difference = difference - _weigh(difference, sigma)
    return _bounded(difference / sigma)


def find_offset(curve: MeasuredCurve, expected: np.ndarray, reference: CurveReference) -> float:
    """Return the constant of a walk, which is free: that of greatest likelihood.

    Parameters
    ----------
    expected, reference : as for `find_residuals`
    """
    variance = reference.scatter**2 * (1.0 / curve.trials + 1.0 / reference.trials) + curve.systematic**2
    return _weigh(curve.value - expected, np.sqrt(variance))


def _weigh(difference: np.ndarray, sigma: np.ndarray) -> float:
    """Return the mean of differences by their standard deviations, of those that are known."""
    weight = np.where(np.isfinite(difference), 1.0 / sigma**2, 0.0)
    return float((weight * np.nan_to_num(difference)).sum() / max(weight.sum(), 1e-300))


def count_informative(curve: MeasuredCurve, expected: np.ndarray) -> float:
    """Return the expected sum of the squared residuals of a curve: about 1 for each point.

    A rate so near 0 or 1 that less than one event is expected has a smaller residual, and so has a small number of dark
    counts: of Poisson's law. The free constant of a walk takes one away.
    """
    if curve.quantity == "detection_rate":
        return _expect_deviance(curve.trials * np.minimum(expected, 1.0 - expected))
    if curve.quantity == "dark_counts":
        return _expect_deviance(expected)
    return float(max(len(curve.value) - (curve.quantity == "walk"), 1))


def _expect_deviance(mean: np.ndarray) -> float:
    """Return the sum of the expected deviances of Poisson counts with these means; from 20 on they are 1."""
    from scipy.special import gammaln

    few = np.clip(mean, 1e-12, 20.0)[:, None]
    k = np.arange(80.0)
    share = np.exp(_xlogy(k, few) - few - gammaln(k + 1.0))
    deviance = (share * 2.0 * (_xlogy(k, np.maximum(k, 1.0) / few) - (k - few))).sum(axis=1)
    return float(max(np.minimum(deviance, 1.0).sum(), 1e-3))


def _xlogy(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return x log y, 0 where x is 0."""
    from scipy.special import xlogy

    return np.asarray(xlogy(x, y))


def _bounded(residuals: np.ndarray) -> np.ndarray:
    """Return finite residuals: those of points without a prediction are large."""
    return np.asarray(np.nan_to_num(residuals, nan=_IMPOSSIBLE, posinf=_IMPOSSIBLE, neginf=-_IMPOSSIBLE))
