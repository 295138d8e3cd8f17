"""Probability of collision by Monte Carlo: both states are drawn from their covariances and flown by two-body motion.

Nothing is projected, and relative motion need not be straight. A draw collides where its distance comes within the
combined hard-body radius inside a window about the given instant. Draws of a fast encounter are first tested on straight
lines, with a bound of the tide that bends them; only those that the bound cannot decide are flown.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.confidence_intervals import clopper_pearson_bounds
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.collision.foster import foster_probability
from rso_lidar.orbit.collision.uncertain_state import UncertainState, check_radius, check_window
from rso_lidar.orbit.two_body.many_states import propagate_many
from rso_lidar.pose import dot

GM = units.EARTH_GM_M3_S2
FEWEST_SAMPLES, MOST_SAMPLES = 100_000, 4_000_000
_WANTED_HITS = 1000  # for a standard error of 3 %
_LOT = 100_000  # samples drawn together
_STATES = 200_000  # states propagated together
_STRAIGHT_RAD = 0.2  # angle of mean motion over which the bound of the tide holds
_STEP_RAD = 0.1  # angle of motion at perigee between nodes; the cubic between them is good to 1e-6 of the distance
_BISECTIONS = 30


@dataclass(frozen=True)
class SampledProbability:
    """A probability of collision by Monte Carlo, with its standard error.

    `samples` and `hits` count draws and collisions. `standard_error` is that of a proportion. `low` and `high` are the
    exact 95 % interval of Clopper and Pearson, which also holds for few hits. `window_s` is the time searched on each side
    of the given instant.
    """

    samples: int
    hits: int
    window_s: float

    @property
    def probability(self) -> float:
        """Share of draws that collide."""
        return self.hits / self.samples

    @property
    def standard_error(self) -> float:
        """Standard error of the probability."""
        return math.sqrt(self.probability * (1.0 - self.probability) / self.samples)

    @property
    def low(self) -> float:
        """Lower end of the 95 % interval."""
        return clopper_pearson_bounds(self.probability, self.samples, 0.975)[0]

    @property
    def high(self) -> float:
        """Upper end of the 95 % interval."""
        return clopper_pearson_bounds(self.probability, self.samples, 0.975)[1]


def sample_collisions(
    first: UncertainState,
    second: UncertainState,
    radius_m: float,
    *,
    rng: np.random.Generator,
    samples: int | None = None,
    window_s: float | None = None,
) -> SampledProbability:
    """Estimate the probability of collision by Monte Carlo with two-body motion.

    Parameters
    ----------
    first, second : states at about the closest approach, in the same inertial axes
    radius_m : combined hard-body radius, the sum of both objects' [m]
    rng : generator of the draws

    Other Parameters
    ----------------
    samples : number of draws; None for some 1000 hits by Foster's probability, from 1e5 to 4e6 draws
    window_s : time searched on each side [s]; None for eight standard deviations of the position along the relative
        velocity, at most half of the shorter period. A draw collides if it does so at any instant of the window: one of
        half a revolution may hold a second crossing of both orbits, and a published probability has a window of its own

    Returns
    -------
    SampledProbability

    Raises
    ------
    ScenarioError
        if the number of draws or the window makes no sense
    PropagationError
        if a draw is not on an ellipse
    """
    radius = check_radius(radius_m)
    count = choose_samples(first, second, radius) if samples is None else samples
    if isinstance(count, bool) or not isinstance(count, int | np.integer) or not 1 <= count <= 1_000_000_000:
        raise ScenarioError(f"samples: {count!r:.40} is not a number of draws; give 1 to 1e9")
    window = check_window(first, second, radius, window_s)
    factors = first.factor(), second.factor()
    means = [np.concatenate([state.position_m, state.velocity_m_s]) for state in (first, second)]
    perigee_rad_s = max(first.fastest_rad_s, second.fastest_rad_s)
    hits = 0
    for begin in range(0, int(count), _LOT):
        lot = min(_LOT, int(count) - begin)
        drawn = [mean + rng.standard_normal((lot, 6)) @ factor.T for mean, factor in zip(means, factors, strict=True)]
        hits += _count_hits(drawn[0], drawn[1], radius, window, perigee_rad_s)
    return SampledProbability(int(count), hits, window)


def choose_samples(first: UncertainState, second: UncertainState, radius_m: float) -> int:
    """Return the number of draws that gives some 1000 hits by Foster's probability, within bounds."""
    try:
        probability = foster_probability(first, second, radius_m)
    except ScenarioError:  # Foster's plane does not exist
        return FEWEST_SAMPLES
    wanted = _WANTED_HITS / max(probability, _WANTED_HITS / MOST_SAMPLES)
    return min(max(math.ceil(wanted / _LOT) * _LOT, FEWEST_SAMPLES), MOST_SAMPLES)


