"""The matched filter: place and height of a pulse of known shape among samples with the amplifier's noise."""

from __future__ import annotations

import math
from functools import lru_cache
from threading import Lock
from typing import NamedTuple

import numpy as np

from rso_lidar.detector.pulse import Pulse, noise_covariance

# The matched filter's templates stand at so many places within a sample; between them the fit is linear.
PHASES = 64
# Samples this far from the peak are used, in FWHM: a second pulse two FWHM away hardly enters with any weight.
_REACH_FWHM = 1.5
ROUNDS, ROUNDS_CLIPPED = 3, 8
# A sample belongs to the pulse where the pulse has this share of its peak or more.
_IN_PULSE = 1e-3
# Height and place can be told apart where 1 - (their correlation)² is above this.
_TOLD_APART = 1e-6
# Share of white noise that is always reckoned with: without it, finely sampled noise could be foretold for ever.
_WHITE_SHARE = 3e-3
# So many patterns of samples are kept, 13 kB of weights each for a window of 13; one more, and the others are forgotten.
_MOST_KEPT = 1024


class Known(NamedTuple):
    """Patterns of samples whose weights are known: `masks`, a bit for each sample used, rising.

    `weights` (pattern, phase, 2, sample) give height and height times shift, as float64.
    """

    masks: np.ndarray
    weights: np.ndarray


