"""Triggers on nothing: when noise first crosses a pixel's threshold, and what the pixel stores of it.

Dark pixels are most of a frame; they are not simulated step by step, their false triggers are drawn from their rate.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar import units
from rso_lidar.detector.noise import false_alarm_rate, noise_rms

if TYPE_CHECKING:
    from rso_lidar.detector.gsfl import Gsfl


def rates_per_s(gsfl: Gsfl, threshold: np.ndarray, base_per_s: np.ndarray) -> np.ndarray:
    """Return how often noise crosses each pixel's threshold [electrons] upward, a second of being armed."""
    rates: np.ndarray = false_alarm_rate(
        threshold,
        apd=gsfl.apd,
        rate_per_s=base_per_s,
        noise_electrons=gsfl.amplifier.noise_electrons,
        pole_s=gsfl.amplifier.pole_s,
        integration_s=gsfl.amplifier.integration_s,
    )
    return rates


@lru_cache(maxsize=8)
def _kept_rates(gsfl: Gsfl, threshold: bytes, base_per_s: bytes) -> np.ndarray:
    return rates_per_s(gsfl, np.frombuffer(threshold), np.frombuffer(base_per_s))


def first_false_s(gsfl: Gsfl, threshold: np.ndarray, base_per_s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return when noise first triggers each pixel [s since emission]: an exponential waiting time after arming."""
    waiting = rng.standard_exponential(len(threshold))
    rates = _kept_rates(gsfl, threshold.tobytes(), base_per_s.tobytes())
    with np.errstate(divide="ignore"):
        waiting /= rates
    first: np.ndarray = gsfl.armed_from_m / units.RANGE_PER_DELAY_M_S + waiting
    return first


def false_traces(
    gsfl: Gsfl,
    crossing_s: np.ndarray,
    threshold: np.ndarray,
    base_per_s: np.ndarray,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Return what is stored of noise that crosses its threshold upward at `crossing_s`: amplitudes and first samples.

    Given value and slope at an upcrossing, the slope Rayleigh-distributed, Gaussian noise is their regression and a rest
    that they say nothing about (Slepian 1963; Leadbetter, Lindgren and Rootzén 1983, chapter 10).
    """
    readout, amplifier = gsfl.readout, gsfl.amplifier
    pole_s, correlation = amplifier.pole_s, amplifier.correlation
    sigma = noise_rms(gsfl.apd, base_per_s, amplifier.noise_electrons, pole_s, amplifier.integration_s)
    first = np.floor(crossing_s / readout.sample_s).astype(np.int64) - readout.pretrigger_samples
    slope = rng.rayleigh(1.0, len(crossing_s))
    white = rng.standard_normal((len(crossing_s), readout.samples))
    amplitude = np.zeros((len(crossing_s), readout.samples), np.float32)
    for row in range(len(crossing_s)):
        lag = (first[row] + np.arange(readout.samples)) * readout.sample_s - crossing_s[row]
        x = lag / pole_s
        value, rise = correlation(lag), x * np.exp(-np.abs(x))
        rest = correlation(lag[:, None] - lag) - np.multiply.outer(value, value) - np.multiply.outer(rise, rise)
        root = np.linalg.cholesky(rest + 1e-9 * np.eye(len(x)))  # rounding may leave it a hair below zero
        noise = (root * white[row]).sum(axis=1)
        amplitude[row] = threshold[row] * value + sigma[row] * (slope[row] * rise + noise)
    return amplitude, first
