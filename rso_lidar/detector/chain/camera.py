"""The camera of a detector, and how often noise triggers its pixels."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from rso_lidar import units
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.stages.false_triggers import rates_per_s
from rso_lidar.detector.stages.nonuniformity import CameraPixels, make_camera

_SAMPLED_PIXELS = 16_384  # over which rates of false triggers are averaged


def build_camera(gsfl: Gsfl, n_pixels: int) -> CameraPixels:
    """Build the pixels of this detector's camera."""
    spread = gsfl.trigger.threshold_spread_fraction
    return make_camera(n_pixels, gsfl.camera_seed, gsfl.apd, spread, gsfl.maps, gsfl.defects)


def mean_false_alarms_per_s(gsfl: Gsfl) -> float:
    """Return how often noise triggers an armed pixel in the dark, over a camera's spread of pixels [1/s]."""
    return float(_sample_false_alarms_per_s(gsfl).mean())


def false_trigger_fraction(gsfl: Gsfl) -> float:
    """Return the share of a camera's pixels that noise triggers in the dark while they are armed."""
    armed_s = (gsfl.armed_to_m - gsfl.armed_from_m) / units.RANGE_PER_DELAY_M_S
    return float(-np.expm1(-_sample_false_alarms_per_s(gsfl) * armed_s).mean())


@lru_cache(maxsize=16)
def false_alarms_per_s(gsfl: Gsfl, n_pixels: int) -> np.ndarray:
    """Return how often noise triggers each armed pixel (n_pixels) of a camera in the dark [1/s]; dead pixels as if alive."""
    camera = build_camera(gsfl, n_pixels)
    threshold = gsfl.trigger.threshold_electrons * camera.threshold
    rates: np.ndarray = rates_per_s(gsfl.apd, gsfl.amplifier, threshold, camera.dark_per_s)
    rates.flags.writeable = False
    return rates


def _sample_false_alarms_per_s(gsfl: Gsfl) -> np.ndarray:
    alive: np.ndarray = ~build_camera(gsfl, _SAMPLED_PIXELS).dead
    rates: np.ndarray = false_alarms_per_s(gsfl, _SAMPLED_PIXELS)[alive]
    return rates
