"""Mean, eccentric and true anomaly of ellipses and hyperbolas, vectorised over both anomaly and eccentricity.

On a hyperbola the eccentric anomaly is H, and the mean anomaly is e sinh H - H. A parabola has neither: NaN. The small
difference between an anomaly and its sine is computed by a series where it would cancel. So all functions are good to
rounding near a parabola too.
"""

from __future__ import annotations

import math

import numpy as np

_MORE_STEPS = 60
_LARGE = 700.0  # hyperbolic anomaly whose sinh is still finite


def eccentric_from_true(true_anomaly_rad: np.ndarray | float, eccentricity: np.ndarray | float) -> np.ndarray:
    """Convert true anomaly to eccentric anomaly.

    Parameters
    ----------
    true_anomaly_rad : (…) [rad]
    eccentricity : (…), broadcast against the anomaly

    Returns
    -------
    (…) eccentric (or hyperbolic) anomaly [rad] on the same turn; NaN beyond a hyperbola's asymptote, and where e = 1
    """
    nu, e = np.broadcast_arrays(np.asarray(true_anomaly_rad, dtype=float), np.asarray(eccentricity, dtype=float))
    turns = math.tau * np.round(nu / math.tau)
    half = 0.5 * (nu - turns)
    ratio = np.sqrt(np.abs(1.0 - e) / (1.0 + e))
    ellipse = turns + 2.0 * np.arctan2(ratio * np.sin(half), np.cos(half))
    tangent = ratio * np.tan(half)
    inside = (e > 1.0) & (np.abs(tangent) < 1.0)
    hyperbola = np.where(inside, 2.0 * np.arctanh(np.where(inside, tangent, 0.0)), math.nan)
    return np.asarray(np.where(e < 1.0, ellipse, hyperbola))


def true_from_eccentric(eccentric_anomaly_rad: np.ndarray | float, eccentricity: np.ndarray | float) -> np.ndarray:
    """Convert eccentric (or hyperbolic) anomaly (…) [rad] to true anomaly (…) [rad], on the same turn."""
    x, e = np.broadcast_arrays(np.asarray(eccentric_anomaly_rad, dtype=float), np.asarray(eccentricity, dtype=float))
    with np.errstate(divide="ignore"):
        ratio = np.where(e == 1.0, math.nan, np.sqrt((1.0 + e) / np.abs(1.0 - e)))
    turns = math.tau * np.round(x / math.tau)
    half = 0.5 * (x - turns)
    ellipse = turns + 2.0 * np.arctan2(ratio * np.sin(half), np.cos(half))
    return np.asarray(np.where(e < 1.0, ellipse, 2.0 * np.arctan(ratio * np.tanh(0.5 * x))))


def mean_from_eccentric(eccentric_anomaly_rad: np.ndarray | float, eccentricity: np.ndarray | float) -> np.ndarray:
    """Convert eccentric (or hyperbolic) anomaly (…) [rad] to mean anomaly (…) [rad] by Kepler's equation."""
    x, e = np.broadcast_arrays(np.asarray(eccentric_anomaly_rad, dtype=float), np.asarray(eccentricity, dtype=float))
    open_ = e > 1.0
    h = np.where(open_, x, 0.0)
    ellipse = (1.0 - e) * np.sin(x) + angle_minus_sine(x)
    hyperbola = (e - 1.0) * np.sinh(h) + _sinh_minus_angle(h)
    return np.asarray(np.where(e == 1.0, math.nan, np.where(open_, hyperbola, ellipse)))


def eccentric_from_mean(mean_anomaly_rad: np.ndarray | float, eccentricity: np.ndarray | float) -> np.ndarray:
    """Solve Kepler's equation for the eccentric (or hyperbolic) anomaly.

    Newton's method inside a bracket; a step that would leave the bracket is replaced by a bisection.

    Parameters
    ----------
    mean_anomaly_rad : (…) [rad]
    eccentricity : (…), broadcast against the anomaly

    Returns
    -------
    (…) eccentric anomaly [rad] on the same turn; NaN where e = 1 or the input is not finite
    """
    mean, e = np.broadcast_arrays(np.asarray(mean_anomaly_rad, dtype=float), np.asarray(eccentricity, dtype=float))
    ellipse = e < 1.0
    turns = np.where(ellipse, math.tau * np.round(mean / math.tau), 0.0)
    m, inner = mean - turns, np.where(ellipse, e, 0.0)
    # the root is between 0 and this bound
    most = np.where(ellipse, np.minimum(np.abs(m) / np.maximum(1.0 - inner, 1e-300), math.pi), 0.0)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        outer = np.minimum(np.abs(m) / np.maximum(e - 1.0, 1e-300), np.cbrt(6.0 * np.abs(m)))
        outer = np.minimum(outer, np.maximum(np.arcsinh(2.0 * np.abs(m)), 2.2))
    most = np.copysign(np.minimum(np.where(ellipse, most, outer), _LARGE), m)
    x = np.where(ellipse, start_eccentric_anomaly(np.where(ellipse, m, 0.0), inner), most)
    low, high = np.minimum(0.0, most), np.maximum(0.0, most)
    x = np.clip(x, low, high)
    left = np.ones(np.shape(x), dtype=bool)
    for _ in range(_MORE_STEPS):
        h = np.where(ellipse, 0.0, x)
        slope = np.where(ellipse, 1.0 - e + 2.0 * e * np.sin(0.5 * x) ** 2, e - 1.0 + 2.0 * e * np.sinh(0.5 * h) ** 2)
        miss = np.asarray(mean_from_eccentric(x, e) - m)
        low, high = np.where(miss <= 0.0, x, low), np.where(miss >= 0.0, x, high)
        after = x - miss / np.where(slope > 0.0, slope, 1.0)
        after = np.where((after >= low) & (after <= high), after, 0.5 * (low + high))
        after = np.where(left, after, x)
        left = left & (np.abs(after - x) > 4e-16 * np.abs(x))
        x = after
        if not left.any():
            break
    return np.asarray(np.where(np.isfinite(mean) & (e != 1.0), x + turns, math.nan))


