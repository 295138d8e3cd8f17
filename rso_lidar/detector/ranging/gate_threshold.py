"""Threshold of a range gate: what filtered noise, avalanches included, exceeds with a given probability.

Behind the matched filter one primary electron is a pulse g(t) of counts; in the mean of M flashes it is g/M. The noise of
amplifier and rounding is Gaussian. Dark current and sunlight are compound Poisson, with McIntyre's avalanches as marks. So
the logarithm of the statistic's characteristic function is

    M r ∫ [φ(ω g(t)/M) − 1 − i ω g(t) μ/M] dt − ω² σ²/(2M).

Here r is the rate of primaries; φ and μ are the characteristic function and mean of one avalanche (Campbell's theorem; Rice
1944). The inverse is the density p. The gate sees the statistic above T at its start, or crossing it upward. Crossings
come at the rate √(2π) σ ν₀ p(T), which for Gaussian noise is Rice's formula.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial

import numpy as np

from rso_lidar.detector.ranging.matched_filter import Matched
from rso_lidar.detector.ranging.pulse import noise_covariance
from rso_lidar.detector.settings.amplifier import Amplifier
from rso_lidar.detector.settings.apd import Apd, cumulants
from rso_lidar.detector.settings.gate import Gate
from rso_lidar.detector.settings.readout import Readout
from rso_lidar.detector.stages.avalanche import mcintyre_pmf

_GRID = 8192  # points of the density, _FINE of them to a sigma
_FINE = 24.0
_LEVELS_PER_DECADE = 4
_LEAST_COUNTS = 1e-3


@dataclass(frozen=True, eq=False)
class GateThresholds:
    """Thresholds of the pixels under a gate, by the rate of their primaries.

    Parameters
    ----------
    gate : with the false-alarm probability
    apd, amplifier, readout : where the noise comes from
    matched : the filter
    offset_counts : spread of the baselines that no calibration has removed. Over the array it counts as noise
    """

    gate: Gate
    apd: Apd
    amplifier: Amplifier
    readout: Readout
    matched: Matched
    offset_counts: float = 0.0

    def solve(self, rate_per_s: np.ndarray) -> np.ndarray:
        """Return the amplitude (pixel) [counts] that noise exceeds with the gate's false-alarm probability.

        Parameters
        ----------
        rate_per_s : (pixel) primaries that no pulse makes [1/s]: dark current and sunlight
        """
        least, most = float(rate_per_s.min(initial=np.inf)), float(rate_per_s.max(initial=0.0))
        if least == most or not len(rate_per_s):
            return np.full(len(rate_per_s), self.at_rate(least))
        low, high = math.log10(max(least, 1.0)), math.log10(most)
        levels = np.linspace(low, high, max(2, math.ceil((high - low) * _LEVELS_PER_DECADE) + 1))
        known = [self.at_rate(float(10.0**level)) for level in levels]
        thresholds: np.ndarray = np.interp(np.log10(np.maximum(rate_per_s, 1.0)), levels, known)
        return thresholds

    @cached_property
    def at_rate(self) -> Callable[[float], float]:
        """The threshold [counts] of a pixel with one rate of primaries [1/s], kept for the latest rates."""
        return lru_cache(maxsize=256)(partial(_solve_threshold, self))


def _solve_threshold(given: GateThresholds, rate_per_s: float) -> float:
    """Return the threshold of a pixel with one rate of primaries that are not due to the pulse [counts]."""
    gate, apd, amplifier, readout, matched = given.gate, given.apd, given.amplifier, given.readout, given.matched
    weights = matched.height_weights()
    samples = np.arange(len(weights))
    per_count = readout.electrons_per_count
    colour = noise_covariance(len(weights), matched.sample_s, amplifier.pole_s, amplifier.noise_electrons / per_count)
    rounding = 1.0 / 12.0 if readout.quantised else 0.0
    gaussian = (
        float(np.einsum("i,ij,j", weights, colour, weights)) + rounding * float((weights**2).sum())
    ) / gate.pulses
    gaussian += (given.offset_counts * float(weights.sum())) ** 2  # the same in every pulse
    # One electron that arrives t before the last sample, as the filter sees it.
    step_s = amplifier.pole_s / 8.0
    time_s = np.arange(-(20.0 * amplifier.pole_s), samples[-1] * matched.sample_s, step_s)
    x = np.maximum(samples * matched.sample_s - time_s[:, None], 0.0) / amplifier.pole_s
    response = (x * np.exp(-x) * (amplifier.integration_s / amplifier.pole_s / per_count) * weights).sum(axis=1)
    response /= gate.pulses
    rate = rate_per_s * gate.pulses * step_s
    _, square, _ = cumulants(apd)
    sigma = math.sqrt(gaussian + rate * square * float((response**2).sum()))
    if sigma < _LEAST_COUNTS:
        return _LEAST_COUNTS * 4.0
    spacing = sigma / _FINE
    omega = 2.0 * math.pi * np.arange(_GRID // 2 + 1) / (_GRID * spacing)
    logarithm = -0.5 * omega**2 * gaussian + rate * _avalanches(response, spacing, apd)
    density = np.fft.irfft(np.exp(logarithm).conj(), _GRID) / spacing
    density = np.maximum(np.roll(density, _GRID // 2), 0.0)
    height = (np.arange(_GRID) - _GRID // 2) * spacing
    beyond = np.cumsum(density[::-1])[::-1] * spacing
    open_s = gate.n_samples(matched.sample_s) * matched.sample_s
    crossings = math.sqrt(2.0 * math.pi) * sigma * matched.crossings_per_s * open_s * density
    expected = beyond + crossings
    wanted = -math.log1p(-gate.false_alarm_probability)
    last = np.flatnonzero((expected >= wanted) & (height > 0.0))
    if not len(last):
        return 0.0
    if last[-1] + 1 >= _GRID:
        return float(height[-1])
    k = int(last[-1])
    above, below = math.log(expected[k]), math.log(max(float(expected[k + 1]), 1e-300))
    return float(height[k] + spacing * (above - math.log(wanted)) / max(above - below, 1e-12))


def _avalanches(one: np.ndarray, spacing: float, apd: Apd) -> np.ndarray:
    """Return Σ φ(ω g) − 1 − i ω g μ over the steps of a pulse, on the frequencies of the grid.

    Each jump of n g counts is shared among five neighbours on the grid so that its first four moments stay.

    Parameters
    ----------
    one : (step) pulse g of one electron [counts]
    spacing : of the grid [counts]
    """
    omega = 2.0 * math.pi * np.arange(_GRID // 2 + 1) / _GRID
    if apd.statistics == "gaussian":
        gaussian: np.ndarray = -0.5 * omega**2 * cumulants(apd)[1] * float((one**2).sum()) / spacing**2 + 0j
        return gaussian
    first, pmf = mcintyre_pmf(1, apd.gain, apd.ionisation_ratio)
    place = (np.multiply.outer(first + np.arange(len(pmf)), one) / spacing).ravel()
    weight = np.repeat(pmf, len(one))
    at = np.rint(place).astype(np.int64)
    f = place - at
    measure = np.zeros(_GRID)
    for step, share in (
        (-2, f * (f**2 - 1.0) * (f - 2.0) / 24.0),
        (-1, -f * (f - 1.0) * (f**2 - 4.0) / 6.0),
        (0, (f**2 - 1.0) * (f**2 - 4.0) / 4.0),
        (1, -f * (f + 1.0) * (f**2 - 4.0) / 6.0),
        (2, f * (f**2 - 1.0) * (f + 2.0) / 24.0),
    ):
        measure += np.bincount((at + step) % _GRID, share * weight, _GRID)
    mean = float((weight * place).sum())
    transform: np.ndarray = np.fft.rfft(measure).conj() - measure.sum() - 1j * omega * mean
    return transform
