"""Probability of collision in three dimensions (Coppola, AAS 12-248, 2012; Hall, J. Spacecraft and Rockets 58, 2021).

The means of both states are flown by two-body motion, and their covariances with them, to first order. The expected number
of draws that enter a sphere of the combined hard-body radius is the integral, over the time and over the sphere, of the
density of the relative position times the mean speed inwards of what is there. Nothing is projected and motion need not be
straight, so that it also holds for slow encounters. A draw that enters twice counts twice.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.collision.uncertain_state import UncertainSeparation, UncertainState, check_radius, check_window
from rso_lidar.orbit.two_body.many_states import propagate_many
from rso_lidar.orbit.two_body.transition import find_transition
from rso_lidar.pose import dot

_SIGMAS = 8.5  # at this many standard deviations from its peak a density is 1e-16 of it
_CIRCLES, _FEWEST_AROUND, _MOST_AROUND = 48, 128, 300  # on the sphere, and points on each
_SHELLS = 32  # nodes along the radius of the sphere
_STILL = 1e-9  # m/s: least standard deviation of the velocity; one of 0 needs no case of its own
_STEP_RAD = 0.1  # angle of motion at perigee between the instants at which closest approaches are looked for
_SPREADS = 1.0, 4.0, 16.0  # of an encounter's length: where the panels of the integral over time end
_NODES, _HALVINGS = 10, 12  # in a panel of the integral over time; and how often it may be halved
_WITHIN = 3e-4  # share of the integral: a panel is halved again if that changed its part by more
_find_nodes = functools.cache(np.polynomial.legendre.leggauss)  # a quarter of the time of an integral without the cache


class KnownTooWellError(ScenarioError):
    """The relative position is known far better than the radius in two directions."""


@dataclass(frozen=True)
class IntegratedProbability:
    """A probability of collision by the integral over time and sphere.

    `inside` is the probability of being nearer than the radius when the window begins, `entries` the expected number of
    entries into the sphere after that, and `window_s` the time searched on each side of the given instant.
    """

    inside: float
    entries: float
    window_s: float

    @property
    def probability(self) -> float:
        """Both together, at most 1: an upper bound, which is reached where no draw enters twice."""
        return min(1.0, self.inside + self.entries)


def integrate_collisions(
    first: UncertainState, second: UncertainState, radius_m: float, *, window_s: float | None = None
) -> IntegratedProbability:
    """Compute the probability of collision within a window by the integral of Coppola and Hall, to about 1e-3 of it.

    Parameters
    ----------
    first, second : states at about the closest approach, in the same inertial axes
    radius_m : combined hard-body radius, the sum of both objects' [m]
    window_s : time searched on each side of the states' instant [s]; None as for `sample_collisions`

    Returns
    -------
    IntegratedProbability

    Raises
    ------
    ScenarioError
        if the window makes no sense
    KnownTooWellError
        if the relative position is known far better than the radius in two directions
    PropagationError
        if a state is not on an ellipse
    """
    radius = check_radius(radius_m)
    window = check_window(first, second, radius, window_s)

    def rate_per_s(time_s: float) -> float:
        return _entries_per_s(*_relative_state(first, second, time_s), radius)

    entries = _integrate(rate_per_s, [-window, *_find_breaks(first, second, radius, window), window])
    inside = _probability_inside(*_relative_state(first, second, -window), radius)
    return IntegratedProbability(inside, entries, window)


def _integrate(rate_per_s: Callable[[float], float], edges: list[float]) -> float:
    """Integrate a rate over panels between edges [s], which are halved until that changes little."""
    nodes, weights = _find_nodes(_NODES)

    def sum_up(begin: float, end: float) -> float:
        half = 0.5 * (end - begin)
        return half * float(sum(w * rate_per_s(begin + half * (1.0 + x)) for x, w in zip(nodes, weights, strict=True)))

    panels = [(begin, end, sum_up(begin, end)) for begin, end in pairwise(edges)]
    total = 0.0
    for _ in range(_HALVINGS):
        halves = [(begin, 0.5 * (begin + end), end, known) for begin, end, known in panels]
        finer = [(a, b, c, known, sum_up(a, b), sum_up(b, c)) for a, b, c, known in halves]
        now = total + sum(left + right for *_, left, right in finer)
        panels = []
        for a, b, c, known, left, right in finer:
            if abs(left + right - known) <= _WITHIN * now:
                total += left + right
            else:
                panels += [(a, b, left), (b, c, right)]
        if not panels:
            break
    return total + sum(known for *_, known in panels)


def _relative_state(first: UncertainState, second: UncertainState, time_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Return mean (6,) and covariance (6, 6) of the relative state at an instant [m], [m/s]."""
    total, covariance = np.zeros(6), np.zeros((6, 6))
    for sign, state in ((-1.0, first), (1.0, second)):
        there, transitions = find_transition(state.position_m[None], state.velocity_m_s[None], np.array([time_s]))
        transition = transitions[0]
        total += sign * there[0]
        covariance += transition @ state.covariance @ transition.T
    return total, covariance


