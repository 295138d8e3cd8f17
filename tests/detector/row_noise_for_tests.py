"""Stages that draw noise, called with a generator: each row of an array is the row of another pixel."""

import numpy as np

from rso_lidar.detector.stages import amplification, avalanche
from rso_lidar.detector.stages.row_noise import AMPLIFIER, RowNoise
from rso_lidar.kernels import packed
from rso_lidar.philox import draw_key


def row_noise(rng, n_rows=1):
    """Return the addresses of rows that begin at step 0, under a key drawn from a generator."""
    return RowNoise(draw_key(rng), packed(np.arange(n_rows)), packed(np.zeros(n_rows, np.int64)))


def multiply(primaries, apd, rng, base=None, by=avalanche.multiply):
    """Draw electrons for primaries (row, step), or (step)."""
    n_rows = 1 if np.ndim(primaries) == 1 else len(primaries)
    return by(primaries, avalanche.build_avalanche(apd), row_noise(rng, n_rows), base)


def amplify(filters, quiet, excess, gain, rng, by=amplification.amplify):
    """Return amplitudes (row, step) with noise."""
    amplitude = np.empty(quiet.shape, np.float32)
    by(filters, quiet, excess, gain, row_noise(rng, len(quiet)).draw(AMPLIFIER, 1, filters.n)[0], amplitude)
    return amplitude