def _count_hits(first: np.ndarray, second: np.ndarray, radius_m: float, window_s: float, perigee_rad_s: float) -> int:
    """Count the draws that collide.

    Parameters
    ----------
    first, second : (draw, 6) states of both objects [m], [m/s]
    window_s : time searched on each side [s]
    perigee_rad_s : angular rate at the lower perigee [rad/s]
    """
    rho, rate = second[:, :3] - first[:, :3], second[:, 3:] - first[:, 3:]
    if perigee_rad_s * window_s > _STRAIGHT_RAD:
        return _scan(first, second, radius_m, window_s, perigee_rad_s)
    square = np.maximum(dot(rate, rate), 1e-12)
    time_s = np.clip(-dot(rho, rate) / square, -window_s, window_s)
    nearest = rho + time_s[:, None] * rate
    miss = np.sqrt(dot(nearest, nearest))
    # the tide bends a straight line by at most 2 n^2 |rho| t^2 / 2; a quarter is added for what it changes on the way
    bent = 1.25 * perigee_rad_s**2 * np.sqrt(dot(rho, rho)) * time_s**2
    sure = miss + bent <= radius_m
    open_ = np.flatnonzero(~sure & (miss - bent <= radius_m))
    return int(sure.sum()) + int((_fly(first[open_], second[open_], time_s[open_], window_s) <= radius_m).sum())


def _fly(first: np.ndarray, second: np.ndarray, time_s: np.ndarray, window_s: float) -> np.ndarray:
    """Return the least distance (draw,) [m] on two-body orbits, by Newton's method from the time on straight lines.

    Parameters
    ----------
    first, second : (draw, 6) states of both objects
    time_s : (draw,) start of the search [s]
    window_s : time searched on each side [s]
    """
    best = np.full(len(time_s), np.inf)
    for _ in range(4):
        (p, v), (q, w) = (propagate_many(state[:, :3], state[:, 3:], time_s) for state in (first, second))
        rho, rate = q - p, w - v
        best = np.minimum(best, np.sqrt(dot(rho, rho)))
        pull = p * (GM / dot(p, p) ** 1.5)[:, None] - q * (GM / dot(q, q) ** 1.5)[:, None]
        curve = dot(rate, rate) + dot(rho, pull)
        step = -dot(rho, rate) / np.where(curve > 0.0, curve, np.inf)
        time_s = np.clip(time_s + step, -window_s, window_s)
    return best


def _scan(first: np.ndarray, second: np.ndarray, radius_m: float, window_s: float, perigee_rad_s: float) -> int:
    """Count the draws (draw, 6) that collide anywhere in a long window, by cubics between nodes of two-body motion."""
    nodes = max(math.ceil(2.0 * window_s * perigee_rad_s / _STEP_RAD), 8) + 1
    time_s = np.linspace(-window_s, window_s, nodes)
    step = float(time_s[1] - time_s[0])
    hits = 0
    lot = max(1, _STATES // nodes)
    for begin in range(0, len(first), lot):
        some = slice(begin, begin + lot)
        grid = np.broadcast_to(time_s, (len(first[some]), nodes))
        (p, v), (q, w) = (propagate_many(state[some, :3], state[some, 3:], grid) for state in (first, second))
        rho, rate = q - p, w - v
        square, closing = dot(rho, rho), dot(rho, rate)
        hit = np.asarray((square <= radius_m**2).any(axis=1))
        draw, k = np.nonzero((closing[:, :-1] < 0.0) & (closing[:, 1:] >= 0.0) & ~hit[:, None])
        least = _least_of_cubics(rho[draw, k], rate[draw, k] * step, rho[draw, k + 1], rate[draw, k + 1] * step)
        hit[draw[least <= radius_m]] = True
        hits += int(hit.sum())
    return hits


def _least_of_cubics(p0: np.ndarray, v0: np.ndarray, p1: np.ndarray, v1: np.ndarray) -> np.ndarray:
    """Return the least distance (n,) of cubics from the origin, where the range falls at the begin and rises at the end.

    Parameters
    ----------
    p0, v0, p1, v1 : (n, 3) positions, and changes per interval, at both ends
    """
    low, high = np.zeros(len(p0)), np.ones(len(p0))

    def place(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        u = u[:, None]
        p = (1 + 2 * u) * (1 - u) ** 2 * p0 + u * (1 - u) ** 2 * v0 + u**2 * (3 - 2 * u) * p1 - u**2 * (1 - u) * v1
        return p, 6 * u * (1 - u) * (p1 - p0) + (1 - u) * (1 - 3 * u) * v0 + u * (3 * u - 2) * v1

    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        p, v = place(middle)
        falls = dot(p, v) < 0.0
        low, high = np.where(falls, middle, low), np.where(falls, high, middle)
    p = place(0.5 * (low + high))[0]
    least: np.ndarray = np.sqrt(dot(p, p))
    return least
