"""Nonlinear least squares with rejection of outliers, on scipy's solver.

Measurements whose squared normalised residual exceeds a quantile of the chi-square distribution are outliers. Where there
are any, a second solution has a loss that limits their weight. Those of this solution are rejected, and the rest is solved
again without that loss, until the same measurements are used twice.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.errors import PropagationError, ScenarioError

MEASUREMENT_GATE = 0.9999  # probability that a measurement without fault is kept
SHARE = 0.95  # probability of the bounds that a description states
_MOST_PASSES = 20
_SINGULAR = 1e-12  # ratio of singular values, of columns of length 1, at which the parameters cannot be told apart
_ROUNDING = 1e-14  # share of a variance that correlations may leave by rounding alone
_SOFT = 2.5  # sigma above which residuals count less in the first solution, 1.2 % of normal ones; the last has no such limit

Model = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
Whitening = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class GatedSolution:
    """Parameters that fit measurements, with their covariance, and the residuals of all measurements.

    `values` (parameter) and `covariance` (parameter, parameter) are the solution. `residual` (measurement, row) is measured
    minus predicted. `square` (measurement) is its squared norm in units of its covariance, and `used` (measurement) is
    whether a measurement was kept. `chi2` is the weighted sum of squares of those, and `degrees_of_freedom` its
    expectation. `jacobian` (white, parameter) has the derivatives of the used predictions in units of their noise, and
    `weighting` converts others (measurement, row, column) to such rows.
    """

    values: np.ndarray
    covariance: np.ndarray
    residual: np.ndarray
    square: np.ndarray
    used: np.ndarray
    chi2: float
    degrees_of_freedom: int
    jacobian: np.ndarray
    weighting: Callable[[np.ndarray], np.ndarray]

    def map_errors(self, derivative: np.ndarray) -> np.ndarray:
        """Return what a change of predictions does to the values.

        Parameters
        ----------
        derivative : (measurement, row, column) of the predictions with respect to quantities that are not estimated

        Returns
        -------
        (parameter, column) derivatives of the values (Tapley, Schutz and Born 2004, sec. 6.3).
        """
        mapped: np.ndarray = -self.covariance @ self.jacobian.T @ self.weighting(derivative)
        return mapped


def check_epoch(epoch_s: float | None, time_s: np.ndarray, name: str) -> float:
    """Return the epoch of a fit, which is near its measurements.

    Parameters
    ----------
    epoch_s : instant [s] (None: the first measurement)
    time_s : (measurement) instants [s]
    """
    at_s = float(time_s[0]) if epoch_s is None else float(epoch_s)
    if not time_s.min() - units.DAY_S <= at_s <= time_s.max() + units.DAY_S:
        raise ScenarioError(
            f"{name}: epoch {at_s:g} s is more than a day from the measurements; give an instant near them"
        )
    return at_s


def whiten_each(values: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """Return rows in units of their sigma, of measurements that are independent of each other.

    Parameters
    ----------
    values : (measurement, row, column)
    factor : (measurement, row, row) lower Cholesky factors of their covariances
    """
    white: np.ndarray = np.linalg.solve(factor, values)
    return white


def solve_gated(
    model: Model,
    start: np.ndarray,
    covariance: np.ndarray,
    *,
    prior_sigma: np.ndarray | None = None,
    whitening: Whitening | None = None,
    gate: float = MEASUREMENT_GATE,
    name: str = "fit",
) -> GatedSolution:
    """Fit parameters to measurements by least squares, without outliers.

    Parameters
    ----------
    model : ``model(values)`` returns the residuals (measurement, row), measured minus predicted, and the derivatives
        (measurement, row, parameter) of the predictions
    start : (parameter) first values; also the means of the prior
    covariance : (measurement, row, row) of each measurement

    Other Parameters
    ----------------
    prior_sigma : (parameter) standard deviations of independent priors about `start`; infinite for none
    whitening : ``whitening(values (measurement, row, column), used)`` converts the used measurements to rows (white,
        column) with unit covariance, where errors of measurements are correlated (None: independent ones)
    gate : probability that a measurement without fault is kept
    name : start of error messages

    Raises
    ------
    ScenarioError
        For a gate that is no probability, a singular covariance, or measurements that do not determine the parameters or
        contradict each other
    """
    from scipy.optimize import least_squares
    from scipy.special import chdtri

    if not 0.5 <= gate < 1.0:
        raise ScenarioError(
            f"{name}: gate {gate:g} is not a probability from 0.5 to below 1; give for example {MEASUREMENT_GATE:g}"
        )
    count, rows = covariance.shape[:2]
    try:
        factor = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        factor = np.zeros_like(covariance)
    left, variance = factor.diagonal(axis1=1, axis2=2) ** 2, covariance.diagonal(axis1=1, axis2=2)
    if (left <= _ROUNDING * variance).any():
        raise ScenarioError(f"{name}: the covariance of a measurement is singular; state more noise")
    limit = float(chdtri(rows, 1.0 - gate))
    sigma = np.full(len(start), np.inf) if prior_sigma is None else prior_sigma
    known = np.flatnonzero(np.isfinite(sigma))
    prior = np.zeros((len(known), len(start)))
    prior[np.arange(len(known)), known] = 1.0 / sigma[known]

    model = _remember_last(model)  # scipy asks for residuals and derivatives separately

    def weigh(values: np.ndarray, used: np.ndarray, *, independent: bool) -> np.ndarray:
        if whitening is not None and not independent:
            return whitening(values, used)
        return whiten_each(values[used], factor[used]).reshape(-1, values.shape[-1])

    def solve(values: np.ndarray, used: np.ndarray, *, robust: bool) -> np.ndarray:
        def find_rows(x: np.ndarray) -> np.ndarray:
            misfit = weigh(model(x)[0][..., None], used, independent=robust)[:, 0]
            return np.concatenate([misfit, -prior @ (x - start)])

        def find_slopes(x: np.ndarray) -> np.ndarray:
            return -np.concatenate([weigh(model(x)[1], used, independent=robust), prior])

        loss = {"loss": "soft_l1", "f_scale": _SOFT} if robust else {}
        # A relative change of the cost of 1e-6 is enough to find outliers. That of values is relative to the radius of an
        # orbit, so it needs to be near the rounding of float64.
        ends = {"ftol": 1e-6 if robust else 1e-12, "xtol": 1e-15, "gtol": 1e-14, "max_nfev": 50}
        try:
            solution: np.ndarray = least_squares(find_rows, values, jac=find_slopes, x_scale="jac", **loss, **ends).x
        except PropagationError:  # a step toward wrong measurements leads into the Earth
            raise ScenarioError(
                f"{name}: no orbit fits; check measurements, state more noise, or other forces"
            ) from None
        return solution

    used = np.ones(count, dtype=bool)
    _check_rank(weigh(model(start)[1], used, independent=True), prior, name)
    values = solve(start, used, robust=False)
    square = _find_squares(model(values)[0], factor)
    tried = [used.tobytes()]
    if (square > limit).any():
        values = solve(values, used, robust=True)
        square = _find_squares(model(values)[0], factor)
        used = square <= limit
        tried = []
    while used.tobytes() not in tried and len(tried) < _MOST_PASSES:
        tried.append(used.tobytes())
        if rows * int(used.sum()) + len(known) < len(start):
            raise ScenarioError(
                f"{name}: only {int(used.sum())} of {count} measurements agree with one orbit; "
                "state more noise, or another motion or other forces (--zonal-degree 0 for two-body motion)"
            )
        _check_rank(weigh(model(values)[1], used, independent=True), prior, name)
        values = solve(values, used, robust=False)
        square = _find_squares(model(values)[0], factor)
        used = square <= limit
    used = np.frombuffer(tried[-1], dtype=bool)
    residual, slopes = model(values)
    jacobian = weigh(slopes, used, independent=False)
    triangle = np.linalg.qr(np.concatenate([jacobian, prior]), mode="r")  # without the square of the condition number
    inverse = np.linalg.inv(triangle)
    white = weigh(residual[..., None], used, independent=False)[:, 0]
    misfit = prior @ (values - start)
    return GatedSolution(
        values,
        inverse @ inverse.T,
        residual,
        square,
        used,
        float(white @ white + misfit @ misfit),
        rows * int(used.sum()) + len(known) - len(start),
        jacobian,
        lambda derivative: weigh(derivative, used, independent=False),
    )


def _remember_last(model: Model) -> Model:
    """Return a model that does not compute twice in succession for the same values."""
    last: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def recall(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        key = values.tobytes()
        if key not in last:
            evaluation = model(values)
            last.clear()
            last[key] = evaluation
        return last[key]

    return recall


def _find_squares(residual: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """Return the squared norm (measurement) of residuals in units of their covariance."""
    white = whiten_each(residual[..., None], factor)[..., 0]
    squares: np.ndarray = (white**2).sum(axis=1)
    return squares


def _check_rank(slopes: np.ndarray, prior: np.ndarray, name: str) -> None:
    """Check that measurements determine all parameters.

    Parameters
    ----------
    slopes : (white, parameter) derivatives
    prior : (known, parameter) rows of the prior
    """
    rows = np.concatenate([slopes, prior])
    length = np.sqrt((rows**2).sum(axis=0))
    if len(rows) >= rows.shape[1] and (length > 0.0).all():
        ratio = np.linalg.svd(rows / length, compute_uv=False)
        if ratio[-1] > _SINGULAR * ratio[0]:
            return
    raise ScenarioError(f"{name}: the measurements do not determine a state; give more frames, over a longer time")
