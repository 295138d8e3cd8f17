"""The probability that one flash finds a plate, as a smooth function of range and sunlight: the mean over a camera's pixels.

Thresholds differ from pixel to pixel, and where the plate's image falls is not known. The mean over the camera's pixels is
tabulated over range and sunlight, and interpolated. The range rate, which spreads the returns of several pulses, does not
count.
"""

from __future__ import annotations

import math

import numpy as np

from rso_lidar.mission_analysis.passes.plate_light import PlateLight
from rso_lidar.orbit import PHASE_RAD, MotionBounds, PairQuantity, PairSamples, sunlit_fraction

_STEPS = 400  # ranges: 1 % apart over a factor of 50
_FACTOR = 50.0
_SHARES = np.array([0.0, 0.25, 0.5, 1.0])  # of the sunlight that falls on the plate at phase 0 in full light


def tabulate_found(light: PlateLight) -> PairQuantity:
    """Tabulate the probability that one flash finds the plate, and return it as a quantity of two objects.

    Parameters
    ----------
    light : lidar, plate, and when it counts as found
    """
    traits = light.lidar.detector.traits
    near_m, far_m = max(traits.sees_from_m, 1.0), traits.sees_to_m
    if traits.is_gated:  # a gate is placed about the plate at any range
        near_m, far_m = 1.0, math.inf
    reach_m = _find_farthest_m(light, near_m, min(far_m, 1e9))
    ranges = np.geomspace(max(near_m, reach_m / _FACTOR), reach_m, _STEPS)
    shares = _SHARES if light.has_sunlight else _SHARES[:1]
    brightest = light.count_sunlight(ranges, np.zeros(_STEPS), np.ones(_STEPS))
    table = np.array([light.find_in_flash(ranges, np.zeros(_STEPS), share * brightest) for share in shares])
    place = np.log(ranges)
    steepest = float(np.max(np.abs(np.diff(table, axis=1)) / np.diff(place), initial=0.0))
    by_light = float(np.max(np.ptp(table, axis=0)))

    def value(pair: PairSamples) -> np.ndarray:
        at = np.log(np.clip(pair.range_m, ranges[0], ranges[-1]))
        levels = np.array([np.interp(at, place, row) for row in table])
        probability = levels[0]
        if len(levels) > 1:
            falls = np.maximum(np.cos(PHASE_RAD.value(pair)), 0.0) * sunlit_fraction(pair.target.position_m, pair.sun_m)
            below = np.clip(np.searchsorted(shares, falls, side="right") - 1, 0, len(shares) - 2)
            each = np.arange(len(at))
            part = (falls - shares[below]) / (shares[below + 1] - shares[below])
            probability = levels[below, each] + part * (levels[below + 1, each] - levels[below, each])
        beyond = (pair.range_m < near_m) | (pair.range_m > reach_m)
        return pair.keep_apart(np.where(beyond, 0.0, probability))

    def rate(bounds: MotionBounds) -> np.ndarray:
        # the probability may jump at the ends of the armed range, and sunlight changes within seconds
        jumps = _may_cross(bounds, near_m) | _may_cross(bounds, reach_m)
        change: np.ndarray = steepest * bounds.turning_rad_s + (by_light + jumps) / bounds.step_s
        return change

    return PairQuantity(value, rate)


def _may_cross(bounds: MotionBounds, range_m: float) -> np.ndarray:
    crosses: np.ndarray = (bounds.least_range_m < range_m) & (bounds.greatest_range_m > range_m)
    return crosses


def _find_farthest_m(light: PlateLight, near_m: float, far_m: float) -> float:
    """Return the range [m] from which a plate is found in less than one flash of ten thousand, at most `far_m`."""
    steps = np.geomspace(near_m, far_m, 120)
    probability = light.find_in_flash(steps, np.zeros(len(steps)), np.zeros(len(steps)))
    seen = np.flatnonzero(probability > 1e-4)
    return float(steps[min(int(seen[-1]) + 1, len(steps) - 1)]) if len(seen) else float(steps[1])
