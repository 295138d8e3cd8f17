"""Signals between the stages, over the stretches of time that are stored."""

from __future__ import annotations

import numpy as np

from rso_lidar.records import Taps


def cut_steps(signal: np.ndarray, row: np.ndarray, first: np.ndarray, n_steps: int) -> np.ndarray:
    """Return `n_steps` steps (trace, step) of some rows of a signal (row, step), NaN beyond the end of a row.

    Parameters
    ----------
    signal : (row, step)
    row, first : (trace) row and first step of each trace
    """
    step = first[:, None] + np.arange(n_steps)
    inside = step < signal.shape[1]
    cut: np.ndarray = np.where(inside, signal[row[:, None], np.where(inside, step, 0)], np.nan).astype(np.float32)
    return cut


def tap_stages(
    shape: tuple[int, int],
    step_s: float,
    *,
    pixel: np.ndarray,
    start_s: np.ndarray,
    threshold: np.ndarray,
    primaries: np.ndarray,
    amplitude: np.ndarray,
) -> Taps:
    """Return the record of signals between the stages, with the state of the comparators.

    Parameters
    ----------
    pixel, start_s, threshold : (trace) number of the pixel, beginning [s] and threshold [electrons]
    primaries, amplitude : (trace, step) expected photoelectrons, and output of the amplifier [electrons]
    """
    level = threshold[:, None]
    known = np.isfinite(amplitude) & np.isfinite(level)
    with np.errstate(invalid="ignore"):
        state = np.where(known, amplitude >= level, -1).astype(np.int8)
    return Taps(shape, step_s, pixel, start_s, threshold, primaries, amplitude, state)
