"""Probability of collision in the encounter plane (Foster and Estes, NASA JSC-25898, 1992).

Both objects move on straight lines at constant speed while they are near, and the errors of position are Gaussian and do
not change meanwhile. The probability is then the integral of the relative position's density, projected onto the plane
normal to the relative velocity, over a disc of the combined hard-body radius. It is reduced to one integral over error
functions (Elrod's form; Hall, "Expected Collision Rates for Tracked Satellites", J. Spacecraft and Rockets 58, 2021).
"""

from __future__ import annotations

import functools

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.collision.uncertain_state import UncertainSeparation, UncertainState, check_radius

_SIGMAS = 12.0  # at this many standard deviations from its peak a density is 1e-31 of it
_PANELS, _NODES = 24, 16


def foster_probability(first: UncertainState, second: UncertainState, radius_m: float) -> float:
    """Return the probability of collision by the two-dimensional integral of Foster and Estes.

    Parameters
    ----------
    first, second : states at about the closest approach, in the same inertial axes
    radius_m : combined hard-body radius, the sum of both objects' [m]

    Raises
    ------
    ScenarioError
        if there is no relative velocity, or the covariance in the encounter plane is singular
    """
    miss_m, covariance_m2 = UncertainSeparation.between(first, second).encounter_plane()
    return disc_probability(miss_m, covariance_m2, radius_m)


def disc_probability(mean_m: np.ndarray, covariance_m2: np.ndarray, radius_m: float) -> float:
    """Return the probability that a Gaussian vector in a plane is within a radius of the origin.

    Parameters
    ----------
    mean_m : (2,) mean of the vector [m]
    covariance_m2 : (2, 2) its covariance [m2]

    Raises
    ------
    ScenarioError
        if the covariance is not positive definite
    """
    radius = check_radius(radius_m)
    variances, axes = np.linalg.eigh(covariance_m2)
    if not variances[0] > 1e-14 * variances[1]:
        raise ScenarioError(
            "covariance: is singular in the encounter plane; give variances above 0 in two directions, or use Monte Carlo"
        )
    (short, long), (mean_x, mean_y) = np.sqrt(variances), axes.T @ np.asarray(mean_m, dtype=float)
    # integrate along the short axis, over chords of the disc along the long one
    nearest = min(max(mean_x, -radius), radius)  # where the density is greatest on the disc
    low, high = max(-radius, nearest - _SIGMAS * short), min(radius, nearest + _SIGMAS * short)
    angles, weights = _spread_nodes(np.arcsin(low / radius), np.arcsin(high / radius))
    x, half = radius * np.sin(angles), radius * np.cos(angles)
    density = np.exp(-0.5 * ((x - mean_x) / short) ** 2) / (np.sqrt(2.0 * np.pi) * short)
    return float(np.sum(weights * density * half * _between((-half - mean_y) / long, (half - mean_y) / long)))


def _between(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the probability that a standard normal number is between two bounds, without cancellation in a tail."""
    from scipy.special import ndtr

    flip = low > 0.0
    below, above = np.where(flip, -high, low), np.where(flip, -low, high)
    share: np.ndarray = ndtr(above) - ndtr(below)
    return share


def _spread_nodes(low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes and weights of Gauss and Legendre in equal panels from `low` to `high`."""
    nodes, weights = _gauss_legendre()
    edges = np.linspace(low, high, _PANELS + 1)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (1.0 + nodes)).ravel(), (half * weights).ravel()


@functools.cache
def _gauss_legendre() -> tuple[np.ndarray, np.ndarray]:
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    return nodes, weights
