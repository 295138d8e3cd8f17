"""False alarms: how often filtered noise crosses a comparator's threshold upward, avalanche tails included.

The amplifier has two equal real poles, h(t) = (t/τ²) exp(−t/τ), and its output x is current times integration time: shot
noise of dark current and background through h, one pulse for each avalanche, plus Gaussian noise of the amplifier with
the same spectrum. Gaussian statistics give Rice's formula; avalanches make the tail thicker by orders of magnitude.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from rso_lidar.detector.settings.apd import Apd, cumulants, noise_rms, tail_per_electron
from rso_lidar.detector.stages.avalanche import mcintyre_pmf

_GRID = 8192  # steps of amplitude in a density
_STEEPEST = 0.8  # share of the tail's own decay to which a density is tilted
_TILTS = 24  # with four deviations each; beyond them the rate is nil
_NIL = -250.0  # log of the least rate that counts as more than none


def false_alarm_rate(
    threshold_electrons: np.ndarray,
    *,
    apd: Apd,
    rate_per_s: np.ndarray | float,
    noise_electrons: float,
    pole_s: float,
    integration_s: float,
) -> np.ndarray:
    """Return upcrossings [1/s] of thresholds above the baseline.

    Rice's p(T) E[x'⁺ | x = T], with the true density p of the output and the true mean square of its slope x' where x =
    T. The slope is taken as normal, which is the only approximation. It is right where the amplifier's noise or many
    simultaneous avalanches dominate, and up to a quarter too high where single avalanches do. Thresholds below the
    baseline count as on it.

    Parameters
    ----------
    threshold_electrons : [electrons]
    rate_per_s : primaries of dark current and background [1/s]
    noise_electrons, pole_s, integration_s : noise, time constant and unit of amplitude of the amplifier
    """
    threshold, rate = np.broadcast_arrays(
        np.maximum(np.asarray(threshold_electrons, dtype=float), 0.0), np.asarray(rate_per_s, dtype=float)
    )
    result = rice_rate(threshold, noise_rms(apd, rate, noise_electrons, pole_s, integration_s), pole_s)
    if apd.statistics == "gaussian" or not (rate > 0.0).any():
        return result
    sigma = float(noise_rms(apd, rate.max(), noise_electrons, pole_s, integration_s))
    peak = integration_s / pole_s
    beyond = 40.0 * sigma + 60.0 * peak / (math.e * tail_per_electron(apd.gain, apd.ionisation_ratio))
    shot = (rate > 0.0) & (threshold < beyond)
    result = np.where((rate > 0.0) & ~shot, 0.0, result)
    if not shot.any():
        return result
    T, pulses = threshold[shot], rate[shot] * pole_s
    result[shot] = _crossings(T, apd, pulses, noise_electrons, peak) / pole_s
    return result


def rice_rate(threshold_electrons: np.ndarray, sigma_electrons: np.ndarray | float, pole_s: float) -> np.ndarray:
    """Return the upcrossings of Gaussian noise [1/s]: ν₀ exp(−T²/2σ²), ν₀ = 1/(2πτ) for two equal poles (Rice 1945).

    ν₀² = ∫f²|H|² df / ∫|H|² df with |H|² = 1/(1 + (2πfτ)²)² is (1/(2πτ))².

    Parameters
    ----------
    threshold_electrons : T above the mean [electrons]
    sigma_electrons : rms σ of the noise [electrons]
    pole_s : time constant τ of both poles [s]
    """
    sigma = np.asarray(sigma_electrons, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        over = np.where(sigma > 0.0, np.maximum(threshold_electrons, 0.0) / sigma, np.inf)
    rate: np.ndarray = np.exp(-0.5 * over**2) / (2.0 * math.pi * pole_s)
    return rate


def _crossings(T: np.ndarray, apd: Apd, pulses: np.ndarray, noise: float, peak: float) -> np.ndarray:
    """Return the upcrossings per τ of thresholds.

    Parameters
    ----------
    T : thresholds [electrons]
    noise, peak : rms of the amplifier's noise, and its integration time over τ
    """
    if pulses.min() == pulses.max():
        order = np.argsort(T)
        log_rate = np.empty(T.shape)
        log_rate[order] = _log_crossings(T[order], apd, float(pulses[0]), noise, peak)
        return np.where(log_rate > _NIL + 10.0, np.exp(log_rate), 0.0)
    from scipy.interpolate import RectBivariateSpline

    top, low, high = float(T.max()), math.log(pulses.min()) - 0.05, math.log(pulses.max()) + 0.05
    levels = np.linspace(low, high, max(4, math.ceil((high - low) / 0.5) + 1))
    grid = np.linspace(min(float(T.min()), 0.99 * top), top + 1e-9, 257)
    table = [_log_crossings(grid, apd, math.exp(level), noise, peak) for level in levels]
    log_rate = RectBivariateSpline(levels, grid, np.array(table)).ev(np.log(pulses), T)
    return np.where(log_rate > _NIL + 10.0, np.exp(log_rate), 0.0)


class _NoisePulses(NamedTuple):
    """What one primary per τ does: Σ measure(j) f(j) is ∫ E[f(n u g(x))] dx over its pulse g = x exp(−x)."""

    jump: np.ndarray  # amplitude [electrons], from one step below zero
    measure: np.ndarray
    steepness: np.ndarray  # the measure, weighted with (τ x')²


@lru_cache(maxsize=8)
def _pulses(gain: float, ionisation_ratio: float, peak: float, step: float) -> _NoisePulses:
    """Return the distribution of value and slope of avalanche noise behind the amplifier, on a grid of amplitudes.

    Parameters
    ----------
    gain, ionisation_ratio : gain of the APD, and its ratio of ionisation by holes and electrons
    peak : amplitude of one electron [electrons]
    step : step of the grid [electrons]
    """
    first, pmf = mcintyre_pmf(1, gain, ionisation_ratio)
    n = first + np.arange(len(pmf), dtype=float)
    # Long avalanches are represented by the mean of their group of 1 %.
    group = np.where(n < 100.0, n, 100.0 + np.floor(100.0 * np.log(n / 100.0 + 1e-12))).astype(int)
    share = np.bincount(group, pmf)
    n = np.bincount(group, n * pmf)[share > 0.0] / share[share > 0.0]
    share = share[share > 0.0]
    width = 0.01
    x = (np.arange(1600) + 0.5) * width
    place = (peak * n[:, None] * x * np.exp(-x) / step).ravel()
    slope = (peak * n[:, None] * (1.0 - x) * np.exp(-x)).ravel()
    weight = np.repeat(share * width, len(x))
    # Onto three neighbours on the grid, so that mass, mean and mean square stay what they are.
    at = np.rint(place).astype(np.intp)
    off = place - at
    size = int(at.max()) + 3
    measure, steepness = (
        np.bincount(at, 0.5 * (off**2 - off) * what, size)
        + np.bincount(at + 1, (1.0 - off**2) * what, size)
        + np.bincount(at + 2, 0.5 * (off**2 + off) * what, size)
        for what in (weight, weight * slope**2)
    )
    return _NoisePulses((np.arange(size) - 1.0) * step, measure, steepness)


def _log_crossings(T: np.ndarray, apd: Apd, pulses: float, noise: float, peak: float) -> np.ndarray:
    """Return the log of upcrossings per τ of ascending thresholds.

    The density is the Fourier inverse of exp K(s − iω). K is the cumulant function of filtered shot noise (Campbell) and
    of the Gaussian. Lines s tilt it toward the thresholds (Daniels 1954), so that far tails keep their digits. E[x'²|x]
    p(x) has the transform K_vv exp K. The cross term K_v is the integral of a derivative along a pulse, which is zero.

    Parameters
    ----------
    noise, peak : rms of the amplifier's noise, and its integration time over τ
    """
    sigma = math.sqrt(noise**2 + pulses * cumulants(apd)[1] * peak**2 / 4.0)
    end = math.e * tail_per_electron(apd.gain, apd.ionisation_ratio) / peak
    span = 1.2 * float(T[-1]) + 14.0 * sigma + 40.0 / end
    step = 2.0 ** math.ceil(math.log2(span / _GRID))
    jump, measure, steepness = _pulses(apd.gain, apd.ionisation_ratio, peak, step)
    measure, steepness = pulses * measure, pulses * steepness
    mean, total = float((measure * jump).sum()), float(measure.sum())
    spread = max(noise**2, (2.0 * step) ** 2)
    omega = 2.0 * math.pi * np.arange(_GRID // 2 + 1) / (_GRID * step)
    x = (np.arange(_GRID) - _GRID // 4) * step

    log_rate, nearest = np.full(T.shape, _NIL), np.full(T.shape, np.inf)
    s = 0.0
    for _ in range(_TILTS):
        tilt = np.exp(s * jump)
        tilted = measure * tilt
        K = 0.5 * spread * s**2 + float(tilted.sum()) - total - s * mean
        centre = spread * s + float((tilted * jump).sum()) - mean
        deviation = math.sqrt(spread + float((tilted * jump**2).sum()))
        transform = _transform(tilted)
        transform -= transform[0].real + spread * (0.5 * omega**2 + 1j * omega * s) - 1j * omega * mean
        transform = np.exp(transform)
        density, flow = _inverse(transform), _inverse(transform * (noise**2 + _transform(steepness * tilt)))
        sure = (density > 1e-13 * density.max()) & (flow > 1e-13 * flow.max())
        log = np.full(_GRID, _NIL)
        log[sure] = 0.5 * np.log(density[sure] * flow[sure] / (2.0 * math.pi * step**2)) + K - s * x[sure]
        distance = np.abs(T - centre) / deviation
        nearer = distance < nearest
        log_rate[nearer], nearest[nearer] = np.interp(T[nearer], x, np.maximum(log, _NIL)), distance[nearer]
        if centre > T[-1] or s >= _STEEPEST * end:
            break
        s = min(s + 4.0 / deviation, _STEEPEST * end)
    return log_rate


def _transform(values: np.ndarray) -> np.ndarray:
    """Return the Fourier transform of values at −1, 0, 1, ... steps of amplitude, on the frequencies of the grid."""
    from scipy import fft

    folded = np.concatenate([values, np.zeros(-len(values) % _GRID)]).reshape(-1, _GRID).sum(axis=0)
    transform: np.ndarray = fft.rfft(np.roll(folded, -1))
    return transform


def _inverse(transform: np.ndarray) -> np.ndarray:
    """Return the inverse of `_transform`, from a quarter of the grid below zero on."""
    from scipy import fft

    inverse: np.ndarray = np.roll(fft.irfft(transform, _GRID), _GRID // 4)
    return inverse
