"""Separations at which a detector lists two returns of a pixel."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.detector.bench.trial import make_point_returns
from rso_lidar.detector.detection import AnyDetector, detect, isolate
from rso_lidar.detector.ranging.pulse import LaserPulse

_EACH = 64  # trials of a separation: standard error of a probability at most 0.06
_TOLERANCE_M = 0.5  # within which a report is that of a return
SIGNAL_OVER_THRESHOLD = 5.0  # times the threshold, the light of each return
_MARGIN_M = 20.0  # from the ends of the armed window, where that is long enough
_SEED = 9  # random seed of the trials


@dataclass(frozen=True, eq=False)
class Separations:
    """Probability that both of two returns are listed, against their separation.

    Parameters
    ----------
    separation_m : (separation) distance of the two in range [m], ascending
    probability : (separation) that both are listed
    """

    separation_m: np.ndarray
    probability: np.ndarray

    def interval_m(self, probability: float = 0.5) -> tuple[float, float] | None:
        """Return the least and the greatest separation [m] at which both are listed with this probability; None without any.

        They are the interpolated ends of the interval around the separation with the greatest probability.
        """
        likely = self.probability >= probability
        if not likely.any():
            return None
        best = int(np.flatnonzero(self.probability == self.probability.max()).mean())
        best = best if likely[best] else int(self.probability.argmax())
        before, after = np.flatnonzero(~likely[:best]), np.flatnonzero(~likely[best:])
        first = int(before[-1]) + 1 if len(before) else 0
        last = best + int(after[0]) - 1 if len(after) else len(likely) - 1
        return self._interpolate(first - 1, first, probability), self._interpolate(last + 1, last, probability)

    def _interpolate(self, out: int, inside: int, probability: float) -> float:
        """Interpolate the separation [m] at which the probability is passed, between one below (`out`) and one not."""
        if not 0 <= out < len(self.probability):
            return float(self.separation_m[inside])
        low, high = self.probability[out], self.probability[inside]
        share = (probability - low) / max(high - low, 1e-9)
        return float(self.separation_m[out] + share * (self.separation_m[inside] - self.separation_m[out]))


def simulate_pairs(
    detector: AnyDetector,
    pulse: tuple[float, np.ndarray],
    pulse_fwhm_s: float,
    separation_m: np.ndarray,
    photons: tuple[float, float] | None = None,
    each: int = _EACH,
) -> Separations:
    """Simulate how often both of two returns of a pixel are listed, through the whole chain; the same draws each time.

    A pair is resolved if a report is within half a metre of each, or within half their separation if that is less.

    Parameters
    ----------
    pulse : the laser's step [s] and power (tap) [1/s]
    pulse_fwhm_s : its length [s]
    separation_m : (separation) distances of the two in range [m]
    photons : of the near and the far return (None: five times the threshold each)
    each : trials of each separation
    """
    traits = detector.traits
    near, far = photons or (SIGNAL_OVER_THRESHOLD * traits.threshold_photons,) * 2
    separation = np.repeat(np.asarray(separation_m, dtype=float), each)
    n = len(separation)
    phase = np.modf(np.arange(n) * 0.618_033_988_749_894_9)[0] * traits.clock_s * units.RANGE_PER_DELAY_M_S
    near_m = traits.sees_from_m + _MARGIN_M + phase
    if traits.is_gated or float((near_m + separation).max()) + _MARGIN_M > traits.sees_to_m:
        near_m = np.maximum(0.5 * (traits.sees_from_m + traits.sees_to_m - separation) + phase, 0.1)
    true_m = np.stack([near_m, near_m + separation], axis=1)
    light = make_point_returns(
        (1, n), pulse, pulse_fwhm_s, np.repeat(np.arange(n), 2), true_m.ravel(), np.tile([float(near), float(far)], n)
    )
    reading, _ = detect(light, isolate(detector), np.random.Generator(np.random.Philox(_SEED)))
    assert reading.return_range_m is not None, "a detector that lists one return has no second"
    listed_m = reading.return_range_m.reshape(n, 1, -1).astype(float)
    within_m = np.minimum(_TOLERANCE_M, 0.5 * separation)[:, None, None]
    with np.errstate(invalid="ignore"):
        resolved = (np.abs(listed_m - true_m[:, :, None]) < within_m).any(axis=2).all(axis=1)
    return Separations(np.asarray(separation_m, dtype=float), resolved.reshape(-1, each).mean(axis=1))


def simulate_separations(
    detector: AnyDetector, pulse: tuple[float, np.ndarray], pulse_fwhm_s: float, over: float = SIGNAL_OVER_THRESHOLD
) -> Separations:
    """Simulate pairs at the separations that matter: about the pulse's length, and about the end of the stored depth.

    Parameters
    ----------
    detector : the detector, with at least two returns listed
    pulse : the laser's step [s] and power (tap) [1/s]
    pulse_fwhm_s : its length [s]
    over : light of each return over the threshold

    Returns
    -------
    probability at each separation that both are listed.
    """
    hashable: Any = detector  # as every detector is
    return _simulate_listed(hashable, LaserPulse(*pulse, float(pulse_fwhm_s)), over)


@lru_cache(maxsize=16)
def _simulate_listed(detector: Any, pulse: LaserPulse, over: float) -> Separations:
    """Simulate what `simulate_separations` returns, cached."""
    traits, width_m = detector.traits, pulse.fwhm_s * units.RANGE_PER_DELAY_M_S
    stored_m = min(traits.stored_behind_m, traits.sees_to_m - traits.sees_from_m)
    near = np.linspace(0.25 * width_m, 3.0 * width_m, 45)
    far = np.linspace(max(stored_m - 3.0 * width_m, 0.25 * width_m), stored_m + 0.5 * width_m, 45)
    separation_m = np.unique(np.concatenate([near, far]).round(3))
    light = over * traits.threshold_photons
    return simulate_pairs(detector, (pulse.step_s, pulse.power_per_s), pulse.fwhm_s, separation_m, (light, light))
