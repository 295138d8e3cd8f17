"""Photons in, counts out."""

from typing import Annotated

import numpy as np
from pydantic import Field

from rso_lidar.detector.amplifier import Amplifier
from rso_lidar.detector.apd import Apd
from rso_lidar.detector.empirical import Empirical
from rso_lidar.detector.focal_plane import Crosstalk, Defects, Droop, Maps, Saturation, Speckle, Timing
from rso_lidar.detector.gate import Gate
from rso_lidar.detector.gsfl import Gsfl
from rso_lidar.detector.ranging import Ranging
from rso_lidar.detector.readout import Readout
from rso_lidar.detector.trigger import Trigger
from rso_lidar.records import Photons, Reading, Waveforms

Detector = Annotated[Gsfl | Empirical, Field(discriminator="type")]

__all__ = [
    "Amplifier",
    "Apd",
    "Crosstalk",
    "Defects",
    "Detector",
    "Droop",
    "Empirical",
    "Gate",
    "Gsfl",
    "Maps",
    "Ranging",
    "Readout",
    "Saturation",
    "Speckle",
    "Timing",
    "Trigger",
    "detect",
]


def detect(photons: Photons, detector: Gsfl | Empirical, rng: np.random.Generator) -> tuple[Reading, Waveforms | None]:
    """Return what the sensor says of one flash, and what it stored to say so (None: it has no waveforms).

    All noise comes from `rng`.
    """
    return detector.detect(photons, rng)
