"""Sampling and conversion: some steps of each row become counts, of one channel or of two with different gains.

Everywhere `amplitude` (row, step) is in electrons; `row` and `first` (trace) are row and step of a trace's first sample.
"""

import numpy as np

from rso_lidar.detector.settings.readout import Readout
from rso_lidar.detector.stages.alias_tables import (
    NORMAL_PER_SIGMA,
    NORMAL_ZERO,
    AliasTable,
    build_normal_table,
    draw_from_table,
)
from rso_lidar.detector.stages.time_axis import Rows
from rso_lidar.kernels import kernel, packed
from rso_lidar.philox import draw_key, fill_row


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
    offset_counts : (trace) offset of the pixel
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
    offset_counts : (trace) baseline, and what a pixel adds to it
    counts : (trace, sample) written
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
    """Return the converter's output [counts], baseline included, of any amplitude [electrons]; float32."""
    counts = amplitude * np.float32(1.0 / readout.electrons_per_count)
    counts = counts + np.asarray(offset_counts + readout.baseline_counts, np.float32)
    if readout.quantised:
        np.rint(counts, out=counts)
    np.clip(counts, 0.0, float(readout.full_scale_counts), out=counts)
    result: np.ndarray = counts.astype(np.float32, copy=False)
    return result


def merge_low_gain(
    readout: Readout,
    amplitude: np.ndarray,
    rows: Rows,
    row: np.ndarray,
    first: np.ndarray,
    per_sample: int,
    offset_counts: np.ndarray,
    counts: np.ndarray,
    rng: np.random.Generator,
) -> np.ndarray:
    """Replace clipped samples by those of the low-gain channel, on the scale of the first; return which clip in both.

    A pixel's offset is taken as that of its input, common to both channels.

    Parameters
    ----------
    offset_counts : (trace) offset of the pixel
    counts : (trace, sample) of the first channel, changed in place
    """
    low = readout.low_gain
    assert low is not None
    clipped = np.zeros(counts.shape, bool)
    merge_rows(
        packed(amplitude, np.float32),
        packed(row, np.int64),
        packed(first, np.int64),
        int(per_sample),
        (draw_key(rng), packed(rows.pixel[row], np.int64), packed(rows.start[row] + first, np.int64)),
        build_normal_table(),
        np.float32(readout.full_scale_counts),
        np.float32(1.0 / (readout.electrons_per_count * low.ratio)),
        (offset_counts / low.ratio + readout.baseline_counts).astype(np.float32),
        np.float32(low.noise_counts),
        np.float32(2**low.adc_bits - 1),
        np.float32(low.ratio),
        np.float32(readout.baseline_counts),
        bool(readout.quantised),
        counts,
        clipped,
    )
    return clipped


@kernel
def merge_rows(
    amplitude: np.ndarray,
    row: np.ndarray,
    first: np.ndarray,
    per_sample: int,
    address: tuple[np.ndarray, np.ndarray, np.ndarray],
    table: AliasTable,
    full_scale: np.float32,
    counts_per_electron: np.float32,
    offset_counts: np.ndarray,
    noise_counts: np.float32,
    low_full_scale: np.float32,
    ratio: np.float32,
    baseline: np.float32,
    quantised: bool,
    counts: np.ndarray,
    clipped: np.ndarray,
) -> None:
    """Replace the clipped samples of each trace.

    Parameters
    ----------
    address : key, pixel (trace) and first step since emission (trace) of the random words
    offset_counts : (trace) baseline and offset there [its counts]
    noise_counts : rms noise there [its counts]
    baseline : of both channels [counts]
    counts : (trace, sample) of the first channel, changed in place
    clipped : (trace, sample), written where both channels clip
    """
    key, pixel, start = address
    columns_log2, cells, first_value = table
    n = counts.shape[1]
    words = np.empty(-(-n // 4) * 4, np.uint32)
    for trace in range(len(counts)):
        drawn = False
        for sample in range(n):
            if counts[trace, sample] < full_scale:
                continue
            if not drawn:
                fill_row(key, start[trace], pixel[trace], 0, words)
                drawn = True
            normal = draw_from_table(words[sample], columns_log2, cells, 0, first_value[0]) - NORMAL_ZERO
            noise = noise_counts * np.float32(normal) / np.float32(NORMAL_PER_SIGMA)
            electrons = amplitude[row[trace], first[trace] + sample * per_sample]
            level = electrons * counts_per_electron + offset_counts[trace] + noise
            if quantised:
                level = np.rint(level)
            clipped[trace, sample] = level >= low_full_scale
            counts[trace, sample] = (min(max(level, np.float32(0.0)), low_full_scale) - baseline) * ratio + baseline
