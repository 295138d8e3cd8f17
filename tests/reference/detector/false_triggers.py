"""Noise from a known moment on in NumPy: the oracle of `rso_lidar.detector.stages.false_triggers`."""

import numpy as np


def noise_factors(lag: np.ndarray | float) -> tuple[np.ndarray | float, ...]:
    """Return what a lag [poles] does to noise behind two poles, as factors: what is left, and what is new.

    The decay; the first pole's share in the second; the rms that the first gains; what the second gains along with it, and
    alone.
    """
    decay = np.exp(-lag)
    rms = np.sqrt(np.maximum(-2.0 * np.expm1(-2.0 * lag), 1e-30))
    with_it = (1.0 - decay**2 * (1.0 + 2.0 * lag)) / rms
    value = 1.0 - decay**2 * (1.0 + 2.0 * lag + 2.0 * lag**2)
    return decay, lag * decay, rms, with_it, np.sqrt(np.maximum(value - with_it**2, 0.0))


def draw_onward(value, slope, first_lag, lag, n, rng):
    """Draw n samples (trace, sample) of noise behind two poles that has this value and slope before them."""
    samples, white = np.empty((n, len(value))), rng.standard_normal((n, 2, len(value)))
    between, later, halfway = noise_factors(first_lag), noise_factors(lag), value + slope
    for sample, (one, other) in zip(samples, white, strict=True):
        decay, driven, rms, with_it, alone = between
        sample[:] = decay * value + driven * halfway + with_it * one + alone * other
        halfway = decay * halfway + rms * one
        value, between = sample, later
    return samples.T
