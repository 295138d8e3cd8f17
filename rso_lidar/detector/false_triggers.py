"""Triggers on nothing: when noise first crosses a pixel's threshold, and what the pixel stores of it.

Dark pixels are most of a frame; they are not simulated step by step, their false triggers are drawn from their rate.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rso_lidar import units
from rso_lidar.detector.amplifier import Amplifier
from rso_lidar.detector.noise import false_alarm_rate, noise_rms

if TYPE_CHECKING:
    from rso_lidar.detector.gsfl import Gsfl

_AT_ONCE = 256  # traces of noise, each with a covariance of its own
_NIL = -250.0  # log of a rate that is none


def rates_per_s(gsfl: Gsfl, threshold: np.ndarray, base_per_s: np.ndarray) -> np.ndarray:
    """Return how often noise crosses each pixel's threshold [electrons] upward, a second of being armed."""
    rates: np.ndarray = false_alarm_rate(
        threshold,
        apd=gsfl.apd,
        rate_per_s=base_per_s,
        noise_electrons=gsfl.amplifier.noise_electrons,
        pole_s=gsfl.amplifier.pole_s,
        integration_s=gsfl.amplifier.integration_s,
    )
    return rates


def first_false_s(
    gsfl: Gsfl, n_pixels: int, sunlight_per_s: np.ndarray | None, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels, rising, that noise triggers while they are armed, and when it first does [s since emission].

    `sunlight_per_s` (pixel) are the primaries of the background, None without. With it the crossings of the brightest
    background there may be are drawn, whose rates are kept, and each stays with the probability of its own pixel's rate over
    that: a Poisson process thinned is one of the lower rate. Dead pixels never trigger.
    """
    from_s, to_s = (m / units.RANGE_PER_DELAY_M_S for m in (gsfl.armed_from_m, gsfl.armed_to_m))
    brightest = 0.0 if sunlight_per_s is None else float(sunlight_per_s.max(initial=0.0))
    rates = _rates(gsfl, n_pixels, math.ceil(math.log2(brightest)) if brightest > 0.0 else None)
    if rates.table is None or sunlight_per_s is None:
        return first_crossings(rates.sums_per_s, from_s, to_s, rng)
    if rates.sums_per_s[-1] * (to_s - from_s) > n_pixels:
        return first_crossings(np.cumsum(rates.at(slice(None), sunlight_per_s)), from_s, to_s, rng)
    pixel, at_s = crossings(rates.sums_per_s, from_s, to_s, rng)
    kept = rng.random(len(pixel)) * rates.most_per_s[pixel] < rates.at(pixel, sunlight_per_s[pixel])
    return _firsts(pixel[kept], at_s[kept])


def first_crossings(
    sums_per_s: np.ndarray, from_s: float, to_s: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels, rising, with a crossing from `from_s` to `to_s`, and the time of their first [s].

    `sums_per_s` are the rates of the pixels, summed up to and with each. Where crossings are many, each pixel waits for its
    first by itself: an exponential time.
    """
    if sums_per_s[-1] * (to_s - from_s) <= len(sums_per_s):
        return _firsts(*crossings(sums_per_s, from_s, to_s, rng))
    with np.errstate(divide="ignore"):
        at_s = from_s + rng.standard_exponential(len(sums_per_s)) / np.diff(sums_per_s, prepend=0.0)
    pixel = np.flatnonzero(at_s < to_s)
    return pixel, at_s[pixel]


def crossings(
    sums_per_s: np.ndarray, from_s: float, to_s: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return pixels, rising, and times [s], rising in a pixel, of all crossings of all pixels.

    Upcrossings of a high level are a Poisson process (Cramér and Leadbetter 1967, ch. 12). Those of all pixels together are
    one whose rate is the sum; each is of a pixel with the probability of its share in the sum, at any time alike. So the
    first of a pixel comes after an exponential waiting time, as if drawn pixel by pixel.
    """
    total = float(sums_per_s[-1])
    n = int(rng.poisson(total * (to_s - from_s)))
    pixel = np.minimum(np.searchsorted(sums_per_s, total * rng.random(n), "right"), len(sums_per_s) - 1)
    at_s = from_s + (to_s - from_s) * rng.random(n)
    order = np.lexsort((at_s, pixel))
    return pixel[order], at_s[order]


def _firsts(pixel: np.ndarray, at_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    first = np.flatnonzero(np.diff(pixel, prepend=-1))
    return pixel[first], at_s[first]


class _Rates(NamedTuple):
    """Crossings of the pixels of a camera, dead ones left out, under a background up to a brightest one."""

    most_per_s: np.ndarray  # (pixel) under the brightest
    sums_per_s: np.ndarray  # (pixel) summed up to and with each
    threshold: np.ndarray  # (pixel) [electrons]
    dark_per_s: np.ndarray  # (pixel) primaries without background
    dead: np.ndarray
    table: Any = None  # spline of the log of the rate over that of the primaries and the threshold

    def at(self, pixel: np.ndarray | slice, sunlight_per_s: np.ndarray) -> np.ndarray:
        """Return the rates [1/s] of some pixels under so many primaries of sunlight."""
        primaries = np.maximum(self.dark_per_s[pixel] + sunlight_per_s, 1.0)
        log_rate = self.table.ev(np.log(primaries), self.threshold[pixel])
        rates: np.ndarray = np.where(self.dead[pixel] | (log_rate < 0.9 * _NIL), 0.0, np.exp(log_rate))
        return rates


@lru_cache(maxsize=8)
def _rates(gsfl: Gsfl, n_pixels: int, level: int | None) -> _Rates:
    """Return the rates of a camera in the dark, or under a background of up to 2^level primaries a second."""
    camera = gsfl.camera(n_pixels)
    threshold, dark = gsfl.trigger.threshold_electrons * camera.threshold, gsfl.dark_per_s(camera)
    brightest = dark if level is None else dark + 2.0**level
    most = np.where(camera.dead, 0.0, rates_per_s(gsfl, threshold, brightest))
    known = _Rates(most, np.cumsum(most), threshold, dark, camera.dead)
    if level is None:
        return known
    from scipy.interpolate import RectBivariateSpline

    low, high = (math.log(max(float(value), 1.0)) for value in (dark.min(), brightest.max()))
    primaries = np.linspace(low - 0.01, high + 0.01, max(4, math.ceil(4.0 * (high - low)) + 1))
    thresholds = np.linspace(0.99 * threshold.min(), 1.01 * threshold.max(), 65)
    rates = rates_per_s(gsfl, *np.meshgrid(thresholds, np.exp(primaries)))
    table = np.log(np.maximum(rates, math.exp(_NIL)))
    return known._replace(table=RectBivariateSpline(primaries, thresholds, table))


def false_traces(
    gsfl: Gsfl,
    crossing_s: np.ndarray,
    threshold: np.ndarray,
    base_per_s: np.ndarray,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Return what is stored of noise that crosses its threshold upward at `crossing_s`: amplitudes and first samples.

    Given value and slope at an upcrossing, the slope Rayleigh-distributed, Gaussian noise is their regression and a rest
    that they say nothing about (Slepian 1963; Leadbetter, Lindgren and Rootzén 1983, chapter 10).
    """
    readout, amplifier = gsfl.readout, gsfl.amplifier
    pole_s, correlation = amplifier.pole_s, amplifier.correlation
    sigma = noise_rms(gsfl.apd, base_per_s, amplifier.noise_electrons, pole_s, amplifier.integration_s)
    first = np.floor(crossing_s / readout.sample_s).astype(np.int64) - readout.pretrigger_samples
    slope = rng.rayleigh(1.0, len(crossing_s))
    white = rng.standard_normal((len(crossing_s), readout.samples))
    amplitude = np.zeros((len(crossing_s), readout.samples), np.float32)
    sample = np.arange(readout.samples)
    between = _between_samples(amplifier, readout.samples, readout.sample_s)
    for start in range(0, len(crossing_s), _AT_ONCE):
        of = slice(start, start + _AT_ONCE)
        lag_s = (first[of, None] + sample) * readout.sample_s - crossing_s[of, None]
        value, rise = correlation(lag_s), lag_s / pole_s * np.exp(-np.abs(lag_s) / pole_s)
        rest = between - value[:, :, None] * value[:, None] - rise[:, :, None] * rise[:, None]
        noise = (np.linalg.cholesky(rest) * white[of, None]).sum(axis=2)
        amplitude[of] = threshold[of, None] * value + sigma[of, None] * (slope[of, None] * rise + noise)
    return amplitude, first


@lru_cache(maxsize=8)
def _between_samples(amplifier: Amplifier, n: int, sample_s: float) -> np.ndarray:
    lag_s = np.subtract.outer(np.arange(n), np.arange(n)) * sample_s
    return amplifier.correlation(lag_s) + 1e-9 * np.eye(n)  # rounding may leave what is not foretold a hair below zero
