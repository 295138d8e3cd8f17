"""Noise from a known moment on as a loop: sample by sample, trace by trace."""

import math

import numpy as np

from rso_lidar.arithmetic import loop


@loop
def gained(lag: float) -> tuple[float, float, float, float, float]:
    """Return what `false_triggers.gained` does, for one lag."""
    decay = math.exp(-lag)
    rms = math.sqrt(max(-2.0 * math.expm1(-2.0 * lag), 1e-30))
    with_it = (1.0 - decay * decay * (1.0 + 2.0 * lag)) / rms
    value = 1.0 - decay * decay * (1.0 + 2.0 * lag + 2.0 * lag * lag)
    return decay, lag * decay, rms, with_it, math.sqrt(max(value - with_it * with_it, 0.0))


@loop
def onward(
    value: np.ndarray, slope: np.ndarray, first_lag: np.ndarray, lag: float, white: np.ndarray, samples: np.ndarray
) -> None:
    """Fill `samples` (sample, trace) with noise that has a value and a slope before them, of `white` (sample, 2, trace)."""
    later = gained(lag)
    for trace in range(len(value)):
        between = gained(first_lag[trace])
        now, halfway = value[trace], value[trace] + slope[trace]
        for sample in range(len(samples)):
            decay, driven, rms, with_it, alone = between
            one, other = white[sample, 0, trace], white[sample, 1, trace]
            now = decay * now + driven * halfway + with_it * one + alone * other
            halfway = decay * halfway + rms * one
            samples[sample, trace] = now
            between = later
