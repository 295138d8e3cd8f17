"""Noise, pulse shape and saturation of raw waveforms, by the same rules for any camera."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.evaluation.raw_waveforms.waveform_set import RawWaveforms

LAGS = 16  # samples, up to which noise is correlated with itself
_FEWEST_DARK = 32  # samples of noise in a waveform
_FEWEST = 10  # pulses from which a shape is stated, and clipped ones from which a level is
_CLEAR = 20.0  # times the noise: the faintest peak that is measured
_PLATEAU = 4  # equal samples in a row at the greatest value of a waveform that clips
_REACH_S = 100e-9  # to each side of the peak, within which a pulse ends
_ALONE = 0.2  # of the peak: a second pulse beyond twice the half width may reach it
_NARROWEST = 0.25  # share of the pulses, the narrowest, that stands for facing surfaces: others are stretched
_GRID = np.linspace(-2.5, 3.5, 241)  # half widths from the peak, at which shapes are compared


@dataclass(frozen=True, eq=False)
class WaveformStatistics:
    """What the waveforms of one gain, or of a simulated camera, have in common.

    Parameters
    ----------
    name : of the gain or the camera
    traces : number of waveforms
    sample_s : time between samples [s]
    noise_counts : median over the channels of the rms noise in the dark [counts]
    noise_kurtosis : mean fourth power of the noise over its squared variance in each channel, less 3. Normal noise has 0,
        less some 6 over the number of independent samples in the dark
    noise_correlation : (lag) correlation of samples 1, 2, ... apart
    pulses : number of clear pulses that do not clip
    fwhm_s : full width at half maximum that a quarter of them has at most [s]
    rise_s, fall_s : from 10 to 90 % and back of the mean of these [s]
    shape : (instant) their mean over its peak, at `shape_grid` times `fwhm_s` from the peak
    clipped : number of waveforms that clip
    clip_counts : median amplitude above the baseline at which they do [counts]
    recovery_s : median time from the last clipped sample until half of that amplitude [s]
    """

    name: str
    traces: int
    sample_s: float
    noise_counts: float
    noise_kurtosis: float
    noise_correlation: np.ndarray
    pulses: int
    fwhm_s: float
    rise_s: float
    fall_s: float
    shape: np.ndarray
    clipped: int
    clip_counts: float
    recovery_s: float

    @property
    def clip_over_noise(self) -> float:
        """Amplitude at which waveforms clip over the rms noise."""
        return self.clip_counts / self.noise_counts

    @property
    def shape_s(self) -> np.ndarray:
        """(instant) time from the peak at which `shape` is given [s]."""
        return _GRID * self.fwhm_s


def measure_waveforms(name: str, sets: Iterable[RawWaveforms]) -> WaveformStatistics:
    """Measure the noise, the pulse shape and the saturation of waveforms.

    Parameters
    ----------
    name : of the gain or the camera
    sets : waveforms of one gain and one sample period

    Returns
    -------
    Statistics; what too few waveforms show is NaN.

    Raises
    ------
    ScenarioError
        If the waveforms hold too few samples in the dark, or no noise.
    """
    noise, moments, pulses, levels, recovery = [], [], [], [], []
    sample_s, traces = math.nan, 0
    for raw in sets:
        if raw.dark_samples < _FEWEST_DARK:
            raise ScenarioError(
                f"{name}: {raw.dark_samples} samples precede the light, and {_FEWEST_DARK} are needed to know the noise; "
                "give waveforms that begin earlier"
            )
        sample_s, traces = raw.sample_s, traces + len(raw.samples_counts)
        dark = raw.samples_counts[:, : raw.dark_samples].astype(float)
        baseline = dark.mean(axis=1, keepdims=True)
        moments.append(_sum_moments(dark - baseline))
        noise.append(dark.std(axis=1, ddof=1))
        clear = _CLEAR * max(float(np.median(noise[-1])), 1e-9)
        signal = raw.samples_counts - baseline
        top, run = signal.max(axis=1), _find_longest_top(signal)
        is_clipped = (run >= _PLATEAU) & (top > clear)
        levels.append(top[is_clipped])
        recovery += [_measure_recovery(row, sample_s) for row in signal[is_clipped]]
        pulses += [
            pulse for row in signal[~is_clipped & (top > clear)] if (pulse := _cut_pulse(row, sample_s)) is not None
        ]
    if not traces or not (noise_counts := float(np.median(np.concatenate(noise)))) > 0.0:
        raise ScenarioError(
            f"{name}: its samples before the light have no noise; give raw waveforms, not processed ones"
        )
    square, fourth, lagged, count = (sum(values) for values in zip(*moments, strict=True))
    fwhm_s, shape = _average_pulses(pulses)
    level = np.concatenate(levels)
    known = len(level) >= _FEWEST
    return WaveformStatistics(
        name,
        traces,
        sample_s,
        noise_counts * math.sqrt(square / count),
        float(fourth / count - 3.0),
        np.asarray(lagged / square),
        len(pulses),
        fwhm_s,
        _measure_edge(shape[::-1], _GRID[::-1]) * fwhm_s,
        _measure_edge(shape, _GRID) * fwhm_s,
        shape,
        len(level),
        float(np.median(level)) if known else math.nan,
        float(np.nanmedian(recovery)) if known else math.nan,
    )


def _sum_moments(dark: np.ndarray) -> tuple[float, float, np.ndarray, int]:
    """Sum second and fourth powers of noise in units of each channel's rms, and products of samples some lags apart."""
    rms = dark.std(axis=1, keepdims=True)
    unit = dark[rms[:, 0] > 0.0] / rms[rms[:, 0] > 0.0]
    lag, n = np.arange(1, LAGS + 1), unit.shape[1]
    lagged = np.array([(unit[:, :-k] * unit[:, k:]).mean() for k in lag.tolist()]) if len(unit) else np.zeros(LAGS)
    # The mean of n samples was subtracted, whose variance follows from the correlation itself.
    weight = 1.0 - lag / n
    missing = (1.0 + 2.0 * (weight * lagged).sum()) / n / (1.0 - (1.0 + 2.0 * weight.sum()) / n)
    return (1.0 + missing) * unit.size, float((unit**4).sum()), (lagged + missing) * unit.size, unit.size


