"""Sampling in NumPy: the oracle of `rso_lidar.detector.stages.sampling`."""

import numpy as np

from rso_lidar.detector.stages.sampling import convert


def store_samples(readout, amplitude, row, first, per_sample, n, offset_counts):
    """Return `n` samples (trace, sample) [counts], converted: every `per_sample`th step of each `row` from `first` on."""
    step = first[:, None] + per_sample * np.arange(n)
    return convert(readout, np.take_along_axis(amplitude[row], step, axis=1), offset_counts[:, None])
