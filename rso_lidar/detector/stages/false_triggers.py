"""Triggers on nothing: when noise first crosses a pixel's threshold, and what the pixel stores of it.

Dark pixels are most of a frame; they are not simulated step by step, their false triggers are drawn from their rate.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from rso_lidar.detector.settings.amplifier import Amplifier
from rso_lidar.detector.settings.apd import Apd, noise_rms
from rso_lidar.detector.settings.readout import Readout
from rso_lidar.detector.settings.trigger import Trigger
from rso_lidar.detector.stages.crossing_rate import false_alarm_rate
from rso_lidar.detector.stages.nonuniformity import CameraPixels
from rso_lidar.kernels import kernel, packed

_AT_ONCE = 4096  # traces of noise in one block, which bounds the memory
_NIL = -250.0  # logarithm that represents a rate of zero


def rates_per_s(apd: Apd, amplifier: Amplifier, threshold: np.ndarray, base_per_s: np.ndarray) -> np.ndarray:
    """Return how often noise crosses each pixel's threshold upward, for each second of being armed.

    Parameters
    ----------
    threshold : (pixel) [electrons]
    base_per_s : (pixel) primaries of dark current and sunlight [1/s]
    """
    rates: np.ndarray = false_alarm_rate(
        threshold,
        apd=apd,
        rate_per_s=base_per_s,
        noise_electrons=amplifier.noise_electrons,
        pole_s=amplifier.pole_s,
        integration_s=amplifier.integration_s,
    )
    return rates


@dataclass(frozen=True, eq=False)
class Comparators:
    """The comparators of all pixels: what makes their noise, their thresholds, when they are armed, how often noise fires.

    Parameters
    ----------
    apd, amplifier : where the noise comes from
    trigger : nominal threshold and hysteresis
    pixels : their factors of the threshold, and dark currents
    from_s, to_s : begin and end of the armed window [s since emission]
    rates : of false triggers of all pixels, in the dark for None, or under a background of up to 2^level primaries a
        second; kept by level
    """

    apd: Apd
    amplifier: Amplifier
    trigger: Trigger
    pixels: CameraPixels
    from_s: float
    to_s: float
    rates: Callable[[int | None], FalseRates]

    def noise_sigma(self, rate_per_s: np.ndarray) -> np.ndarray:
        """Return the rms noise [electrons] at this rate of primaries [1/s], of any origin."""
        amplifier = self.amplifier
        return noise_rms(self.apd, rate_per_s, amplifier.noise_electrons, amplifier.pole_s, amplifier.integration_s)

    def select(self, pixel: np.ndarray) -> Comparators:
        """Return those of some pixels, or the same ones several times."""
        return replace(self, pixels=self.pixels.select(pixel), rates=lambda level: self.rates(level).select(pixel))


def build_comparators(
    apd: Apd, amplifier: Amplifier, trigger: Trigger, pixels: CameraPixels, from_s: float, to_s: float
) -> Comparators:
    """Build the comparators of a camera."""

    @lru_cache(maxsize=8)
    def find_rates(level: int | None) -> FalseRates:
        return _find_rates(apd, amplifier, trigger.threshold_electrons, pixels, level)

    return Comparators(apd, amplifier, trigger, pixels, from_s, to_s, find_rates)


def draw_first_false(
    armed: Comparators, sunlight_per_s: np.ndarray | None, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Draw the pixels, ascending, that noise triggers while they are armed, and the first instant of each [s].

    With sunlight, the crossings of the brightest background there may be are drawn, whose rates are kept, and each stays
    with the probability of its pixel's rate over that: a thinned Poisson process is one of the lower rate. Dead pixels
    never trigger.

    Parameters
    ----------
    sunlight_per_s : (pixel) primaries of the background [1/s], None without
    """
    from_s, to_s = armed.from_s, armed.to_s
    brightest = 0.0 if sunlight_per_s is None else float(sunlight_per_s.max(initial=0.0))
    rates = armed.rates(math.ceil(math.log2(brightest)) if brightest > 0.0 else None)
    n_pixels = len(armed.pixels.threshold)
    if rates.table is None or sunlight_per_s is None:
        return draw_first_crossings(rates.sums_per_s, from_s, to_s, rng)
    if rates.sums_per_s[-1] * (to_s - from_s) > n_pixels:
        return draw_first_crossings(np.cumsum(rates.at(slice(None), sunlight_per_s)), from_s, to_s, rng)
    pixel, at_s = draw_crossings(rates.sums_per_s, from_s, to_s, rng)
    kept = rng.random(len(pixel)) * rates.most_per_s[pixel] < rates.at(pixel, sunlight_per_s[pixel])
    return _firsts(pixel[kept], at_s[kept])


