"""Whole-object detection: at least m pixels in one flash, and k of n flashes."""

from __future__ import annotations

import math

import numpy as np

_CERTAIN = 1e-12  # probabilities this close to 0 or 1 are taken as such


def at_least(probability: np.ndarray, least: int) -> float:
    """Return the probability that at least `least` of some independent pixels report (Poisson's binomial law).

    Parameters
    ----------
    probability : (pixel) that each reports
    least : number of pixels, from 1

    >>> round(at_least(np.array([0.5, 0.5, 0.5]), 2), 6)
    0.5
    """
    uncertain = probability[(probability > _CERTAIN) & (probability < 1.0 - _CERTAIN)]
    missing = least - int((probability >= 1.0 - _CERTAIN).sum())
    if missing <= 0:
        return 1.0
    if missing > uncertain.size:
        return 0.0
    # State k is that k pixels report so far; the last state is `missing` or more.
    state = np.zeros(missing + 1)
    state[0] = 1.0
    for chance in np.sort(uncertain)[::-1].tolist():
        moved = state[:-1] * chance
        state[:-1] -= moved
        state[1:] += moved
        if state[-1] > 1.0 - _CERTAIN:
            return 1.0
    return min(float(state[-1]), 1.0)


def k_of_n(probability: np.ndarray, needed: int, flashes: int | np.ndarray) -> np.ndarray:
    """Return the probability (…) that at least `needed` of `flashes` independent flashes succeed (binomial law).

    Parameters
    ----------
    probability : (…) that one flash succeeds
    needed, flashes : k and n

    >>> k_of_n(np.array([0.5, 0.9]), 2, 3).round(6).tolist()
    [0.5, 0.972]
    """
    from scipy.special import bdtrc

    chance: np.ndarray = np.clip(bdtrc(needed - 1, flashes, np.asarray(probability, dtype=float)), 0.0, 1.0)
    return chance


def estimate_k_of_n(succeeded: int, tried: int, needed: int, flashes: int) -> float:
    """Estimate without bias, from trials, the probability that at least `needed` of `flashes` flashes succeed.

    That is the share of all choices of `flashes` among the trials with so many successes: a hypergeometric law. The binomial
    law of the share that succeeded would be biased, because it is not linear.

    Parameters
    ----------
    succeeded, tried : successes, and trials; at least `flashes` trials
    needed, flashes : k and n

    Returns
    -------
    float
        The probability; the mean of many estimates is the true one.

    >>> estimate_k_of_n(2, 4, 1, 2)  # of the six pairs of trials only one has no success
    0.8333333333333334
    """
    failed = tried - succeeded
    chosen = sum(math.comb(succeeded, k) * math.comb(failed, flashes - k) for k in range(needed, flashes + 1))
    return chosen / math.comb(tried, flashes)
