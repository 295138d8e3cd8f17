"""Sampling and conversion: some steps of each row become counts."""

import numpy as np

from rso_lidar.detector.settings.readout import Readout
from rso_lidar.kernels import kernel, packed


def store_samples(
    readout: Readout,
    amplitude: np.ndarray,
    row: np.ndarray,
    first: np.ndarray,
    per_sample: int,
    n: int,
    offset_counts: np.ndarray,
) -> np.ndarray:
    """Return `n` samples (trace, sample) [counts], converted: every `per_sample`th step of each `row` from `first` on.

    Parameters
    ----------
    readout : the converter.
    amplitude : (row, step) [electrons].
    row, first : (trace) row and step of the first sample.
    per_sample, n : steps from sample to sample, and samples of a trace.
    offset_counts : (trace) offset of the pixel.
    """
    counts = np.empty((len(row), n), np.float32)
    stored = sample_rows(
        packed(amplitude, np.float32),
        packed(row, np.int64),
        packed(first, np.int64),
        int(per_sample),
        np.float32(1.0 / readout.electrons_per_count),
        (offset_counts + readout.baseline_counts).astype(np.float32),
        np.float32(readout.full_scale_counts),
        bool(readout.quantised),
        counts,
    )
    assert stored == len(row), "samples: some are outside their rows"
    return counts


@kernel
def sample_rows(
    amplitude: np.ndarray,
    row: np.ndarray,
    first: np.ndarray,
    per_sample: int,
    counts_per_electron: np.float32,
    offset_counts: np.ndarray,
    full_scale: np.float32,
    quantised: bool,
    counts: np.ndarray,
) -> int:
    """Sample and convert rows; return how many traces were filled before one that reaches beyond its row.

    Parameters
    ----------
    amplitude : (row, step) [electrons].
    row, first : (trace) row and step of the first sample.
    per_sample : steps from sample to sample.
    counts_per_electron : scale of the converter.
    offset_counts : (trace) baseline, and what a pixel adds to it.
    full_scale : greatest count.
    quantised : whether counts are whole.
    counts : (trace, sample) written.

    Returns
    -------
    number of traces filled.
    """
    for trace in range(counts.shape[0]):
        last = first[trace] + (counts.shape[1] - 1) * per_sample
        if first[trace] < 0 or last >= amplitude.shape[1]:
            return trace
        for sample in range(counts.shape[1]):
            electrons = amplitude[row[trace], first[trace] + sample * per_sample]
            count = electrons * counts_per_electron + offset_counts[trace]
            if quantised:
                count = np.rint(count)
            counts[trace, sample] = min(max(count, np.float32(0.0)), full_scale)
    return len(counts)


def convert(readout: Readout, amplitude: np.ndarray, offset_counts: np.ndarray | float = 0.0) -> np.ndarray:
    """Return the converter's output [counts], baseline included; float32.

    Parameters
    ----------
    readout : the converter.
    amplitude : [electrons], any shape.
    offset_counts : offset of the pixel.
    """
    counts = amplitude * np.float32(1.0 / readout.electrons_per_count)
    counts = counts + np.asarray(offset_counts + readout.baseline_counts, np.float32)
    if readout.quantised:
        np.rint(counts, out=counts)
    np.clip(counts, 0.0, float(readout.full_scale_counts), out=counts)
    result: np.ndarray = counts.astype(np.float32, copy=False)
    return result