def draw_first_crossings(
    sums_per_s: np.ndarray, from_s: float, to_s: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels with a crossing, ascending, and the time of the first of each [s].

    Where crossings are many, each pixel waits separately for its first: an exponential time.

    Parameters
    ----------
    sums_per_s : (pixel) cumulative sum of the rates [1/s]
    from_s, to_s : span of time [s]
    """
    if sums_per_s[-1] * (to_s - from_s) <= len(sums_per_s):
        return _firsts(*draw_crossings(sums_per_s, from_s, to_s, rng))
    with np.errstate(divide="ignore"):
        at_s = from_s + rng.standard_exponential(len(sums_per_s)) / np.diff(sums_per_s, prepend=0.0)
    pixel = np.flatnonzero(at_s < to_s)
    return pixel, at_s[pixel]


def draw_crossings(
    sums_per_s: np.ndarray, from_s: float, to_s: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return pixels, ascending, and times [s], ascending in a pixel, of all crossings of all pixels.

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


class FalseRates(NamedTuple):
    """Crossings of the pixels of a camera, dead ones left out, under a background up to a brightest one."""

    alive_per_s: np.ndarray  # (pixel) under the brightest, dead pixels as if alive
    most_per_s: np.ndarray  # (pixel) under the brightest
    sums_per_s: np.ndarray  # (pixel) summed up to and with each
    threshold: np.ndarray  # (pixel) [electrons]
    dark_per_s: np.ndarray  # (pixel) primaries without background
    dead: np.ndarray
    table: Any = None  # spline of the log of the rate over that of the primaries and the threshold

    def at(self, pixel: np.ndarray | slice, sunlight_per_s: np.ndarray) -> np.ndarray:
        """Return the rates [1/s] of some pixels under sunlight of these primaries [1/s]."""
        primaries = np.maximum(self.dark_per_s[pixel] + sunlight_per_s, 1.0)
        log_rate = self.table.ev(np.log(primaries), self.threshold[pixel])
        rates: np.ndarray = np.where(self.dead[pixel] | (log_rate < 0.9 * _NIL), 0.0, np.exp(log_rate))
        return rates

    def select(self, pixel: np.ndarray) -> FalseRates:
        """Return the rates of some pixels, or of the same ones several times."""
        most = self.most_per_s[pixel]
        each = self.alive_per_s[pixel], most, np.cumsum(most), self.threshold[pixel], self.dark_per_s[pixel]
        return FalseRates(*each, self.dead[pixel], self.table)


def _find_rates(
    apd: Apd, amplifier: Amplifier, threshold_electrons: float, camera: CameraPixels, level: int | None
) -> FalseRates:
    """Return the rates of a camera in the dark, or under a background of up to 2^level primaries a second.

    Parameters
    ----------
    threshold_electrons : nominal threshold [electrons]
    camera : the pixels, with their thresholds and dark currents
    level : binary logarithm of the greatest background [1/s]; None for the dark
    """
    threshold, dark = threshold_electrons * camera.threshold, camera.dark_per_s
    brightest = dark if level is None else dark + 2.0**level
    alive = rates_per_s(apd, amplifier, threshold, brightest)
    most = np.where(camera.dead, 0.0, alive)
    known = FalseRates(alive, most, np.cumsum(most), threshold, dark, camera.dead)
    if level is None:
        return known
    from scipy.interpolate import RectBivariateSpline

    low, high = (math.log(max(float(value), 1.0)) for value in (dark.min(), brightest.max()))
    primaries = np.linspace(low - 0.01, high + 0.01, max(4, math.ceil(4.0 * (high - low)) + 1))
    thresholds = np.linspace(0.99 * threshold.min(), 1.01 * threshold.max(), 65)
    rates = rates_per_s(apd, amplifier, *np.meshgrid(thresholds, np.exp(primaries)))
    table = np.log(np.maximum(rates, math.exp(_NIL)))
    return known._replace(table=RectBivariateSpline(primaries, thresholds, table))


def draw_false_traces(
    apd: Apd,
    amplifier: Amplifier,
    readout: Readout,
    crossing_s: np.ndarray,
    threshold: np.ndarray,
    base_per_s: np.ndarray,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Draw what is stored of noise that crosses its threshold upward: amplitudes (trace, sample), and first samples.

    At an upcrossing the slope is Rayleigh-distributed (Slepian 1963; Leadbetter, Lindgren and Rootzén 1983, chapter 10).
    Behind two poles, value and slope at one moment are all that noise remembers: from there it is drawn sample by sample,
    onward and, since it looks the same in reverse, back.

    Parameters
    ----------
    crossing_s : (trace) when the noise crosses [s since emission]
    threshold : (trace) [electrons]
    base_per_s : (trace) primaries of dark current and sunlight [1/s]
    """
    pole_s, lag = amplifier.pole_s, readout.sample_s / amplifier.pole_s
    sigma = noise_rms(apd, base_per_s, amplifier.noise_electrons, pole_s, amplifier.integration_s)
    sample = np.floor(crossing_s / readout.sample_s)  # the last before the latch
    since = np.clip(crossing_s / pole_s - sample * lag, 0.0, lag)
    before, n = readout.pretrigger_samples + 1, readout.samples
    slope = rng.rayleigh(1.0, len(crossing_s))
    amplitude = np.zeros((len(crossing_s), n), np.float32)
    for start in range(0, len(crossing_s), _AT_ONCE):
        of = slice(start, start + _AT_ONCE)
        level, rising, past, scale = threshold[of] / sigma[of], slope[of], since[of], sigma[of, None]
        amplitude[of, before:] = scale * draw_onward(level, rising, lag - past, lag, n - before, rng)
        amplitude[of, :before] = scale * draw_onward(level, -rising, past, lag, before, rng)[:, ::-1]
    return amplitude, sample.astype(np.int64) - readout.pretrigger_samples


def draw_onward(
    value: np.ndarray, slope: np.ndarray, first_lag: np.ndarray, lag: float, n: int, rng: np.random.Generator
) -> np.ndarray:
    """Draw n samples (trace, sample) of noise behind two poles that has this value and slope before them.

    Time is in poles, noise of rms 1. `slope` + `value` is what comes out of the first pole, an Ornstein-Uhlenbeck process of
    variance 2; the second follows it.

    Parameters
    ----------
    value, slope : (trace) of the noise before the first sample
    first_lag : (trace) from there to the first sample
    n : number of samples
    """
    samples, white = np.empty((n, len(value))), rng.standard_normal((n, 2, len(value)))
    known = packed(value, np.float64), packed(slope, np.float64), packed(first_lag, np.float64)
    continue_noise(*known, lag, white, samples)
    return samples.T


@kernel
def noise_factors(lag: float) -> tuple[float, float, float, float, float]:
    """Return what a lag [poles] does to noise behind two poles, as factors: what is left, and what is new.

    The decay; the first pole's share in the second; the rms that the first gains; what the second gains along with it, and
    alone.
    """
    decay = math.exp(-lag)
    rms = math.sqrt(max(-2.0 * math.expm1(-2.0 * lag), 1e-30))
    with_it = (1.0 - decay * decay * (1.0 + 2.0 * lag)) / rms
    value = 1.0 - decay * decay * (1.0 + 2.0 * lag + 2.0 * lag * lag)
    return decay, lag * decay, rms, with_it, math.sqrt(max(value - with_it * with_it, 0.0))


@kernel
def continue_noise(
    value: np.ndarray, slope: np.ndarray, first_lag: np.ndarray, lag: float, white: np.ndarray, samples: np.ndarray
) -> None:
    """Continue noise from a known value and slope.

    Parameters
    ----------
    value, slope : (trace) before the first sample
    first_lag, lag : (trace) to the first sample, and from each sample to the next [poles]
    white : (sample, 2, trace) standard normal numbers
    samples : (sample, trace) written
    """
    later = noise_factors(lag)
    for trace in range(len(value)):
        between = noise_factors(first_lag[trace])
        now, halfway = value[trace], value[trace] + slope[trace]
        for sample in range(len(samples)):
            decay, driven, rms, with_it, alone = between
            first, second = white[sample, 0, trace], white[sample, 1, trace]
            now = decay * now + driven * halfway + with_it * first + alone * second
            halfway = decay * halfway + rms * first
            samples[sample, trace] = now
            between = later
