"""The timing channel of pixels that have latched: when the bipolar pulse of each crosses zero."""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.detector.chain.analog import Analog
from rso_lidar.detector.chain.timing import TimeAxis
from rso_lidar.detector.ranging.bipolar_pulse import differentiate, find_zero_crossings
from rso_lidar.detector.settings.zero_crossing import ZeroCrossing
from rso_lidar.detector.stages.amplification import amplify
from rso_lidar.detector.stages.row_noise import AMPLIFIER, RowNoise
from rso_lidar.parallel import run_in_threads

_ROWS_AT_ONCE = 1024


def time_crossings(
    settings: ZeroCrossing,
    axis: TimeAxis,
    made: Analog,
    row: np.ndarray,
    latch: np.ndarray,
    rng: np.random.Generator,
    threads: int | None = 1,
) -> np.ndarray:
    """Return when (trace) the bipolar pulses of some rows cross zero [s since emission], NaN where they do not arm.

    Signal and shot noise are those of the sampled channel. The noise of this channel's amplifier is drawn apart, behind the
    differentiator, which comes before it.

    Parameters
    ----------
    made : the analog signals of all rows
    row, latch : (trace) row, and where its comparator latched [steps]
    threads : number of threads (None: one for each core). The result is the same to the bit
    """
    still, rows, step_s = made.still, made.rows, axis.step_s
    assert still is not None
    assert axis.timing is not None
    n, (quiet, noisy) = rows.length, axis.timing
    noise = RowNoise.of(rows, rng)
    crossing = np.empty(len(row))

    def time_block(block: slice) -> None:
        some = row[block]
        signal, added = (np.empty((len(some), n), np.float32) for _ in range(2))
        nothing = np.zeros((len(some), n), np.float32)
        words = RowNoise(noise.key, noise.pixel[some], noise.start[some]).draw(AMPLIFIER, 1, n)[0]
        amplify(quiet, still.mean[some], still.excess[some], still.gain[some], words, signal)
        amplify(noisy, nothing, nothing, still.gain[some], words, added)
        bipolar = differentiate(signal, settings.differentiator_s, step_s)
        bipolar += added
        earliest = latch[block] - settings.hold_ns * units.NS / step_s
        crossing[block] = find_zero_crossings(settings, bipolar, earliest, step_s)

    run_in_threads(threads, time_block, [slice(k, k + _ROWS_AT_ONCE) for k in range(0, len(row), _ROWS_AT_ONCE)])
    crossing_s: np.ndarray = (rows.start[row] + crossing) * step_s
    return crossing_s
