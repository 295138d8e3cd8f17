"""Confidence intervals and one-sided bounds of proportions, counts and bootstrap replicates."""

from __future__ import annotations

import numpy as np


def percentile_interval(replicates: np.ndarray, confidence: float) -> tuple[float, float]:
    """Return the interval between percentiles of a bootstrap; NaN where a replicate has no value.

    Parameters
    ----------
    replicates : (replicate) values
    confidence : probability of the interval
    """
    known = replicates[~np.isnan(replicates)]
    if len(known) < 0.9 * len(replicates) or not len(known):
        return np.nan, np.nan
    tail = 0.5 * (1.0 - confidence)
    low, high = np.quantile(known, [tail, 1.0 - tail], method="inverted_cdf")  # infinite values are allowed
    return float(low), float(high)


def wilson_interval(share: float, count: float, confidence: float) -> tuple[float, float]:
    """Return Wilson's score interval of a proportion (Wilson, 1927).

    Parameters
    ----------
    share : observed proportion
    count : number of independent trials, which need not be whole
    confidence : probability of the interval

    >>> low, high = wilson_interval(0.9, 100, 0.95)
    >>> round(low, 4), round(high, 4)
    (0.8256, 0.9448)
    """
    from scipy.special import ndtri

    if not count > 0 or not np.isfinite(share):
        return np.nan, np.nan
    z2 = float(ndtri(0.5 + 0.5 * confidence)) ** 2
    middle = (share + 0.5 * z2 / count) / (1.0 + z2 / count)
    half = np.sqrt(z2 * (share * (1.0 - share) / count + 0.25 * z2 / count**2)) / (1.0 + z2 / count)
    return (0.0 if share <= 0.0 else float(middle - half)), (1.0 if share >= 1.0 else float(middle + half))


def clopper_pearson_bounds(share: float, count: float, confidence: float) -> tuple[float, float]:
    """Return the exact lower and upper bound of a proportion, each with the confidence (Clopper and Pearson, 1934).

    Parameters
    ----------
    share : observed proportion
    count : number of independent trials, which need not be whole
    confidence : probability that the lower bound is below the proportion, and likewise of the upper bound

    >>> low, high = clopper_pearson_bounds(1.0, 100, 0.95)
    >>> round(low, 4), high  # the 100th root of 0.05
    (0.9705, 1.0)
    """
    from scipy.special import betaincinv

    if not count > 0 or not np.isfinite(share):
        return np.nan, np.nan
    hits = share * count
    misses = count - hits
    low = 0.0 if share <= 0.0 else float(betaincinv(hits, misses + 1.0, 1.0 - confidence))
    high = 1.0 if share >= 1.0 else float(betaincinv(hits + 1.0, misses, confidence))
    return low, high


def poisson_bounds(events: float, confidence: float) -> tuple[float, float]:
    """Return the exact lower and upper bound of the mean of a Poisson count, each with the confidence (Garwood, 1936).

    Parameters
    ----------
    events : observed count, which need not be whole
    confidence : probability that the lower bound is below the mean, and likewise of the upper bound

    >>> low, high = poisson_bounds(0, 0.95)
    >>> low, round(high, 4)  # the rule of three
    (0.0, 2.9957)
    """
    from scipy.special import gammaincinv

    low = 0.0 if events <= 0.0 else float(gammaincinv(events, 1.0 - confidence))
    return low, float(gammaincinv(events + 1.0, confidence))


def student_bounds(values: np.ndarray, confidence: float) -> tuple[float, float]:
    """Return the lower and upper bound of a mean, each with the confidence, by Student's t; NaN below two values.

    Parameters
    ----------
    values : (value) independent values
    confidence : probability that the lower bound is below the mean, and likewise of the upper bound
    """
    from scipy.special import stdtrit

    if len(values) < 2 or not np.isfinite(values).all():
        return np.nan, np.nan
    half = float(stdtrit(len(values) - 1, confidence) * np.std(values, ddof=1) / np.sqrt(len(values)))
    mean = float(np.mean(values))
    return mean - half, mean + half


def bootstrap_bounds(
    replicates: np.ndarray,
    estimate: float,
    confidence: float,
    left_out: np.ndarray | None = None,
    units: int | None = None,
) -> tuple[float, float]:
    """Return the lower and upper bound of a bootstrap, each with the confidence; NaN where a replicate has no value.

    With `left_out` the bounds are bias-corrected and accelerated (BCa; Efron, *J. Am. Stat. Assoc.* 82, 171, 1987), else
    plain percentiles, as for quantiles, for which the jackknife is not consistent. With `units` the tails are expanded for
    a small sample, so that they suit Student's t (Hesterberg, *Am. Stat.* 69, 371, 2015, sec. 5.3).

    Parameters
    ----------
    replicates : (replicate) values
    estimate : value of the sample itself
    confidence : probability of each bound
    left_out : (unit) values of the sample without one of its units
    units : number of independent units of the sample, 2 or more (None: the tails are not expanded)
    """
    from scipy.special import ndtr, ndtri, stdtrit

    if not len(replicates) or not np.isfinite(replicates).all() or not np.isfinite(estimate):
        return np.nan, np.nan
    reach = float(ndtri(confidence) if units is None else np.sqrt(units / (units - 1)) * stdtrit(units - 1, confidence))
    normal = np.array([-reach, reach])
    if left_out is not None:
        below = float(np.mean(replicates < estimate) + 0.5 * np.mean(replicates == estimate))
        off = float(ndtri(np.clip(below, 0.5 / len(replicates), 1.0 - 0.5 / len(replicates))))
        apart = np.mean(left_out) - left_out
        spread = float(np.sum(apart**2)) ** 1.5
        bend = float(np.sum(apart**3)) / (6.0 * spread) if spread > 0.0 else 0.0
        normal = off + (off + normal) / (1.0 - bend * (off + normal))
    low, high = np.quantile(replicates, ndtr(normal))
    return float(low), float(high)


def effective_count(hits: np.ndarray, trials: np.ndarray) -> float:
    """Return the number of independent trials that would give a proportion the variance that it has over encounters.

    The variance is that of a ratio of sums over encounters. Divided by the variance of independent trials it is the
    design effect of survey statistics (Korn and Graubard, *Survey Methodology* 24, 193, 1998). Where all trials succeed or
    all fail, each encounter counts once.

    Parameters
    ----------
    hits, trials : (encounter) successes and trials of each encounter
    """
    asked = trials > 0
    n, total = int(asked.sum()), float(trials.sum())
    if n == 0:
        return 0.0
    share = float(hits.sum()) / total
    if share <= 0.0 or share >= 1.0 or n == 1:
        return float(n)
    residual = hits[asked] - share * trials[asked]
    variance = n / (n - 1) * float((residual**2).sum()) / total**2
    return min(share * (1.0 - share) / variance, total) if variance > 0.0 else total  # 0: all encounters have one share