class Matched:
    """The matched filter of a pulse in amplifier noise: weights that fit its height and place to the samples about it.

    Gauss-Newton on x = A s(t - q): weights of generalised least squares, for every 64th of a sample and every pattern of
    samples that count. Its optimum is the maximum of the likelihood.
    """

    def __init__(self, pulse: Pulse, sample_s: float, pole_s: float, white_share: float) -> None:
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
        self._in_pulse = self._shape[PHASES // 2] >= _IN_PULSE
        self._weights: dict[bytes, np.ndarray] = {}
        self._learning = Lock()
        self._known: Known | None = None

    @staticmethod
    def of(pulse: Pulse, sample_s: float, pole_s: float, sigma_counts: float) -> Matched:
        """Return the filter for this pulse and noise, kept; rounding to whole counts adds white noise of 1/12 count²."""
        return _matched(pulse, float(sample_s), float(pole_s), float(sigma_counts))

    def curve(self, n: int, place: np.ndarray) -> np.ndarray:
        """Return the pulse of unit peak (row, n) that peaks at `place` (row) [samples]."""
        time_s = (np.arange(n) - place[:, None]) * self.sample_s + self.pulse.peak_s
        curve: np.ndarray = (self.pulse.amplitude(time_s) / self.pulse.peak).astype(np.float32)
        return curve

    def weights(self, used: np.ndarray) -> np.ndarray:
        """Return the weights (phase, 2, width) that give height and height times shift [samples] from `used` samples."""
        key = used.tobytes()
        known = self._weights.get(key)
        if known is None:
            if len(self._weights) >= _MOST_KEPT:
                self._weights.clear()
            known = self._weights[key] = self._solved(used)
        return known

    def _solved(self, used: np.ndarray) -> np.ndarray:
        weights = np.zeros((PHASES, 2, self.width))
        if np.count_nonzero(used & self._in_pulse) >= 2:
            jacobian = np.stack([self._shape[:, used], self._slope[:, used]], axis=1)
            whitened = np.linalg.solve(self._covariance[np.ix_(used, used)], jacobian.transpose(0, 2, 1))
            information = np.einsum("pik,pkj->pij", jacobian, whitened)
            # Where height and place cannot be told apart, as in a tail, there is nothing to fit.
            scale = information[:, 0, 0] * information[:, 1, 1]
            told = np.flatnonzero(scale - information[:, 0, 1] ** 2 > _TOLD_APART * scale)
            inverse = np.linalg.inv(information[told])
            weights[np.ix_(told, np.arange(2), np.flatnonzero(used))] = np.einsum(
                "pij,pkj->pik", inverse, whitened[told]
            )
        return weights.astype(np.float32)

    @property
    def fits_in_a_word(self) -> bool:
        """Return whether a pattern of samples fits in the bits of an integer."""
        return self.width < 63

    @property
    def wanted(self) -> int:
        """Return the samples of the window in which a pulse has to show, one bit each."""
        return int((self._in_pulse * (1 << np.arange(self.width))).sum())

    def known(self) -> Known:
        """Return the patterns whose weights were asked for, or that of all samples."""
        return self._known or self.learn(np.array([(1 << self.width) - 1]))

    def learn(self, masks: np.ndarray) -> Known:
        """Return the patterns known, these among them; where that makes too many, the others are forgotten.

        What was handed out before stays as it is.
        """
        with self._learning:
            known = self._known
            if known is None or len(np.union1d(known.masks, masks)) > _MOST_KEPT:
                known = Known(np.zeros(0, np.int64), np.empty((0, PHASES, 2, self.width)))
            masks = np.setdiff1d(masks, known.masks)
            place = np.searchsorted(known.masks, masks)
            new = [self._solved((mask >> np.arange(self.width)) & 1 > 0) for mask in masks.tolist()]
            if new:
                known = Known(
                    np.insert(known.masks, place, masks), np.insert(known.weights, place, np.stack(new), axis=0)
                )
            self._known = known
            return known

    def height_weights(self) -> np.ndarray:
        """Return the weights (width) that give the height of a pulse whose place is known: the middle of the window."""
        shape = self._shape[PHASES // 2]
        whitened = np.linalg.solve(self._covariance, shape)
        weights: np.ndarray = whitened / float((whitened * shape).sum())
        return weights

    def statistic(self, samples: np.ndarray) -> np.ndarray:
        """Return the fitted height of a pulse that would peak at each sample; float32, what is outside counts as zero."""
        n = samples.shape[1]
        padded = np.pad(samples, ((0, 0), (self.half, self.half)))
        total = np.zeros(samples.shape, np.float32)
        for k, weight in enumerate(self.height_weights()):
            total += np.float32(weight) * padded[:, k : k + n]
        return total

    @property
    def crossings_per_s(self) -> float:
        """Return how often a second the height fitted to noise alone passes zero upward, as a function of the place.

        Rice's nu_0 = √(−R''(0)/R(0)) / 2π, with s'ᵀC⁻¹s' / sᵀC⁻¹s for the ratio, s' the slope of the pulse s.
        """
        shape, slope = self._shape[PHASES // 2], self._slope[PHASES // 2]
        heights = float((shape * np.linalg.solve(self._covariance, shape)).sum())
        slopes = float((slope * np.linalg.solve(self._covariance, slope)).sum())
        return math.sqrt(slopes / heights) / (2.0 * math.pi * self.sample_s)

    def fit(
        self, samples: np.ndarray, guess: np.ndarray, clipped: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return place of the peak [samples] and height of the pulse nearest to `guess` (row) [samples]."""
        place, height = self._climb(samples, guess, None, ROUNDS)
        if clipped is not None:
            some = np.flatnonzero(clipped.any(axis=1))
            place[some], height[some] = self._climb(samples[some], guess[some], clipped[some], ROUNDS_CLIPPED)
        lost = np.flatnonzero(~((height > 0.0) & (np.abs(place - guess) <= max(1.0, self.fwhm))))
        place[lost] = guess[lost]
        height[lost] = samples[lost, np.clip(np.rint(guess[lost]).astype(np.intp), 0, samples.shape[1] - 1)]
        return place, height

    def _climb(
        self, samples: np.ndarray, guess: np.ndarray, clipped: np.ndarray | None, rounds: int
    ) -> tuple[np.ndarray, np.ndarray]:
        n, row = samples.shape[1], np.arange(len(samples))
        windows = np.lib.stride_tricks.sliding_window_view(
            np.pad(samples, ((0, 0), (self.half, self.half))), self.width, axis=1
        )
        free = np.pad(np.ones((1, n), bool) if clipped is None else ~clipped, ((0, 0), (self.half, self.half)))
        inside = np.lib.stride_tricks.sliding_window_view(np.pad(np.ones(n, bool), (self.half, self.half)), self.width)
        usable = np.lib.stride_tricks.sliding_window_view(free, self.width, axis=1)
        place, height = guess.astype(float), np.zeros(len(samples))
        for _ in range(rounds if len(samples) else 0):
            step = np.rint(place * PHASES).astype(np.intp) + PHASES // 2
            middle = np.clip(step // PHASES, 0, n - 1)
            phase = np.clip(step - middle * PHASES, 0, PHASES - 1)
            if clipped is None:
                patterns, pattern = inside[middle.min() : middle.max() + 1], middle - middle.min()
            else:
                patterns, pattern = self._patterns(usable[row, middle], inside[middle])
            weights = np.stack([self.weights(used) for used in patterns])[pattern, phase]
            found = np.einsum("tk,tck->tc", windows[row, middle], weights, dtype=float)
            height = found[:, 0]
            shift = np.divide(found[:, 1], height, out=np.zeros_like(height), where=height > 0.0)
            here = middle + (phase - PHASES // 2) / PHASES
            place = np.clip(here + np.clip(shift, -0.75, 0.75), -0.5, n - 0.5)
        return place, height

    def _patterns(self, usable: np.ndarray, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the different patterns (pattern, width) of samples to use, and which of them each row has."""
        few = (usable & self._in_pulse).sum(axis=1) < 3
        usable = np.where(few[:, None], inside, usable)
        packed = np.packbits(usable, axis=1)
        _, first, pattern = np.unique(
            packed.view(f"V{packed.shape[1]}").ravel(), return_index=True, return_inverse=True
        )
        return usable[first], pattern.ravel()


@lru_cache(maxsize=64)
def _matched(pulse: Pulse, sample_s: float, pole_s: float, sigma_counts: float) -> Matched:
    return Matched(pulse, sample_s, pole_s, max(_WHITE_SHARE, 1.0 / (12.0 * max(sigma_counts, 1e-3) ** 2)))
