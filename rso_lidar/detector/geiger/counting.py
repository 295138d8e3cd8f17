"""Closed forms of photon counting: noise that forms a peak, first photons of a pulse, dead time."""

from __future__ import annotations

import math

import numpy as np

_MOST_COUNTS = 65_535  # that a reading holds
_PLACE, _WEIGHT = np.polynomial.legendre.leggauss(8)  # over the bin that holds the first count of a peak
_POINTS = 512  # of time, over which first photons are summed
_AT_ONCE = 256  # returns


def false_peak_probability(
    counts: np.ndarray, noise_per_s: np.ndarray, gate_s: float, bin_s: float, peak_bins: int
) -> np.ndarray:
    """Return the probability that noise alone forms a peak in the histogram of a frame.

    A peak begins with a count, which the others follow within the window. The mean number of such beginnings is the mean of
    a Poisson law. Overlapping peaks are counted more than once, so that the probability is rather too high.

    Parameters
    ----------
    noise_per_s : counts of noise in a second of gate, over all pulses of a frame
    gate_s, bin_s : length of the gate and of a bin [s]
    """
    from scipy.special import pdtrc

    counts, noise = np.broadcast_arrays(np.asarray(counts, dtype=float), np.asarray(noise_per_s, dtype=float))
    within = noise[..., None] * bin_s * (peak_bins - 1 + 0.5 * (1.0 + _PLACE))  # the first count is anywhere in its bin
    more = np.where(counts[..., None] < 2.0, 1.0, pdtrc(np.maximum(counts[..., None] - 2.0, 0.0), within))
    probability: np.ndarray = -np.expm1(-noise * gate_s * (more * _WEIGHT).sum(axis=-1) / 2.0)
    return probability


def find_least_counts(
    probability: float, noise_per_s: np.ndarray, gate_s: float, bin_s: float, peak_bins: int
) -> np.ndarray:
    """Find the least counts of a peak that noise forms no more often than this.

    Returns
    -------
    least counts, in the shape of `noise_per_s`.
    """
    noise, place = np.unique(np.asarray(noise_per_s, dtype=float), return_inverse=True)
    low, high = np.zeros(len(noise), dtype=int), np.full(len(noise), _MOST_COUNTS)
    while np.any(high - low > 1):  # more counts are always rarer
        middle = (low + high) // 2
        enough = false_peak_probability(middle, noise, gate_s, bin_s, peak_bins) <= probability
        enough &= middle > 0
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    return high[place].reshape(np.shape(noise_per_s))


def peak_probability(fired: np.ndarray, pulses: int, counts: int) -> np.ndarray:
    """Return the probability of a peak of at least a number of counts, by that of a count in it from one pulse."""
    from scipy.special import betainc

    if counts > pulses:
        return np.zeros(np.shape(fired))
    probability: np.ndarray = betainc(counts, pulses - counts + 1, fired)
    return probability


def threshold_primaries(pulses: int, counts: int) -> float:
    """Return the mean avalanches of a return in a pulse that make a peak in half of all frames."""
    from scipy.special import betaincinv

    if counts > pulses:
        return math.inf
    return -math.log1p(-float(betaincinv(counts, pulses - counts + 1, 0.5)))


def live_fraction(noise_per_s: float, hold_off_s: float, after_s: float) -> float:
    """Return the probability that noise has left a pixel alive.

    Before the end of the first hold-off it is exp(-rate x time); later it is taken as the mean, 1/(1 + rate x hold-off).

    Parameters
    ----------
    noise_per_s : counts of noise in a second
    hold_off_s : dead time after each [s]
    after_s : time since the gate opened [s]
    """
    if after_s <= hold_off_s:
        return math.exp(-noise_per_s * after_s)
    return 1.0 / (1.0 + noise_per_s * hold_off_s)


def first_photon_moments(
    primaries: np.ndarray, depth_s: np.ndarray, step_s: float, power_per_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return mean [s] and variance [s²] (return) of the time of the first avalanche of a return, if there is one.

    Its density is λ(t) exp(−∫λ) over 1 − exp(−N): bright light fires on the leading edge.

    Parameters
    ----------
    primaries : (return) mean avalanches N that the light could start
    depth_s : (return) time over which a surface stretches the pulse [s]
    step_s, power_per_s : taps of the pulse; the middle one is time zero
    """
    edge_s = step_s * (np.arange(len(power_per_s) + 1) - len(power_per_s) // 2 - 0.5)
    energy = np.concatenate([[0.0], np.cumsum(power_per_s)]) * step_s
    fine_s = np.linspace(edge_s[0], edge_s[-1], 8 * _POINTS)
    summed = np.interp(fine_s, edge_s, energy)
    summed = np.concatenate([[0.0], np.cumsum(0.5 * (summed[1:] + summed[:-1]))]) * (fine_s[1] - fine_s[0])
    mean_s, variance_s2 = np.zeros(len(primaries)), np.zeros(len(primaries))

    def integral(at_s: np.ndarray) -> np.ndarray:
        beyond: np.ndarray = np.interp(at_s, fine_s, summed) + np.maximum(at_s - fine_s[-1], 0.0) * energy[-1]
        return beyond

    for start in range(0, len(primaries), _AT_ONCE):
        some = slice(start, start + _AT_ONCE)
        depth = np.maximum(depth_s[some], step_s)[:, None]
        n = np.maximum(primaries[some], 1e-9)[:, None]
        t = np.linspace(edge_s[0] - 0.5 * depth[:, 0], edge_s[-1] + 0.5 * depth[:, 0], _POINTS, axis=1)
        arrived = (integral(t + 0.5 * depth) - integral(t - 0.5 * depth)) / depth
        fired = np.diff(-np.expm1(-n * arrived), axis=1)
        fired /= fired.sum(axis=1, keepdims=True)
        middle = 0.5 * (t[:, 1:] + t[:, :-1])
        mean_s[some] = (fired * middle).sum(axis=1)
        variance_s2[some] = (fired * (middle - mean_s[some, None]) ** 2).sum(axis=1)
    return mean_s, variance_s2
