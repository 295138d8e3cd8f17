"""Peaks of many traces in NumPy: the oracle of `rso_lidar.detector.ranging.peaks`."""

import numpy as np


def raise_to_highest(samples: np.ndarray, peak: np.ndarray) -> np.ndarray:
    """Return the highest of each peak and its two neighbours."""
    row, last = np.arange(len(samples)), samples.shape[1] - 1
    near = np.stack([peak, np.maximum(peak - 1, 0), np.minimum(peak + 1, last)])
    highest: np.ndarray = near[samples[row, near].argmax(axis=0), row]
    return highest


def locate_vertices(samples: np.ndarray, peak: np.ndarray) -> np.ndarray:
    """Return how far the parabola through a peak and its neighbours has its vertex behind the peak [samples]."""
    row = np.arange(len(samples))
    middle = np.clip(peak, 1, samples.shape[1] - 2)
    left, top, right = (samples[row, middle + k].astype(float) for k in (-1, 0, 1))
    bend = left - 2.0 * top + right
    shift = np.divide(0.5 * (left - right), bend, out=np.zeros_like(bend), where=bend < 0.0)
    return np.where(middle == peak, np.clip(shift, -1.0, 1.0), 0.0)
