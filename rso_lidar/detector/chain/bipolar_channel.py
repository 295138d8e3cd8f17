"""The timing channel of pixels that have latched: when the bipolar pulse of each crosses zero."""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.detector.chain.analog import Analog
from rso_lidar.detector.ranging.bipolar_pulse import differentiate, find_zero_crossings
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.stages.amplification import amplify, build_filters
from rso_lidar.detector.stages.row_noise import AMPLIFIER, RowNoise
from rso_lidar.parallel import run_in_threads

_ROWS_AT_ONCE = 1024


def time_crossings(
    gsfl: Gsfl,
    made: Analog,
    row: np.ndarray,
    latch: np.ndarray,
    step_s: float,
    rng: np.random.Generator,
    threads: int | None = 1,
) -> np.ndarray:
    """Return when (trace) the bipolar pulses of some rows cross zero [s since emission], NaN where they do not arm.

    Signal and shot noise are those of the sampled channel. The noise of this channel's amplifier is drawn apart, behind the
    differentiator, which comes before it.

    Parameters
    ----------
    gsfl : the detector, with a zero-crossing discriminator.
    made : the analog signals of all rows.
    row, latch : (trace) row, and where its comparator latched [steps].
    step_s : length of a step [s].
    rng : random generator.
    threads : number of threads (None: one for each core). The result is the same to the bit.
    """
    settings, still, rows = gsfl.zero_crossing, made.still, made.rows
    assert settings is not None
    assert still is not None
    n = rows.length
    quiet = build_filters(gsfl.amplifier.replace(noise_electrons=0.0), n, step_s)
    noisy = build_filters(gsfl.amplifier.replace(noise_electrons=settings.noise_electrons), n, step_s)
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
