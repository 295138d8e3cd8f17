"""Constants of a detector by greatest likelihood of measured curves, with intervals, correlations and goodness of fit."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar.detector.curve_fit.curve_prediction import CurvePredictor, CurveReference, from_link, to_link
from rso_lidar.detector.curve_fit.free_constants import FreeConstant, find_constants, get_constant, set_constants
from rso_lidar.detector.curve_fit.likelihood import count_informative, find_offset, find_residuals
from rso_lidar.detector.curve_fit.measured_curve import MeasuredCurve
from rso_lidar.detector.curve_fit.scale_check import check_scale
from rso_lidar.detector.detection import AnyDetector
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.errors import ScenarioError

_MOST_ROUNDS = 12  # of a fit and a large trial where it ended
_FEWER_FIRST = 8  # times fewer trials in the rounds until the constants settle
_SETTLED = 0.5  # standard errors of each constant: a smaller step between rounds is noise of the trials
_DERIVATIVE_STEP = 0.005  # of a free number; closed forms are smooth
_TRIAL_STEP = 0.1  # of a free number to each side for slopes by trials, over which their noise is small
_FARTHEST_STEP = 1.5  # of a free number in a round: farther away slopes and shifts say little
_TETHER = 0.05  # weight of a step: where the curves say nothing, numbers stay where they are
_MOST_EVALUATIONS = 60
_REJECTED_BELOW = 1e-3  # probability of a worse fit, below which the model is rejected
_UNRESOLVED = 1.0  # standard error of a free number, which is a factor e, from which constants count as unknown
_LEAST_INFORMATION = 1e-2  # added for free numbers on the way, of which nothing may be known yet
_INVOLVED = 0.3  # component of an unknown direction from which a constant is named
ALIKE = 0.95  # correlation from which two constants are hard to tell apart


@dataclass(frozen=True, eq=False)
class FittedConstant:
    """A fitted constant.

    Parameters
    ----------
    name : dotted name in `[lidar.detector]`
    value : of greatest likelihood
    low, high : ends of its confidence interval
    start : value at which the fit began
    """

    name: str
    value: float
    low: float
    high: float
    start: float


@dataclass(frozen=True, eq=False)
class FittedCurve:
    """A measured curve beside the fitted detector's; arrays (point).

    Parameters
    ----------
    curve : as measured
    expected : values of the fitted detector, the free constant of a walk included
    before : values of the detector at the start of the fit
    residuals : measured less expected over the standard error, with the sign of the difference
    points : number of points; one of a rate near 0 or 1 counts as less, because its residual scatters less
    p_value : probability of a worse fit of this curve, were the model true
    """

    curve: MeasuredCurve
    expected: np.ndarray
    before: np.ndarray
    residuals: np.ndarray
    points: float
    p_value: float

    @property
    def chi2(self) -> float:
        """Sum of the squared residuals."""
        return float((self.residuals**2).sum())


@dataclass(frozen=True, eq=False)
class ConstantFit:
    """Constants of a detector as measured curves give them.

    Parameters
    ----------
    detector : with the fitted constants
    constants : the fitted constants
    confidence : probability of their intervals
    correlation : (constant, constant) of the free numbers, logarithms of positive constants
    curves : the curves beside the fit
    chi2, freedom : sum of squared residuals, and its degrees of freedom
    p_value : probability of a worse fit, were the model true; None where less than one degree of freedom is left
    photons_scale : true over stated photons, with its interval; None unless an error of the photons was stated
    """

    detector: AnyDetector
    constants: tuple[FittedConstant, ...]
    confidence: float
    correlation: np.ndarray
    curves: tuple[FittedCurve, ...]
    chi2: float
    freedom: float
    p_value: float | None
    photons_scale: FittedConstant | None

    @property
    def is_rejected(self) -> bool:
        """Whether the detector cannot have given the curves, all together or one of them."""
        return (self.p_value is not None and self.p_value < _REJECTED_BELOW) or bool(self.misfits)

    @property
    def misfits(self) -> list[FittedCurve]:
        """Curves that the detector cannot have given; the chance of one of them to be so is shared among all."""
        return [curve for curve in self.curves if curve.p_value * len(self.curves) < _REJECTED_BELOW]

    @property
    def hard_to_tell(self) -> list[tuple[str, str, float]]:
        """Pairs of constants that the curves hardly tell apart, with their correlation."""
        names = [constant.name for constant in self.constants]
        return [
            (names[i], names[j], float(self.correlation[i, j]))
            for i in range(len(names))
            for j in range(i)
            if abs(self.correlation[i, j]) > ALIKE
        ]


def fit_constants(
    detector: AnyDetector,
    pulse: LaserPulse,
    curves: Sequence[MeasuredCurve],
    names: Sequence[str],
    *,
    start: Mapping[str, float] | None = None,
    confidence: float = 0.95,
    photons_error_fraction: float = 0.0,
    trials: int = 65_536,
    on_round: Callable[[int], None] = lambda _: None,
) -> ConstantFit:
    """Fit named constants of a detector to measured curves by greatest likelihood.

    Each round fits a model of the curves near the constants where the last one ended. There large trials through the whole
    chain give the values. Beside it, detection rates and scatters of range follow their closed forms, and other values
    their slopes, by trials at constants to each side. Intervals are those of the curvature of the likelihood, in the
    logarithm of a positive constant.

    Parameters
    ----------
    detector : with all constants that are not fitted
    pulse : the laser's pulse
    curves : the measured curves
    names : dotted names of the constants, such as ``amplifier.noise_electrons``

    Other Parameters
    ----------------
    start : where the fit starts, by name, in place of the detector's own values
    confidence : probability of the intervals
    photons_error_fraction : relative error that all stated photons share, 1 sigma. Their scale is then fitted too
    trials : pixels for each level of the large trials in the last round
    on_round : called with the number of each round

    Returns
    -------
    ConstantFit

    Raises
    ------
    ScenarioError
        If a constant is unknown, the curves hold too little for the constants, or the fit does not converge.
    """
    constants = find_constants(detector, names, start)
    if not constants:
        raise ScenarioError("constants: none is named; name one, such as trigger.threshold_electrons")
    at_start = set_constants(detector, {constant.name: constant.start for constant in constants})
    problem = _Problem(at_start, CurvePredictor(pulse), tuple(curves), constants, photons_error_fraction)
    _check_points(problem)
    for curve in problem.curves:
        check_scale(problem.predictor, at_start, curve)
    free, now = problem.start, max(trials // _FEWER_FIRST, 1)
    for number in range(_MOST_ROUNDS):
        on_round(number + 1)
        problem.refer(free, now)
        optimum = _minimise(problem, free)
        information = problem.differentiate(optimum)
        normal = information.T @ information
        sigma = np.sqrt(np.diagonal(np.linalg.inv(normal + _LEAST_INFORMATION * np.eye(len(optimum)))))
        settled = bool(np.all(np.abs(optimum - free) < _SETTLED * sigma))
        step, free = np.abs(optimum - free) / sigma, optimum
        if settled and now == trials:
            _check_resolved(problem, normal)
            return _summarise(problem, free, normal, confidence)
        if settled:
            now = trials
    _check_resolved(problem, normal)
    raise ScenarioError(
        f"constants: the fit does not converge in {_MOST_ROUNDS} rounds ({problem.labels[int(step.argmax())]} still moves); "
        "start nearer (start), or fit fewer constants"
    )


class _Problem:
    """Residuals of all curves as a function of the free numbers, the last of which may be the scale of photons."""

    def __init__(
        self,
        detector: AnyDetector,
        predictor: CurvePredictor,
        curves: tuple[MeasuredCurve, ...],
        constants: list[FreeConstant],
        photons_error_fraction: float,
    ) -> None:
        self.detector, self.predictor, self.curves, self.constants = detector, predictor, curves, constants
        self.photons_error = photons_error_fraction
        self.labels = [constant.name for constant in constants] + ["the scale of photons"] * (
            photons_error_fraction > 0.0
        )
        self.references: list[CurveReference] = []
        self.slopes: list[np.ndarray | None] = []  # (point, number) of each curve, on the scale of `to_link`
        self.referred = np.zeros(0)
        self.start = np.array(
            [constant.to_free(constant.start) for constant in constants] + [0.0] * (photons_error_fraction > 0.0)
        )

    def split(self, free: np.ndarray) -> tuple[AnyDetector, float]:
        """Return the detector and the scale of photons for free numbers."""
        values = {
            constant.name: constant.to_value(float(number))
            for constant, number in zip(self.constants, free, strict=False)
        }
        return set_constants(self.detector, values), math.exp(free[-1]) if self.photons_error > 0.0 else 1.0

    def refer(self, free: np.ndarray, trials: int) -> None:
        """Run the large trials at free numbers, and those about them for slopes."""
        detector, scale = self.split(free)
        self.referred = free
        self.references = [self.predictor.refer(detector, curve, trials, scale) for curve in self.curves]
        self.slopes = [
            None if self.predictor.has_closed_form(detector, curve) else self._find_slopes(curve, free)
            for curve in self.curves
        ]

    def _find_slopes(self, curve: MeasuredCurve, free: np.ndarray) -> np.ndarray:
        """Return the slopes (point, number) of a curve by trials at free numbers to each side."""
        columns = []
        for step in _TRIAL_STEP * np.eye(len(free)):
            ends = []
            for sign in (1.0, -1.0):
                detector, scale = self.split(free + sign * step)
                ends.append(to_link(curve.quantity, self.predictor.predict(detector, curve, None, scale)))
            columns.append((ends[0] - ends[1]) / (2.0 * _TRIAL_STEP))
        return np.stack(columns, axis=1)

    def expect(self, free: np.ndarray) -> list[np.ndarray]:
        """Return the expected values of each curve."""
        detector, scale = self.split(free)
        return [
            self.predictor.predict(detector, curve, reference, scale)
            if slopes is None
            else from_link(curve.quantity, reference.link + slopes @ (free - self.referred))
            for curve, reference, slopes in zip(self.curves, self.references, self.slopes, strict=True)
        ]

    def residuals(self, free: np.ndarray) -> np.ndarray:
        """Return the residuals of all points, and that of the scale of photons."""
        try:
            expected = self.expect(free)
        except ScenarioError:  # such as a threshold above the rail: these constants cannot be
            expected = [np.full(len(curve.value), np.nan) for curve in self.curves]
        parts = [
            find_residuals(curve, values, reference)
            for curve, values, reference in zip(self.curves, expected, self.references, strict=True)
        ]
        if self.photons_error > 0.0:
            parts.append(np.array([free[-1] / self.photons_error]))
        return np.concatenate(parts)

    def differentiate(self, free: np.ndarray) -> np.ndarray:
        """Return the derivatives of the residuals (residual, number), from differences to one side."""
        here = self.residuals(free)
        columns = [
            (self.residuals(free + step) - here) / _DERIVATIVE_STEP for step in _DERIVATIVE_STEP * np.eye(len(free))
        ]
        return np.stack(columns, axis=1)


def _check_points(problem: _Problem) -> None:
    points = sum(len(curve.value) - (curve.quantity == "walk") for curve in problem.curves)
    if points <= len(problem.constants):
        raise ScenarioError(
            f"constants: {len(problem.constants)} constants from {points} point{'s' * (points != 1)} leave nothing to judge "
            "the fit by; fit fewer, or add points"
        )


def _minimise(problem: _Problem, free: np.ndarray) -> np.ndarray:
    """Return the free numbers of least sum of squared residuals."""
    from scipy.optimize import least_squares

    solution = least_squares(  # of the step from here
        lambda step: np.concatenate([problem.residuals(free + step), _TETHER * step]),
        np.zeros(len(free)),
        jac=lambda step: np.concatenate([problem.differentiate(free + step), _TETHER * np.eye(len(free))]),
        bounds=(-_FARTHEST_STEP, _FARTHEST_STEP),
        xtol=1e-4,
        ftol=1e-5,
        gtol=1e-4,
        max_nfev=_MOST_EVALUATIONS,
    )
    if solution.status == 0:
        raise ScenarioError(
            f"constants: the fit does not converge in {_MOST_EVALUATIONS} steps; start nearer (start), or fit fewer "
            "constants"
        )
    return np.asarray(free + solution.x)


def _check_resolved(problem: _Problem, normal: np.ndarray) -> None:
    """Refuse constants of which the curves hold no information, and name them."""
    size, direction = np.linalg.eigh(normal)
    if size[0] > 1.0 / _UNRESOLVED**2:
        return
    parts = np.abs(direction[:, 0])
    least = min(_INVOLVED, float(parts.max()))
    involved = [label for label, part in zip(problem.labels, parts, strict=True) if part >= least]
    if len(involved) > 1:
        what = f"{' and '.join(involved)} cannot be told apart by these curves"
        raise ScenarioError(f"constants: {what}; fix one of them, or add a curve that depends on one alone")
    raise ScenarioError(
        f"constants: these curves hardly depend on {involved[0]}; leave it out, or add a curve that does"
    )


def _summarise(problem: _Problem, free: np.ndarray, normal: np.ndarray, confidence: float) -> ConstantFit:
    """Return the fit at its end, `normal` being the matrix of information of the free numbers."""
    from scipy.special import ndtri
    from scipy.stats import chi2

    covariance = np.linalg.inv(normal)
    sigma = np.sqrt(np.diagonal(covariance))
    z = float(ndtri(0.5 + 0.5 * confidence))
    detector, scale = problem.split(free)
    before, _ = problem.split(problem.start)
    fitted = tuple(
        FittedConstant(
            constant.name,
            get_constant(detector, constant.name),
            constant.to_value(number - z * spread),
            constant.to_value(number + z * spread),
            constant.start,
        )
        for constant, number, spread in zip(problem.constants, free.tolist(), sigma.tolist(), strict=False)
    )
    curves = []
    for curve, expected, reference in zip(problem.curves, problem.expect(free), problem.references, strict=True):
        residuals = find_residuals(curve, expected, reference)
        first = problem.predictor.predict(before, curve, None)
        if curve.quantity == "walk":
            expected, first = (values + find_offset(curve, values, reference) for values in (expected, first))
        points = count_informative(curve, expected)
        p_value = float(chi2.sf((residuals**2).sum(), points))
        curves.append(FittedCurve(curve, expected, first, residuals, points, p_value))
    n_constants = len(problem.constants)
    freedom = max(sum(curve.points for curve in curves) - n_constants, 0.0)
    total = float((problem.residuals(free) ** 2).sum())
    scale_fit = None
    if problem.photons_error > 0.0:
        low, high = (math.exp(free[-1] + sign * z * sigma[-1]) for sign in (-1.0, 1.0))
        scale_fit = FittedConstant("photons_scale", scale, low, high, 1.0)
    correlation = covariance / np.outer(sigma, sigma)
    return ConstantFit(
        detector,
        fitted,
        confidence,
        correlation[:n_constants, :n_constants],
        tuple(curves),
        total,
        freedom,
        float(chi2.sf(total, freedom)) if freedom >= 1.0 else None,
        scale_fit,
    )
