"""The matched filter: place and height of a pulse of known shape among samples with the amplifier's noise."""

from __future__ import annotations

import math
from threading import Lock
from typing import NamedTuple

import numpy as np

from rso_lidar.detector.ranging.pulse import Pulse, noise_covariance

# Places within a sample at which the filter has templates; between them the fit is linear.
PHASES = 64
# Reach of the window [FWHM]: a second pulse two FWHM away has almost no weight in it.
_REACH_FWHM = 1.5
ROUNDS, ROUNDS_CLIPPED = 3, 8
# Share of the peak from which a sample belongs to the pulse.
_IN_PULSE = 1e-3
# Height and place are separable where 1 - (their correlation)² is above this.
_SEPARABLE = 1e-6
# Share of white noise in the model: without it, finely sampled noise would be predictable without error.
_WHITE_SHARE = 3e-3
# Patterns that are kept: each has 13 kB of weights for a window of 13. One more, and the others are dropped.
_MOST_KEPT = 1024


CODE, CODES_BEFORE, IS_IN_PULSE = range(3)  # rows of `Matched.codes`


class Known(NamedTuple):
    """Weights of patterns of samples, in ascending order of their keys.

    Parameters
    ----------
    keys : (pattern) the codes of the samples used, combined by xor
    weights : (pattern, phase, 2, sample) float64; they give height, and height times shift [samples]
    """

    keys: np.ndarray
    weights: np.ndarray


