"""Shots of raw samples of one pixel: noise, baseline, pulse width, photon transfer and clip level, as points of curves.

Each statistic is computed for every shot, and its standard error comes from the scatter over the shots, which are
independent of each other even where the samples of one shot are not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.detector.curve_fit.measured_curve import MeasuredCurve, WaveformQuantity
from rso_lidar.detector.curve_fit.pixel_response import take_chain
from rso_lidar.detector.detection import AnyDetector
from rso_lidar.detector.ranging.pulse import LaserPulse, Pulse
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.errors import ScenarioError

_FEWEST_SHOTS = 20  # of a level: the errors themselves come from the scatter over the shots
_CLIPPED_SAMPLES = 3  # of a shot within a count of the greatest one, in half of the shots: a plateau
_CLIPPED_SHARE = 0.05  # of the shots that reach the greatest sample, from which a level is clipped in part
_ROUNDING_COUNTS = 12.0**-0.5  # standard deviation within one count
_LEAST_SNR = 10.0  # of the mean pulse, from which its width is estimated
_CUT = 0.05  # of the peak at an end of the shots, from which a pulse is cut
_SIGMAS = 5.0
_BANDWIDTHS = np.geomspace(0.35, 3.0, 15)  # over the nominal one, whose pulses are compared with the shots
_FINE = np.linspace(-1.0, 1.0, 5)  # places of a finer comparison
_PHASES = 32  # delays of a pulse in a sample interval
_BESIDE = 3  # samples between the greatest of a shot and the peak of its pulse, at the most
_GROUPS = 10  # of shots, whose widths differ by the standard error
_BINS = 4  # of the mean pulse in a sample interval


@dataclass(frozen=True, eq=False)
class ShotList:
    """Shots of raw samples of one pixel at one level of light.

    Parameters
    ----------
    name : of the shots in messages and reports
    samples_counts : (shot, sample) samples, baseline included [counts]
    sample_s : time between samples [s]
    photons : expected photons on the pixel; 0 for shots in the dark
    """

    name: str
    samples_counts: np.ndarray
    sample_s: float
    photons: float


@dataclass(frozen=True, eq=False)
class MeanPulse:
    """Mean pulse of shots that were aligned by their delays; arrays (time).

    Parameters
    ----------
    name : of the shots
    photons : expected on the pixel
    time_s : after the nominal delay of the return [s]
    value, error : mean over the amplitude of each shot, and its standard error
    """

    name: str
    photons: float
    time_s: np.ndarray
    value: np.ndarray
    error: np.ndarray


def reduce_shots(
    shots: Sequence[ShotList], detector: AnyDetector, pulse: LaserPulse
) -> tuple[list[MeasuredCurve], list[MeanPulse]]:
    """Reduce shots to points of curves with standard errors, and to the mean pulses that a report draws.

    Parameters
    ----------
    shots : of one pixel, each at one level of light; the baseline is that of the dark ones
    detector : at the start of the fit
    pulse : the laser's pulse

    Returns
    -------
    curves, and mean pulses

    Raises
    ------
    ScenarioError
        If there are too few shots, or a pulse is cut by the ends of the shots.
    """
    chain = take_chain(detector, "waveform")
    for each in shots:
        n = len(each.samples_counts)
        if n < _FEWEST_SHOTS:
            raise ScenarioError(
                f"{each.name}: {n} shot{'s' * (n != 1)} at {each.photons:.4g} photons tell{'s' * (n == 1)} no scatter; give "
                f"{_FEWEST_SHOTS} or more of each level"
            )
    curves: list[MeasuredCurve] = []
    dark = [each for each in shots if each.photons == 0.0]
    baseline, baseline_error = chain.readout.baseline_counts, 0.0
    for each in dark:
        curves += _reduce_dark(each)
    if dark:
        means = np.concatenate([each.samples_counts.mean(axis=1) for each in dark])
        baseline, baseline_error = float(means.mean()), float(means.std() / np.sqrt(len(means)))
    pulses: list[MeanPulse] = []
    for each in shots:
        if each.photons > 0.0:
            more, mean = _reduce_light(each, baseline, baseline_error, chain, pulse)
            curves += more
            pulses += mean
    return curves, pulses


def _reduce_dark(shots: ShotList) -> list[MeasuredCurve]:
    """Return baseline, noise, and correlation of neighbouring samples of shots in the dark."""
    samples = shots.samples_counts.astype(float)
    n = len(samples)
    means = samples.mean(axis=1)
    about = samples - means.mean()
    variance, product = (about**2).mean(axis=1), (about[:, 1:] * about[:, :-1]).mean(axis=1)
    noise = float(np.sqrt(variance.mean()))
    if noise == 0.0:
        raise ScenarioError(f"{shots.name}: all samples are equal, which no converter gives; give the raw samples")
    ratio = float(product.mean() / variance.mean())
    errors = (
        float(means.std() / np.sqrt(n)),
        float(variance.std() / np.sqrt(n) / (2.0 * noise)),
        float((product - ratio * variance).std() / np.sqrt(n) / variance.mean()),
    )
    quantities: tuple[WaveformQuantity, ...] = ("baseline", "sample_noise", "noise_correlation")
    values = (float(means.mean()), noise, ratio)
    return [_point(shots, *known) for known in zip(quantities, values, errors, strict=True)]


def _reduce_light(
    shots: ShotList, baseline: float, baseline_error: float, detector: Gsfl, pulse: LaserPulse
) -> tuple[list[MeasuredCurve], list[MeanPulse]]:
    """Return clip level, or area, its variance and width of the pulses of one level of light, with their mean."""
    samples = shots.samples_counts.astype(float)
    top = float(samples.max())
    plateau = samples >= top - 1.0
    if np.median(plateau.sum(axis=1)) >= _CLIPPED_SAMPLES:
        spread = float(samples[plateau].std() / np.sqrt(plateau.any(axis=1).sum()))
        return [_point(shots, "clip_level", top, float(np.hypot(spread, _ROUNDING_COUNTS)))], []
    touched = int((samples >= top - 0.5).any(axis=1).sum())
    if touched > max(_CLIPPED_SHARE * len(samples), 3.0):
        raise ScenarioError(
            f"{shots.name}: {touched} of {len(samples)} shots of {shots.photons:.4g} photons reach {top:.0f} counts: some "
            "are clipped and others not; leave this level out, or give a brighter one for the clip level"
        )
    signal = samples - baseline
    n, sample_ns = len(signal), shots.sample_s / units.NS
    mean, error = signal.mean(axis=0), signal.std(axis=0) / np.sqrt(n)
    peak = float(mean.max())
    for end in (0, -1):
        if mean[end] > max(_CUT * peak, _SIGMAS * error[end]):
            place = "first" if end == 0 else "last"
            raise ScenarioError(
                f"{shots.name}: the {place} sample still holds {mean[end] / peak:.0%} of the pulse of {shots.photons:.4g} "
                "photons, so that its area is unknown; give longer shots, or correct the baseline by shots in the dark"
            )
    area = signal.sum(axis=1) * sample_ns
    about = area - area.mean()
    variance, fourth = float((about**2).sum() / (n - 1)), float((about**4).mean())
    common = baseline_error * signal.shape[1] * sample_ns
    curves = [
        _point(shots, "pulse_area", float(area.mean()), float(np.hypot(np.sqrt(variance / n), common))),
        _point(shots, "area_variance", variance, float(np.sqrt(max(fourth - variance**2, 0.0) / n))),
    ]
    noise = float(signal[:, [0, -1]].std())
    if peak < _LEAST_SNR * max(noise, _ROUNDING_COUNTS):
        return curves, []
    bandwidth, width_s, width_error_s = _fit_width(signal, shots.sample_s, detector, pulse)
    # The free delay takes the scatter of the middle of the arrivals, a share 1/n of their variance: n effective arrivals.
    narrowed_s = 0.5 * variance / float(area.mean()) ** 2 * width_s
    error_s = float(np.hypot(width_error_s, 0.5 * narrowed_s))
    curves.append(_point(shots, "pulse_width", width_s + narrowed_s, error_s))
    return curves, [_average(shots, signal, _make_pulse(detector, pulse, bandwidth))]


def _fit_width(signal: np.ndarray, sample_s: float, detector: Gsfl, pulse: LaserPulse) -> tuple[float, float, float]:
    """Return bandwidth over the nominal one, and full width at half maximum with its error [s], of least squares.

    Amplitude and delay of each shot are free. The error is that of groups of shots, each fitted alone.
    """

    def sum_squares(log_ratio: np.ndarray) -> np.ndarray:
        shapes = [_make_pulse(detector, pulse, ratio) for ratio in np.exp(log_ratio).tolist()]
        return np.array([_fit_delays(signal, sample_s, shape)[2] for shape in shapes])

    coarse = np.log(_BANDWIDTHS)
    best = float(coarse[np.clip(sum_squares(coarse).sum(axis=1).argmin(), 1, len(coarse) - 2)])
    for reach in (1.0, 0.3):  # of the coarse steps
        step = reach * (coarse[1] - coarse[0])
        sums = sum_squares(best + step * _FINE)
        group = np.arange(len(signal)) % _GROUPS
        solved = [_find_least(sums[:, group == k].sum(axis=1)) for k in range(_GROUPS)]
        middle, best = best, best + step * _find_least(sums.sum(axis=1))
    widths = [_make_pulse(detector, pulse, ratio).fwhm_s for ratio in np.exp(middle + step * np.array([-1.0, 1.0]))]
    error_s = float(np.std(solved, ddof=1) / np.sqrt(_GROUPS)) * 0.5 * abs(widths[1] - widths[0])
    bandwidth = float(np.exp(best))
    return bandwidth, float(_make_pulse(detector, pulse, bandwidth).fwhm_s), error_s


def _find_least(sums: np.ndarray) -> float:
    """Return the place on `_FINE` of the least of sums of squares, by a parabola of least squares."""
    bend, slope, _ = np.polyfit(_FINE, sums, 2)
    return float(np.clip(-0.5 * slope / bend, -3.0, 3.0)) if bend > 0.0 else float(_FINE[sums.argmin()])


def shape_pulse(detector: AnyDetector, pulse: LaserPulse) -> Pulse:
    """Return the pulse of one return behind the amplifier of a detector.

    Parameters
    ----------
    detector : the full chain; another detector is refused
    pulse : the laser's pulse

    Returns
    -------
    Pulse

    Raises
    ------
    ScenarioError
        For a detector that stores no waveforms.
    """
    return _make_pulse(take_chain(detector, "waveform"), pulse, 1.0)


def _make_pulse(detector: Gsfl, pulse: LaserPulse, bandwidth: float) -> Pulse:
    """Return the pulse behind the amplifier of a bandwidth over the detector's."""
    amplifier = detector.amplifier
    return Pulse.after(pulse.step_s, pulse.power_per_s, amplifier.pole_s / bandwidth, amplifier.integration_s)


