"""The amplifier at work: charge becomes amplitude, with noise of the avalanche and of the amplifier itself."""

import math

import numpy as np

from rso_lidar.detector.settings.amplifier import Amplifier
from rso_lidar.detector.stages.alias_tables import (
    NORMAL_PER_SIGMA,
    NORMAL_ZERO,
    AliasTable,
    build_normal_table,
    draw_from_table,
)
from rso_lidar.kernels import kernel

_MEMORY_POLES = 16.0  # time constants: (1 + 16) exp(-16) is 2e-6


class Filters:
    """The amplifier on a circle of `n` steps of `step_s`: factors of the Fourier transform along time.

    `mean` is the response of the continuous amplifier, charge in a step to amplitude. White noise passes `taps` (steps
    after it), of which `shot` is the transform.

    Second moments are exact on the grid for any step. Sampled, (1 + |t|/τ) exp(−|t|/τ) is the autocorrelation of
    y[k] = 2a y[k−1] − a² y[k−2] + early x[k] + late x[k−1], with a = exp(−Δ/τ). White noise of `noise_electrons` a step,
    through the same taps as the shot noise, is the amplifier's own.

    First moments of the taps are not exact. Up to steps of 2.4 τ they agree with `mean`, 2τ late, to a quarter of a step.
    For longer steps, in which a pulse has no shape, they differ by less than a step.
    """

    def __init__(self, amplifier: Amplifier, n: int, step_s: float) -> None:
        """Compute responses and taps."""
        self.n, self.step_s = n, step_s
        self.frequency_hz = np.fft.rfftfreq(n, step_s)
        charge = amplifier.integration_s / step_s
        self.mean: np.ndarray = charge * amplifier.response(self.frequency_hz)
        x = step_s / amplifier.pole_s
        a = math.exp(-x)
        # Variance of early x[k] + late x[k-1], and its covariance from step to step.
        variance, covariance = 1.0 - a**4 - 4.0 * a**2 * x, a * (x * (1.0 + a**2) - (1.0 - a**2))
        total, apart = math.sqrt(variance + 2.0 * covariance), math.sqrt(variance - 2.0 * covariance)
        early, late = 0.5 * (total - apart), 0.5 * (total + apart)  # the other way around, it would run ahead of `mean`
        lag = np.arange(min(n, max(math.ceil(_MEMORY_POLES / x), 2)))  # `late` comes one step of any length later
        taps = a**lag * (lag + 1.0) * early + a ** np.maximum(lag - 1.0, 0.0) * lag * late
        taps *= charge * math.sqrt(0.25 * x)  # the integral of h² is 1/(4τ)
        self.taps: np.ndarray = taps.astype(np.float32)
        self.shot: np.ndarray = np.fft.rfft(taps, n).astype(np.complex64)
        # White noise before the taps whose rms after them is that of the amplifier.
        self.noise_electrons = np.float32(
            amplifier.noise_electrons * math.sqrt(4.0 * amplifier.pole_s * step_s) / amplifier.integration_s
        )


def amplify(
    filters: Filters,
    quiet: np.ndarray,
    excess: np.ndarray,
    gain: np.ndarray,
    words: np.ndarray,
    amplitude: np.ndarray,
) -> None:
    """Write the amplitude (row, step) [electrons] with noise, under the gain of each row.

    Parameters
    ----------
    quiet : (row, step) mean behind the amplifier [electrons]
    excess : (row, step) what the electrons before the amplifier are more than their mean [electrons]
    gain : (row) factor of both
    words : (row, step) random words of the amplifier's own noise
    amplitude : (row, step) float32, written
    """
    amplify_rows(quiet, excess, gain, filters.taps, filters.noise_electrons, build_normal_table(), words, amplitude)


@kernel
def amplify_rows(
    quiet: np.ndarray,
    excess: np.ndarray,
    gain: np.ndarray,
    taps: np.ndarray,
    noise_electrons: np.float32,
    table: AliasTable,
    words: np.ndarray,
    amplitude: np.ndarray,
) -> None:
    """Write the amplitude (row, step): the mean `quiet` and what `excess` and white noise become, times the row's gain.

    Parameters
    ----------
    quiet, excess : (row, step) mean behind the amplifier, and electrons above their mean before it
    gain : (row) factor of both
    words : (row, step) random words
    amplitude : (row, step), written
    """
    columns_log2, cells, first = table
    per_value, least = noise_electrons / np.float32(NORMAL_PER_SIGMA), first[0]
    n_rows, n = quiet.shape
    before = len(taps) - 1
    white = np.empty(before + n, np.float32)  # the row with its end before it: time runs in a circle
    for row in range(n_rows):
        strength, word = gain[row], words[row]
        more, mean, sum_of = excess[row], quiet[row], amplitude[row]
        now = white[before:]
        for step in range(n):
            normal = draw_from_table(word[step], columns_log2, cells, 0, least) - NORMAL_ZERO
            now[step] = per_value * np.float32(normal) + strength * more[step]
            sum_of[step] = strength * mean[step]
        for step in range(before):
            white[step] = white[n + step]
        for tap in range(0, len(taps) - 3, 4):  # four in one pass: the sums are read and written less often
            a, b, c, d = taps[tap], taps[tap + 1], taps[tap + 2], taps[tap + 3]
            earlier = white[before - tap - 3 : before - tap + n]
            for step in range(n):
                some = sum_of[step] + a * earlier[step + 3] + b * earlier[step + 2]
                sum_of[step] = some + c * earlier[step + 1] + d * earlier[step]
        for tap in range(len(taps) // 4 * 4, len(taps)):
            share, earlier = taps[tap], white[before - tap : before - tap + n]
            for step in range(n):
                sum_of[step] += share * earlier[step]