def _find_longest_top(signal: np.ndarray) -> np.ndarray:
    """Return the longest run of samples (channel) at the greatest value of each waveform."""
    is_top = signal >= signal.max(axis=1, keepdims=True) - 1e-6
    longest = run = np.zeros(len(signal), int)
    for column in is_top.T:
        run = np.where(column, run + 1, 0)
        longest = np.maximum(longest, run)
    return longest


def _measure_recovery(row: np.ndarray, sample_s: float) -> float:
    """Return the time from the last sample at the top until the signal is at half of it [s]; NaN if it never is."""
    last = int(np.flatnonzero(row >= row.max() - 1e-6)[-1])
    below = np.flatnonzero(row[last:] <= 0.5 * row[last])
    if not len(below):
        return math.nan
    k = last + int(below[0])
    return float((k - last - (0.5 * row[last] - row[k]) / (row[k - 1] - row[k])) * sample_s)


def _cut_pulse(row: np.ndarray, sample_s: float) -> tuple[float, np.ndarray] | None:
    """Return full width at half maximum [s] and shape over `_GRID` of the highest pulse; None unless whole and alone."""
    k = int(row.argmax())
    reach = round(_REACH_S / sample_s)
    if not 2 <= k < len(row) - 2:
        return None
    before, middle, after = row[k - 1 : k + 2].tolist()
    curvature = before - 2.0 * middle + after
    shift = 0.5 * (before - after) / curvature if curvature < 0.0 else 0.0
    peak, place = middle - 0.25 * (before - after) * shift, k + shift
    start, stop = max(k - reach, 0), min(k + reach + 1, len(row))
    low_left, low_right = (np.flatnonzero(part <= 0.5 * peak) for part in (row[start : k + 1], row[k:stop]))
    if not len(low_left) or not len(low_right):
        return None
    i, j = start + int(low_left[-1]), k + int(low_right[0])
    left = i + (0.5 * peak - row[i]) / (row[i + 1] - row[i])
    right = j - (0.5 * peak - row[j]) / (row[j - 1] - row[j])
    width = right - left
    at = place + _GRID * width
    if at[0] < 0.0 or at[-1] > len(row) - 1:
        return None
    away = np.abs(np.arange(len(row)) - place) > 2.0 * width
    if row[away].max(initial=0.0) > _ALONE * peak:
        return None
    return width * sample_s, np.interp(at, np.arange(len(row)), row) / peak


def _average_pulses(pulses: Sequence[tuple[float, np.ndarray]]) -> tuple[float, np.ndarray]:
    """Return the width and the mean shape of the narrowest pulses; NaN where there are too few."""
    if len(pulses) < _FEWEST:
        return math.nan, np.full(len(_GRID), math.nan)
    widths = np.array([width for width, _ in pulses])
    narrow_s = float(np.quantile(widths, _NARROWEST))
    return narrow_s, np.mean([shape for width, shape in pulses if width <= narrow_s], axis=0)


def _measure_edge(shape: np.ndarray, grid: np.ndarray) -> float:
    """Return the distance on a grid between 90 and 10 % of a shape behind its peak."""
    if np.isnan(shape).any():
        return math.nan
    top = int(shape.argmax())
    places = []
    for level in (0.9, 0.1):
        below = np.flatnonzero(shape[top:] <= level * shape[top])
        if not len(below):
            return math.nan
        k = top + int(below[0])
        places.append(np.interp(level * shape[top], [shape[k], shape[k - 1]], [grid[k], grid[k - 1]]))
    return float(abs(places[1] - places[0]))