def _entries_per_s(mean: np.ndarray, covariance: np.ndarray, radius_m: float) -> float:
    """Return the expected entries into the sphere in a second (Hall 2021).

    Parameters
    ----------
    mean, covariance : (6,) and (6, 6) of the relative state [m], [m/s]
    """
    from scipy.special import ndtr

    outward, probability_m = _sample_sphere(mean, covariance, radius_m)
    slope = np.linalg.solve(covariance[:3, :3], covariance[:3, 3:]).T  # of the mean velocity over position
    spread = covariance[3:, 3:] - slope @ covariance[:3, 3:]
    speed = dot(mean[3:] + (radius_m * outward - mean[:3]) @ slope.T, outward)
    sigma = np.sqrt(np.maximum(dot(outward @ spread, outward), _STILL**2))
    over = speed / sigma
    inward = sigma * np.exp(-0.5 * over**2) / math.sqrt(2.0 * math.pi) - speed * ndtr(-over)
    return float(np.sum(probability_m * inward))


def _probability_inside(mean: np.ndarray, covariance: np.ndarray, radius_m: float) -> float:
    """Return the probability of a distance below the radius; the parameters are those of `_entries_per_s`."""
    nodes, shares = _find_nodes(_SHELLS)
    distances, thicknesses = 0.5 * radius_m * (1.0 + nodes), 0.5 * radius_m * shares
    shells = [
        thick * _sample_sphere(mean, covariance, at)[1].sum() for at, thick in zip(distances, thicknesses, strict=True)
    ]
    return float(sum(shells))


def _sample_sphere(mean: np.ndarray, covariance: np.ndarray, radius_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Choose points on a sphere about the origin, and return what an integral over the relative position needs.

    Circles lie about the axis along which the position is known best, and only where its density is not negligible.

    Returns
    -------
    Unit vectors (point, 3), and the probability for each metre of thickness of the sphere (point) [1/m].
    """
    variances, axes = np.linalg.eigh(covariance[:3, :3])
    known, less = np.sqrt(np.maximum(variances[:2], 0.0))
    if not (known > 1e-7 * math.sqrt(variances[2]) and less > radius_m / _MOST_AROUND):
        raise KnownTooWellError(
            f"covariance: the relative position is known to {known:.2g} and {less:.2g} m in two directions, too well for an "
            f"integral over a sphere of {radius_m:g} m; use Foster's probability, or Monte Carlo"
        )
    centre = mean[:3] @ axes
    nearest = min(max(centre[0], -radius_m), radius_m)  # where the density is greatest on the sphere
    low, high = max(-radius_m, nearest - _SIGMAS * known), min(radius_m, nearest + _SIGMAS * known)
    begin, end = math.asin(low / radius_m), math.asin(high / radius_m)
    nodes, shares = _find_nodes(_CIRCLES)
    height = 0.5 * (begin + end) + 0.5 * (end - begin) * nodes
    around = max(_FEWEST_AROUND, math.ceil(2.0 * math.pi * radius_m / less))
    angle = np.arange(around) * (2.0 * math.pi / around)
    cosine = np.cos(height)[:, None]
    outward = np.stack(
        np.broadcast_arrays(np.sin(height)[:, None], cosine * np.cos(angle), cosine * np.sin(angle)), axis=-1
    )
    over = (radius_m * outward - centre) / np.sqrt(variances)
    density = np.exp(-0.5 * dot(over, over)) / math.sqrt((2.0 * math.pi) ** 3 * variances.prod())
    area_m2 = radius_m**2 * 0.5 * (end - begin) * shares[:, None] * cosine * (2.0 * math.pi / around)
    return outward.reshape(-1, 3) @ axes.T, (area_m2 * density).ravel()


def _find_breaks(first: UncertainState, second: UncertainState, radius_m: float, window_s: float) -> list[float]:
    """Return the instants inside the window [s] that part the integral: about each closest approach of the means."""
    from scipy.optimize import brentq

    def closing(time_s: float) -> float:
        rho, rate = _separate(first, second, np.array([time_s]))
        return float(dot(rho, rate)[0])

    fastest = max(first.fastest_rad_s, second.fastest_rad_s)
    time_s = np.linspace(-window_s, window_s, max(math.ceil(2.0 * window_s * fastest / _STEP_RAD), 8) + 1)
    rho, rate = _separate(first, second, time_s)
    towards = dot(rho, rate)
    breaks: set[float] = set()
    for k in np.flatnonzero((towards[:-1] < 0.0) & (towards[1:] >= 0.0)):
        at = brentq(closing, time_s[k], time_s[k + 1])
        mean, covariance = _relative_state(first, second, at)
        between = UncertainSeparation(mean[:3], mean[3:], covariance[:3, :3])
        breaks.add(at)
        if not between.speed_m_s > 0.0:  # at rest there: no time tells how long the means stay close
            continue
        length_s = (between.sigma_along_m + radius_m) / between.speed_m_s
        breaks |= {at + side * spread * length_s for spread in _SPREADS for side in (-1.0, 1.0)}
    return sorted(instant for instant in breaks if abs(instant) < window_s)


def _separate(first: UncertainState, second: UncertainState, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return relative position and velocity (time, 3) of the means [m], [m/s]."""
    (p, v), (q, w) = (propagate_many(s.position_m[None], s.velocity_m_s[None], time_s[None]) for s in (first, second))
    return (q - p)[0], (w - v)[0]
