"""Photons in, counts out."""

import numpy as np

from rso_lidar.detector.empirical import Empirical
from rso_lidar.records import Photons, Reading

__all__ = ["Empirical", "detect"]


def detect(photons: Photons, detector: Empirical, rng: np.random.Generator) -> Reading:
    """Return what the sensor says of one flash; all its noise comes from `rng`."""
    return detector.detect(photons, rng)