def _fit_delays(signal: np.ndarray, sample_s: float, shape: Pulse) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return delay [s], amplitude over the shape's and sum of squares (shot) of the best pulse of a shape in each shot."""
    n = signal.shape[1]
    top = signal.argmax(axis=1)
    first, last = (int(top.min()) - _BESIDE) * _PHASES, (int(top.max()) + _BESIDE) * _PHASES
    delay_s = np.arange(first, last + 1) * (sample_s / _PHASES) - shape.peak_s
    table = shape.amplitude(np.arange(n) * sample_s - delay_s[:, None])
    power = (table**2).sum(axis=1)
    inside = power > 0.5 * power.max()
    table, power, delay_s = table[inside], power[inside], delay_s[inside]
    match = signal @ table.T
    best = np.argmax(np.maximum(match, 0.0) ** 2 / power, axis=1)
    shot = np.arange(len(signal))
    amplitude = match[shot, best] / power[best]
    return delay_s[best], amplitude, (signal**2).sum(axis=1) - amplitude**2 * power[best]


def _average(shots: ShotList, signal: np.ndarray, shape: Pulse) -> MeanPulse:
    """Return the mean pulse of aligned shots, over its own peak."""
    delay_s, amplitude, _ = _fit_delays(signal, shots.sample_s, shape)
    time_s = np.arange(signal.shape[1]) * shots.sample_s - delay_s[:, None]
    value = signal / (amplitude[:, None] * shape.peak)
    width_s = shots.sample_s / _BINS
    place = np.floor(time_s / width_s).astype(np.int64)
    first = int(place.min())
    number = np.bincount((place - first).ravel())
    total, square, at = (np.bincount((place - first).ravel(), values.ravel()) for values in (value, value**2, time_s))
    enough = number >= max(_FEWEST_SHOTS // 2, len(signal) // (4 * _BINS))
    number, total, square, at = (values[enough] for values in (number, total, square, at))
    mean = total / number
    error = np.sqrt(np.maximum(square / number - mean**2, 0.0) / number)
    return MeanPulse(shots.name, shots.photons, at / number, mean, error)


def _point(shots: ShotList, quantity: WaveformQuantity, value: float, error: float) -> MeasuredCurve:
    """Return a curve of one point, whose error all shots together have."""
    n, length = shots.samples_counts.shape
    columns = {"photons": shots.photons, "value": value, "trials": float(n), "systematic": error}
    columns |= {"range_m": 0.0, "threshold_electrons": np.nan}
    arrays: dict[str, Any] = {name: np.array([column]) for name, column in columns.items()}
    name = f"{shots.name}: {quantity}"
    return MeasuredCurve(name, quantity, sample_s=shots.sample_s, samples=length, **arrays)


def merge_points(curves: Sequence[MeasuredCurve], name: str) -> list[MeasuredCurve]:
    """Return the curves of one quantity each that single points of several levels make, in the order of their light.

    Parameters
    ----------
    curves : of one point each
    name : of the shots, for messages
    """
    merged = []
    for quantity in dict.fromkeys(curve.quantity for curve in curves):
        some = sorted(
            (curve for curve in curves if curve.quantity == quantity), key=lambda curve: float(curve.photons[0])
        )
        columns: dict[str, Any] = {
            field: np.concatenate([getattr(curve, field) for curve in some])
            for field in ("photons", "value", "trials", "range_m", "threshold_electrons", "systematic")
        }
        merged.append(replace(some[0], name=f"{name}: {quantity}", **columns))
    return merged
