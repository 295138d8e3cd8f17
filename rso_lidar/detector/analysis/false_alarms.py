"""How often noise triggers the pixels of a camera in the dark."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from rso_lidar.detector.chain.camera import draw_camera_pixels
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.stages.false_triggers import rates_per_s

_SAMPLED_PIXELS = 16_384  # over which rates of false triggers are averaged
_ALIKE = 0.05  # logarithm of the ratio of rates averaged; shares are good to 0.05² / 12 · max(x² exp(−x)) / 2 = 6e-5


def mean_false_alarms_per_s(gsfl: Gsfl) -> float:
    """Return how often noise triggers an armed pixel in the dark, over a camera's spread of pixels [1/s]."""
    return float(_sample_false_alarms_per_s(gsfl).mean())


def false_trigger_fraction(gsfl: Gsfl, armed_s: np.ndarray | float) -> np.ndarray:
    """Return the share of a camera's pixels that noise triggers in the dark within times (…) after arming [s]."""
    rates, pixels = _group_false_alarms_per_s(gsfl)
    share: np.ndarray = -np.expm1(-np.multiply.outer(np.asarray(armed_s, dtype=float), rates)) @ (pixels / pixels.sum())
    return share


@lru_cache(maxsize=64)
def nominal_false_alarms_per_s(gsfl: Gsfl) -> float:
    """Return how often noise triggers an armed pixel of nominal threshold and dark current in the dark [1/s]."""
    threshold, dark = np.array([gsfl.trigger.threshold_electrons]), np.array([gsfl.apd.dark_electrons_per_s])
    return float(rates_per_s(gsfl.apd, gsfl.amplifier, threshold, dark)[0])


def _sample_false_alarms_per_s(gsfl: Gsfl) -> np.ndarray:
    """Return how often noise triggers each live pixel of a camera in the dark [1/s]."""
    pixels = draw_camera_pixels(gsfl, _SAMPLED_PIXELS)
    threshold = gsfl.trigger.threshold_electrons * pixels.threshold
    rates: np.ndarray = rates_per_s(gsfl.apd, gsfl.amplifier, threshold, pixels.dark_per_s)[~pixels.dead]
    return rates


@lru_cache(maxsize=16)
def _group_false_alarms_per_s(gsfl: Gsfl) -> tuple[np.ndarray, np.ndarray]:
    """Return the different rates (group) [1/s] of false triggers in a camera, and how many pixels have each."""
    rates = _sample_false_alarms_per_s(gsfl)
    logs = np.rint(np.log(np.maximum(rates, np.finfo(float).tiny)) / _ALIKE)
    _, group, pixels = np.unique(logs, return_inverse=True, return_counts=True)
    return np.bincount(group, rates) / pixels, pixels