def true_from_mean(mean_anomaly_rad: np.ndarray | float, eccentricity: np.ndarray | float) -> np.ndarray:
    """Convert mean anomaly to true anomaly, on the same turn.

    Parameters
    ----------
    mean_anomaly_rad : (…) [rad]
    eccentricity : (…), broadcast against the anomaly

    Returns
    -------
    (…) true anomaly [rad]; NaN where e = 1 or the input is not finite
    """
    return true_from_eccentric(eccentric_from_mean(mean_anomaly_rad, eccentricity), eccentricity)


def mean_from_true(true_anomaly_rad: np.ndarray | float, eccentricity: np.ndarray | float) -> np.ndarray:
    """Convert true anomaly to mean anomaly, on the same turn.

    Parameters
    ----------
    true_anomaly_rad : (…) [rad]
    eccentricity : (…), broadcast against the anomaly

    Returns
    -------
    (…) mean anomaly [rad]; NaN beyond a hyperbola's asymptote, and where e = 1
    """
    return mean_from_eccentric(eccentric_from_true(true_anomaly_rad, eccentricity), eccentricity)


def start_eccentric_anomaly(mean_anomaly_rad: np.ndarray, eccentricity: np.ndarray | float) -> np.ndarray:
    """Return an ellipse's eccentric anomaly within 1e-3 of itself, mean anomaly in [-pi, pi] (Markley 1995, eqs. 15-20).

    Markley, Kepler Equation Solver, Celestial Mechanics 63: the root of a cubic that approximates Kepler's equation.
    """
    m, e = mean_anomaly_rad, eccentricity
    less, mm = 1.0 - e, m * m
    k = 1.6 * math.pi / (1.0 + e)
    alpha = (3.0 * math.pi**2 + math.pi * k - k * np.abs(m)) / (math.pi**2 - 6.0)
    d = 3.0 * less + alpha * e
    ad = alpha * d
    q = 2.0 * less * ad - mm
    r = np.abs(m) * (3.0 * ad * (d - less) + mm)
    w = np.cbrt(r + np.sqrt(q * q * q + r * r))
    w = w * w
    root: np.ndarray = np.copysign((2.0 * r * w / np.maximum(w * w + w * q + q * q, 1e-300) + np.abs(m)) / d, m)
    return root


def solve_kepler(mean_anomaly_rad: np.ndarray, eccentricity: float) -> tuple[np.ndarray, np.ndarray]:
    """Return sine and cosine of an ellipse's eccentric anomaly (Markley 1995, eqs. 15-26, then a step of Newton's method).

    Parameters
    ----------
    mean_anomaly_rad : (…) [rad]
    eccentricity : below 1

    Returns
    -------
    sine, cosine : (…) of the eccentric anomaly
    """
    mean_rad, e = mean_anomaly_rad, eccentricity
    m = mean_rad - math.tau * np.round(mean_rad / math.tau)
    anomaly = start_eccentric_anomaly(m, e)
    f2, f3 = e * np.sin(anomaly), e * np.cos(anomaly)
    f0, f1 = anomaly - f2 - m, 1.0 - f3
    step = -f0 / (f1 - 0.5 * f0 * f2 / f1)
    step = -f0 / (f1 + 0.5 * step * (f2 + step * f3 / 3.0))
    anomaly = anomaly - f0 / (f1 + 0.5 * step * (f2 + step / 3.0 * (f3 - 0.25 * step * f2)))
    s, c = np.sin(anomaly), np.cos(anomaly)
    rest = (anomaly - e * s - m) / (1.0 - e * c)  # residual of rounding
    return s - rest * c, c + rest * s


def angle_minus_sine(x: np.ndarray) -> np.ndarray:
    """Return x - sin x, by its series within 1 rad."""
    z = np.minimum(x * x, 1.0)
    total = np.zeros_like(z)
    for k in range(8, -1, -1):
        total = 1.0 / math.factorial(2 * k + 3) - z * total
    return np.asarray(np.where(np.abs(x) < 1.0, x * z * total, x - np.sin(x)))


def _sinh_minus_angle(x: np.ndarray) -> np.ndarray:
    """Return sinh x - x, by its series within 1."""
    z = np.minimum(x * x, 1.0)
    total = np.zeros_like(z)
    for k in range(8, -1, -1):
        total = 1.0 / math.factorial(2 * k + 3) + z * total
    return np.asarray(np.where(np.abs(x) < 1.0, x * z * total, np.sinh(x) - x))
