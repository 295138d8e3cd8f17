"""Curves that a laboratory measured of a camera, in SI units, and the statistics of a detector at the same points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from rso_lidar import units
from rso_lidar.detector.bench.trial import Surroundings, make_plate, run_trial
from rso_lidar.detector.detection import AnyDetector
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.errors import ScenarioError

CurveQuantity = Literal[
    "detection_rate", "range_mean", "range_scatter", "counts_mean", "counts_scatter", "walk", "dark_counts"
]
CURVE_QUANTITIES: tuple[str, ...] = get_args(CurveQuantity)
WaveformQuantity = Literal[
    "baseline", "sample_noise", "noise_correlation", "pulse_area", "area_variance", "pulse_width", "clip_level"
]
WAVEFORM_QUANTITIES: tuple[str, ...] = get_args(WaveformQuantity)
_PIXELS_AT_ONCE = 65_536  # of a trial, so that its signals take some 100 MB


@dataclass(frozen=True, eq=False)
class MeasuredCurve:
    """A measured curve; arrays (point).

    Parameters
    ----------
    name : of the curve in messages and reports
    quantity : what was measured. `range_mean` is the mean error of range; `walk` is the same up to a constant. Those of raw
        samples are `WAVEFORM_QUANTITIES`
    photons : expected photons on the pixel, after the optics and before quantum efficiency; 0 for `dark_counts`
    value : measured values: share, [m], [counts], number of triggers, area [counts ns], its variance, or width [s]
    trials : flashes behind a rate, reports behind a mean or a scatter, or armed time of `dark_counts` [s], over all pixels
    range_m : range of the plate [m]
    threshold_electrons : threshold at each point of `dark_counts` [electrons]; NaN for the detector's own
    systematic : errors common to all trials of a point, 1 sigma, in the unit of the values; of raw samples, the whole error
    sample_s, samples : time between raw samples [s], and their number in a shot
    """

    name: str
    quantity: CurveQuantity | WaveformQuantity
    photons: np.ndarray
    value: np.ndarray
    trials: np.ndarray
    range_m: np.ndarray
    threshold_electrons: np.ndarray
    systematic: np.ndarray
    sample_s: float = float("nan")
    samples: int = 0

    def __post_init__(self) -> None:
        n = len(self.value)
        for name in ("photons", "value", "trials", "range_m", "threshold_electrons", "systematic"):
            array = np.asarray(getattr(self, name), dtype=float)
            if array.shape != (n,):
                raise ScenarioError(
                    f"{self.name}: {name}: has the shape {array.shape}, not ({n},); give one for each point"
                )
        if not n:
            raise ScenarioError(f"{self.name}: has no points; give some")


@dataclass(frozen=True, eq=False)
class LevelStatistics:
    """What many trials of a detector report at each level of light; arrays (level).

    Reports farther than 5 standard deviations from the median are false triggers, and do not count for means and scatters.

    Parameters
    ----------
    share : of the flashes whose plate is reported
    range_mean_m, range_scatter_m : mean and standard deviation of the errors of these ranges [m], NaN of few reports
    range_kurtosis : fourth moment of the errors over the squared variance; 3 for a normal law
    counts_mean, counts_scatter, counts_kurtosis : likewise of the intensity [counts]
    """

    share: np.ndarray
    range_mean_m: np.ndarray
    range_scatter_m: np.ndarray
    range_kurtosis: np.ndarray
    counts_mean: np.ndarray
    counts_scatter: np.ndarray
    counts_kurtosis: np.ndarray


_OUTLIER = 5.0  # standard deviations from the median, estimated by quartiles, beyond which a report is a false trigger
_QUARTILES = 1.348_979_500_392_163_6  # distance of the quartiles of a normal law, in standard deviations
_FEWEST_REPORTS = 20  # of a level: fewer have no scatter that means anything


def simulate_levels(
    detector: AnyDetector, pulse: LaserPulse, photons: np.ndarray, range_m: np.ndarray, trials: int, seed: int
) -> LevelStatistics:
    """Simulate a detector's reports of a facing plate at several levels of light.

    The same seed gives each pixel the same random numbers, so that differences between two detectors are not noise.

    Parameters
    ----------
    photons, range_m : (level) expected photons, and least range of the plate, which is spread over a metre [m]
    trials : number of pixels for each level
    """
    levels = len(photons)
    batch = max(1, _PIXELS_AT_ONCE // trials)
    rows = []
    for first in range(0, levels, batch):
        some = slice(first, min(first + batch, levels))
        n = some.stop - first
        light = make_plate(
            np.repeat(photons[some], trials),
            n * trials,
            (pulse.step_s, pulse.power_per_s),
            pulse.fwhm_s,
            np.repeat(range_m[some], trials),
        )
        around = Surroundings(timing_jitter_s=pulse.timing_jitter_ns * units.NS)
        trial = run_trial(detector, light, np.random.Generator(np.random.Philox([seed, first])), around=around)
        level = np.flatnonzero(trial.detected) // trials
        share = trial.detected.reshape(n, trials).mean(axis=1)
        range_rows = _summarise(level, trial.range_error_m, n)
        rows.append(np.vstack([share, range_rows, _summarise(level, trial.intensity_counts.astype(float), n)]))
    return LevelStatistics(*np.concatenate(rows, axis=1))


def summarise_reports(detected: np.ndarray, range_error_m: np.ndarray, intensity_counts: np.ndarray) -> LevelStatistics:
    """Return the statistics of the reports of equal pixels, as one level.

    Parameters
    ----------
    detected, range_error_m, intensity_counts : (pixel) whether each reports the plate, and its report
    """
    level = np.zeros(int(detected.sum()), np.int64)
    rows = [_summarise(level, values[detected].astype(float), 1) for values in (range_error_m, intensity_counts)]
    return LevelStatistics(*np.vstack([[detected.mean()], *rows]))


def _summarise(level: np.ndarray, values: np.ndarray, n: int) -> np.ndarray:
    """Return mean, standard deviation and kurtosis (3, level) of values by level without outliers, NaN of few."""
    rows = np.full((3, n), np.nan)
    for k in range(n):
        some = values[level == k]
        if len(some) < _FEWEST_REPORTS:
            continue
        low, middle, high = np.quantile(some, [0.25, 0.5, 0.75])
        reach = _OUTLIER * max((high - low) / _QUARTILES, 0.2 * some.std())
        some = some[np.abs(some - middle) <= reach]
        if some.std() > 0.0:
            about = some - some.mean()
            variance = float((about**2).mean())
            rows[:, k] = some.mean(), np.sqrt(variance), float((about**4).mean()) / variance**2
    return rows