class Matched:
    """The matched filter of a pulse in amplifier noise: weights that fit its height and place to the samples about it.

    Gauss-Newton on x = A s(t - q): weights of generalised least squares, for every 64th of a sample and every pattern of
    samples that count. Its optimum is the maximum of the likelihood.
    """

    def __init__(self, pulse: Pulse, sample_s: float, pole_s: float, white_share: float) -> None:
        """Tabulate the filter.

        Parameters
        ----------
        pole_s : time constant of the amplifier, which colours the noise [s]
        white_share : variance of the white noise over that of the coloured
        """
        self.pulse, self.sample_s = pulse, sample_s
        self.fwhm = pulse.fwhm_s / sample_s
        self.half = max(2, math.ceil(_REACH_FWHM * self.fwhm))
        self.width = 2 * self.half + 1
        self.lead = pulse.peak_s / sample_s  # samples from the nominal delay to the peak
        covariance = noise_covariance(self.width, sample_s, pole_s, 1.0)
        self._covariance = covariance + white_share * np.eye(self.width)
        phase = (np.arange(PHASES) - PHASES // 2) / PHASES
        time_s = (np.arange(self.width) - self.half - phase[:, None]) * sample_s + pulse.peak_s
        self._shape: np.ndarray = pulse.amplitude(time_s) / pulse.peak
        self._slope: np.ndarray = -pulse.slope(time_s) * (sample_s / pulse.peak)
        self.in_pulse = self._shape[PHASES // 2] >= _IN_PULSE
        self.codes = _codes(self.width, self.in_pulse)
        self._learning = Lock()
        self._known: Known | None = None

    @staticmethod
    def of(pulse: Pulse, sample_s: float, pole_s: float, sigma_counts: float) -> Matched:
        """Return the filter for a pulse in noise.

        Parameters
        ----------
        sample_s, pole_s : time between samples and τ of the amplifier's poles [s]
        sigma_counts : rms of the noise [counts]. Rounding to whole counts adds white noise of 1/12 count²
        """
        white_share = max(_WHITE_SHARE, 1.0 / (12.0 * max(float(sigma_counts), 1e-3) ** 2))
        return Matched(pulse, float(sample_s), float(pole_s), white_share)

    def curve(self, n: int, place: np.ndarray) -> np.ndarray:
        """Return the pulse of unit peak (row, n) that peaks at `place` (row) [samples]."""
        time_s = (np.arange(n) - place[:, None]) * self.sample_s + self.pulse.peak_s
        curve: np.ndarray = (self.pulse.amplitude(time_s) / self.pulse.peak).astype(np.float32)
        return curve

    def solve_weights(self, used: np.ndarray) -> np.ndarray:
        """Return the weights (phase, 2, width) that give height and height times shift [samples] from `used` samples."""
        weights = np.zeros((PHASES, 2, self.width))
        if np.count_nonzero(used & self.in_pulse) >= 2:
            jacobian = np.stack([self._shape[:, used], self._slope[:, used]], axis=1)
            # One factorisation for all phases: `solve` would repeat it for each matrix of right-hand sides.
            sides = jacobian.transpose(2, 0, 1).reshape(jacobian.shape[2], -1)
            whitened = np.linalg.solve(self._covariance[np.ix_(used, used)], sides)
            whitened = whitened.reshape(-1, *jacobian.shape[:2]).transpose(1, 0, 2)
            information = np.einsum("pik,pkj->pij", jacobian, whitened)
            # Where height and place are not separable, as in a tail, there is nothing to fit.
            scale = information[:, 0, 0] * information[:, 1, 1]
            separable = np.flatnonzero(scale - information[:, 0, 1] ** 2 > _SEPARABLE * scale)
            inverse = np.linalg.inv(information[separable])
            weights[np.ix_(separable, np.arange(2), np.flatnonzero(used))] = np.einsum(
                "pij,pkj->pik", inverse, whitened[separable]
            )
        return weights.astype(np.float32)

    def known(self) -> Known:
        """Return the patterns whose weights were requested, or that of all samples."""
        return self._known or self.learn(np.ones((1, self.width), bool))

    def learn(self, patterns: np.ndarray) -> Known:
        """Solve the weights of patterns that are not known yet.

        What was handed out before stays as it is.

        Parameters
        ----------
        patterns : (pattern, width) bool, the samples that count

        Returns
        -------
        All patterns that are kept, these among them. Where that makes too many, the others are dropped.
        """
        keys, first = np.unique(
            np.bitwise_xor.reduce(np.where(patterns, self.codes[CODE, 1:], 0), axis=1), return_index=True
        )
        with self._learning:
            known = self._known
            if known is None or len(np.union1d(known.keys, keys)) > _MOST_KEPT:
                known = Known(np.zeros(0, np.int64), np.empty((0, PHASES, 2, self.width)))
            new = ~np.isin(keys, known.keys)
            if new.any():
                weights = np.stack([self.solve_weights(patterns[row]) for row in first[new]])
                place = np.searchsorted(known.keys, keys[new])
                known = Known(np.insert(known.keys, place, keys[new]), np.insert(known.weights, place, weights, axis=0))
            self._known = known
            return known

    def pattern_at(self, place: float, clipped: np.ndarray | None, n: int) -> np.ndarray:
        """Return which samples (width) of a window about a place count.

        Those outside the trace do not, nor do clipped ones, unless they leave fewer than three in the pulse.

        Parameters
        ----------
        place : middle of the window [samples]
        clipped : (sample) samples at the rail, None without
        n : samples of the trace
        """
        middle = min(max((round(place * PHASES) + PHASES // 2) // PHASES, 0), n - 1)
        sample = np.arange(self.width) + middle - self.half
        inside: np.ndarray = (sample >= 0) & (sample < n)
        if clipped is None or not clipped.any():
            return inside
        used: np.ndarray = inside & ~clipped[np.clip(sample, 0, n - 1)]
        return used if np.count_nonzero(used & self.in_pulse) >= 3 else inside

    def height_weights(self) -> np.ndarray:
        """Return the weights (width) that give the height of a pulse whose place is known: the middle of the window."""
        shape = self._shape[PHASES // 2]
        whitened = np.linalg.solve(self._covariance, shape)
        weights: np.ndarray = whitened / float((whitened * shape).sum())
        return weights

    @property
    def crossings_per_s(self) -> float:
        """Rate at which the height fitted to noise alone passes zero upward along a trace [1/s].

        Rice's nu_0 = √(−R''(0)/R(0)) / 2π, with s'ᵀC⁻¹s' / sᵀC⁻¹s for the ratio, s' the slope of the pulse s.
        """
        shape, slope = self._shape[PHASES // 2], self._slope[PHASES // 2]
        heights = float((shape * np.linalg.solve(self._covariance, shape)).sum())
        slopes = float((slope * np.linalg.solve(self._covariance, slope)).sum())
        return math.sqrt(slopes / heights) / (2.0 * math.pi * self.sample_s)


def _codes(width: int, in_pulse: np.ndarray) -> np.ndarray:
    """Return, for sample k of a window in column k + 1: its code, the codes up to it combined, and if it is in the pulse.

    The code is a separate bit for each sample. Windows of more samples than an integer has bits get random words,
    whose combinations differ almost certainly (Zobrist 1970).
    """
    words = np.random.Generator(np.random.Philox(width)).integers(1, 2**62, width)
    codes = np.zeros((3, width + 1), np.int64)
    codes[CODE, 1:] = 1 << np.arange(width) if width < 63 else words
    codes[CODES_BEFORE, 1:] = np.bitwise_xor.accumulate(codes[CODE, 1:])
    codes[IS_IN_PULSE, 1:] = in_pulse
    return codes
