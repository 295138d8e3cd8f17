"""The camera of a detector, and how often noise triggers its pixels."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.stages.false_triggers import rates_per_s
from rso_lidar.detector.stages.nonuniformity import CameraPixels, make_camera

_SAMPLED_PIXELS = 16_384  # over which rates of false triggers are averaged
_ALIKE = 0.05  # logarithm of the ratio of rates averaged; shares are good to 0.05² / 12 · max(x² exp(−x)) / 2 = 6e-5


def build_camera(gsfl: Gsfl, n_pixels: int) -> CameraPixels:
    """Build the pixels of this detector's camera."""
    spread = gsfl.trigger.threshold_spread_fraction
    return make_camera(n_pixels, gsfl.camera_seed, gsfl.apd, spread, gsfl.maps, gsfl.defects)


def mean_false_alarms_per_s(gsfl: Gsfl) -> float:
    """Return how often noise triggers an armed pixel in the dark, over a camera's spread of pixels [1/s]."""
    return float(_sample_false_alarms_per_s(gsfl).mean())


def false_trigger_fraction(gsfl: Gsfl, armed_s: np.ndarray | float) -> np.ndarray:
    """Return the share of a camera's pixels that noise triggers in the dark within a time.

    Parameters
    ----------
    gsfl : the detector.
    armed_s : times since the pixels were armed, any shape [s].

    Returns
    -------
    shares, in the shape of the times.
    """
    rates, pixels = _group_false_alarms_per_s(gsfl)
    share: np.ndarray = -np.expm1(-np.multiply.outer(np.asarray(armed_s, dtype=float), rates)) @ (pixels / pixels.sum())
    return share


def nominal_false_alarms_per_s(gsfl: Gsfl) -> float:
    """Return how often noise triggers an armed pixel of nominal threshold and dark current in the dark [1/s]."""
    threshold, dark = np.array([gsfl.trigger.threshold_electrons]), np.array([gsfl.apd.dark_electrons_per_s])
    return float(rates_per_s(gsfl.apd, gsfl.amplifier, threshold, dark)[0])


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


@lru_cache(maxsize=16)
def _group_false_alarms_per_s(gsfl: Gsfl) -> tuple[np.ndarray, np.ndarray]:
    """Return the different rates (group) [1/s] of false triggers in a camera, and how many pixels have each."""
    rates = _sample_false_alarms_per_s(gsfl)
    logs = np.rint(np.log(np.maximum(rates, np.finfo(float).tiny)) / _ALIKE)
    _, group, pixels = np.unique(logs, return_inverse=True, return_counts=True)
    return np.bincount(group, rates) / pixels, pixels
