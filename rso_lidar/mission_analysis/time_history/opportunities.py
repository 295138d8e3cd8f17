"""Detection opportunities: the expected light of a target at some frames, and the probability of detecting it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from rso_lidar.detector import array_load, detection_probability, make_plate, run_trial
from rso_lidar.processes import map_parts
from rso_lidar.records import Truth
from rso_lidar.scenario import Lidar, Scenario, cast_surfaces, find_probability

_MOST_RAYS = 40_000_000  # in all casts together; beyond this the grid within a pixel becomes coarser
_LEVELS, _DECADES = 145, (0.0, 6.0)  # levels of photons at which a detector is tried
_TRIALS, _FEWEST = 200, 10  # pixels for each level
_FLASHES = 256  # simulated for a single attitude and place: the standard error is at most 0.031
_MOST_SAMPLES = 8_000_000  # in all trials together, so that a detector with a long gate is tried in seconds


@dataclass(frozen=True)
class DetectionOpportunity:
    """Expected light and detections of one target in one flash."""

    target_pixels: int  # pixels with any light of the target
    filled_pixels: float  # area of the target in the image
    brightest_photons: float
    median_photons: float  # of the pixels with light of the target
    detection_probability: float  # of the pixel that is found most easily
    expected_returns: float  # sum of the probabilities over all pixels
    found_probability: float  # of the whole target: enough pixels report it, in enough flashes


NO_OPPORTUNITY = DetectionOpportunity(0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class DetectionCurve:
    """The probability that a pixel reports a return, as a function of its expected photons."""

    log_photons: np.ndarray
    probability: np.ndarray

    def __call__(self, photons: np.ndarray) -> np.ndarray:
        """Return the probability (…) for expected photons (…)."""
        logs = np.log10(np.maximum(photons, 1e-12))
        low = self.probability[0] * np.minimum(photons / 10.0 ** self.log_photons[0], 1.0)
        probability: np.ndarray = np.where(
            logs < self.log_photons[0], low, np.interp(logs, self.log_photons, self.probability)
        )
        return probability


def find_detection_curve(lidar: Lidar) -> DetectionCurve:
    """Compute the detection curve of a lidar in the dark: by the detector's formula where it has one, else by trials.

    Trials use a plate at 145 levels of 1 to a million photons, with 200 pixels for each (fewer for a long gate). Isotonic
    regression then makes the curve monotonic. The binomial error of a level is at most 0.035.
    """
    from scipy.optimize import isotonic_regression

    logs = np.linspace(*_DECADES, _LEVELS)
    detector, traits = lidar.detector, lidar.detector.traits
    known = detection_probability(detector, 10.0**logs)
    if known is not None:
        return DetectionCurve(logs, known)
    n = max(min(_TRIALS, _MOST_SAMPLES // (traits.samples * traits.pulses * _LEVELS)), _FEWEST)
    photons = np.repeat(10.0**logs, n)
    middle_m = 0.5 * (traits.sees_from_m + min(traits.sees_to_m, 1e6))
    rng = np.random.Generator(np.random.Philox(_LEVELS))
    hit = make_plate(photons, photons.size, lidar.laser.pulse, lidar.laser.pulse_fwhm_s, max(middle_m - 0.5, 0.0))
    share = run_trial(detector, hit, rng).detected.reshape(_LEVELS, n).mean(axis=1)
    return DetectionCurve(logs, np.asarray(isotonic_regression(share).x))


def find_opportunities(
    scenario: Scenario,
    truth: Truth,
    rows: Sequence[int],
    target: int,
    box_pixels: np.ndarray,
    executor: Executor | None = None,
) -> list[DetectionOpportunity]:
    """Find the detection opportunities of a target at some epochs.

    Light is spread, distorted and blocked as in a rendered frame, without pulse-to-pulse jitter and without sunlight.

    Parameters
    ----------
    rows : indices of the epochs
    target : index of the target
    box_pixels : (time) area of all targets' bounds in the field, which determines the grid of rays [pixels]
    executor : whose workers cast rays (None: threads of this process)
    """
    _ = scenario.surfaces
    curve = find_detection_curve(scenario.instrument)
    most_rays = _MOST_RAYS / max(len(rows), 1)

    seen = [row for row in rows if box_pixels[row] > 0.0]
    flashes = [(truth.at(row), math.isqrt(max(int(most_rays / box_pixels[row]), 1))) for row in seen]
    evaluated = map_parts(partial(_evaluate_flashes, scenario, target, curve), flashes, executor)
    known = dict(zip(seen, evaluated, strict=True))
    return [known.get(row, NO_OPPORTUNITY) for row in rows]


def _evaluate_flashes(
    scenario: Scenario, target: int, curve: DetectionCurve, flashes: Sequence[tuple[Truth, int]]
) -> list[DetectionOpportunity]:
    """Compute the detection opportunities of a target in some flashes, each with its greatest number of rays."""
    return [_evaluate_flash(scenario, truth, target, finest, curve) for truth, finest in flashes]


def _evaluate_flash(
    scenario: Scenario, truth: Truth, target: int, finest: int, curve: DetectionCurve
) -> DetectionOpportunity:
    """Compute the detection opportunity of a target in one flash, with at most `finest` rays along a pixel's side."""
    lidar = scenario.instrument.at(truth.time_s)
    seen = cast_surfaces(lidar, scenario.surfaces, truth, target, finest)
    if not seen.pixel.size:
        return NO_OPPORTUNITY
    detector = lidar.detector
    light, range_m = seen.light, seen.hits.range_m[seen.light.hit]
    watched = seen.hits.target[light.hit] == target
    watched &= (range_m >= detector.traits.sees_from_m) & (range_m <= detector.traits.sees_to_m)
    n_pixels = light.shape[0] * light.shape[1]
    gain = array_load(detector, light).gain[seen.pixel]  # a lower gain reduces the signal like fewer photons do
    probability = curve(gain * np.bincount(light.pixel[watched], light.photons[watched], n_pixels)[seen.pixel])
    return DetectionOpportunity(
        target_pixels=int(seen.pixel.size),
        filled_pixels=seen.filled_pixels,
        brightest_photons=float(seen.photons.max()),
        median_photons=float(np.median(seen.photons)),
        detection_probability=float(probability.max()),
        expected_returns=float(probability.sum()),
        found_probability=find_probability(lidar, seen, scenario.finding, tried=_FLASHES),
    )
