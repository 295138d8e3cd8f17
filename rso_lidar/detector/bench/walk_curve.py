"""Range walk of a detector over a dynamic range of returns, by trials through the whole chain."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rso_lidar import units
from rso_lidar.detector.bench.trial import make_plate
from rso_lidar.detector.detection import AnyDetector, detect, isolate
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.errors import ScenarioError

DYNAMIC_RANGE = 250_000.0  # of the receiver of Baharmast & Kostamovaara, Opt. Eng. 59(10) 104102 (2020)
_OVER = 2.0  # times the threshold, the weakest return: of weaker ones noise selects those that trigger
_LEVELS = 24
_PIXELS = 256  # for each level
_NEAR_M = 5.0  # a report farther from the truth is a false trigger
_SEED = 21  # random seed of the trials


@dataclass(frozen=True, eq=False)
class WalkCurve:
    """Range error of returns against their light; arrays (level).

    Parameters
    ----------
    photons : expected photons on the pixel, ascending
    found_fraction : share of the pixels that report the return
    bias_m : median range error of these [m], NaN without any
    noise_m : standard deviation of their range errors [m], NaN without any
    saturated_fraction : share of them that are flagged as saturated
    """

    photons: np.ndarray
    found_fraction: np.ndarray
    bias_m: np.ndarray
    noise_m: np.ndarray
    saturated_fraction: np.ndarray

    @property
    def half_walk_m(self) -> float:
        """Half the difference between the greatest and the least bias [m]: the ± of data sheets; NaN without a return."""
        known = self.bias_m[np.isfinite(self.bias_m)]
        return 0.5 * float(np.ptp(known)) if len(known) else math.nan


def simulate_walk_curve(
    detector: AnyDetector,
    pulse: LaserPulse,
    photons: np.ndarray | None = None,
    *,
    pixels: int = _PIXELS,
    range_m: float = 100.0,
) -> WalkCurve:
    """Simulate the range walk of a detector: the error of range at each number of photons, the same draws each time.

    Every pixel sees a facing plate that fills it. The ranges are spread over a metre, so that no phase of a clock is
    favoured. Noise and jitter are the detector's own. Effects between pixels are off.

    Parameters
    ----------
    detector : a part, or an object that follows the protocol `Detector`
    pulse : the laser's pulse
    photons : (level) expected photons. Default: 24 levels from twice the threshold to 250,000 times that
    pixels : number of pixels for each level
    range_m : least range of the plates [m]

    Returns
    -------
    bias, noise and saturation at each level.

    Raises
    ------
    ScenarioError
        If photons are not positive, finite numbers, there is no pixel, or the detector does not look where the plates are.
    """
    traits = detector.traits
    if photons is None:
        weakest = _OVER * max(traits.threshold_photons, 1e-3)
        photons = np.geomspace(weakest, DYNAMIC_RANGE * weakest, _LEVELS)
    photons = np.sort(np.asarray(photons, dtype=float).ravel())
    if not len(photons) or not np.all(np.isfinite(photons) & (photons > 0.0)):
        raise ScenarioError("photons: a walk curve needs at least one positive, finite number; correct them")
    if pixels < 1:
        raise ScenarioError(f"pixels: {pixels} leaves nothing to simulate; use at least 1")
    if not traits.sees_from_m < range_m < traits.sees_to_m - 1.0:
        raise ScenarioError(
            f"range_m: the detector does not see a plate at {range_m:g} m, only {traits.sees_from_m:g} to "
            f"{traits.sees_to_m:g} m; move the plate"
        )
    n = len(photons)
    light = make_plate(np.repeat(photons, pixels), n * pixels, (pulse.step_s, pulse.power_per_s), pulse.fwhm_s, range_m)
    light = replace(light, shape=(n, pixels))
    reading, _ = detect(light, isolate(detector), np.random.Generator(np.random.Philox(_SEED)))
    error_m = reading.range_m.astype(float) - light.delay_s.reshape(n, pixels) * units.RANGE_PER_DELAY_M_S
    with np.errstate(invalid="ignore"):
        is_near = np.abs(error_m) < _NEAR_M
    bias_m, noise_m = np.full(n, np.nan), np.full(n, np.nan)
    saturated = np.zeros(n)
    for level in np.flatnonzero(is_near.any(axis=1)):
        errors_m = error_m[level, is_near[level]]
        bias_m[level], noise_m[level] = np.median(errors_m), errors_m.std()
        saturated[level] = reading.saturated[level, is_near[level]].mean()
    return WalkCurve(photons, is_near.mean(axis=1), bias_m, noise_m, saturated)
