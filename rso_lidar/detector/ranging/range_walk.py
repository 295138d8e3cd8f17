"""Range walk: the error of a range algorithm at each amplitude, computed beforehand and subtracted."""

from __future__ import annotations

import numpy as np

from rso_lidar.detector.ranging.location import Locator, locate


def tabulate_walk(locator: Locator, full_scale_counts: float) -> tuple[np.ndarray, np.ndarray]:
    """Tabulate the walk of an algorithm with pulses without noise, each at 32 phases of the sampling.

    Heights go from just above the threshold to 200 times it, or half as much again as clips, and are clipped at the rail.

    Returns
    -------
    Fitted amplitudes [counts], ascending, and the mean bias of the delay at each [s].
    """
    matched, threshold_counts = locator.matched, locator.threshold_counts
    most = max(200.0, 1.5 * full_scale_counts / threshold_counts)
    truth = np.geomspace(1.02, most, 64) * threshold_counts
    place = matched.half + 4 + (np.arange(32) + 0.5) / 32
    samples = truth[:, None, None].astype(np.float32) * matched.curve(2 * matched.half + 10, place)
    samples = np.minimum(samples, np.float32(full_scale_counts)).reshape(-1, samples.shape[-1])
    clipped = samples >= full_scale_counts
    latched = (samples >= min(threshold_counts, full_scale_counts)).argmax(axis=1)
    start = np.where(latched > 0, latched, matched.half + 4)
    delay_s, amplitude = locate(samples, start, locator, clipped if clipped.any() else None)
    bias_s = delay_s.reshape(len(truth), -1) - (place - matched.lead) * matched.sample_s
    measured = amplitude.reshape(len(truth), -1).mean(axis=1)
    # Far beyond the rail the fit fails and the amplitude decreases: only the ascending part is a calibration.
    rising = np.append(True, measured[1:] > np.maximum.accumulate(measured)[:-1]) & np.isfinite(bias_s).any(axis=1)
    return measured[rising], np.nanmean(bias_s[rising], axis=1)


def correct_walk(delay_s: np.ndarray, amplitude_counts: np.ndarray, table: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Return delays [s] without the bias that calibration found at their amplitude, interpolated in its logarithm."""
    amplitudes, bias_s = table
    place = np.log(np.maximum(amplitude_counts, 0.5 * amplitudes[0]))
    corrected: np.ndarray = delay_s - np.interp(place, np.log(amplitudes), bias_s)
    return corrected
