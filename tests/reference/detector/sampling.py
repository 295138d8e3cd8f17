"""Sampling in NumPy: the oracle of `rso_lidar.detector.stages.sampling`."""

import numpy as np

from rso_lidar.detector.stages.alias_tables import NORMAL_PER_SIGMA, NORMAL_ZERO, build_normal_table
from rso_lidar.detector.stages.sampling import convert
from rso_lidar.philox import draw_key
from tests.reference.detector.alias_tables import look_up
from tests.reference.philox import rows as draw_rows


def store_samples(readout, amplitude, row, first, per_sample, n, offset_counts):
    """Return `n` samples (trace, sample) [counts], converted: every `per_sample`th step of each `row` from `first` on."""
    step = first[:, None] + per_sample * np.arange(n)
    return convert(readout, np.take_along_axis(amplitude[row], step, axis=1), offset_counts[:, None])


def merge_low_gain(readout, amplitude, rows, row, first, per_sample, offset_counts, counts, rng):
    """Return counts with clipped samples replaced, and which samples (trace, sample) clip in both channels."""
    low, n = readout.low_gain, counts.shape[1]
    words = draw_rows(draw_key(rng), rows.start[row] + first, rows.pixel[row], 0, -(-n // 4) * 4)[:, :n]
    normal = (look_up(build_normal_table(), words) - NORMAL_ZERO) / NORMAL_PER_SIGMA
    step = first[:, None] + per_sample * np.arange(n)
    seen = np.take_along_axis(amplitude[row], step, axis=1) / (readout.electrons_per_count * low.ratio)
    seen = seen + offset_counts[:, None] / low.ratio + readout.baseline_counts + low.noise_counts * normal
    seen = np.rint(seen) if readout.quantised else seen
    top = 2**low.adc_bits - 1
    over = counts >= readout.full_scale_counts
    scaled = (np.clip(seen, 0, top) - readout.baseline_counts) * low.ratio + readout.baseline_counts
    return np.where(over, scaled, counts), over & (seen >= top)
