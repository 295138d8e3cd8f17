"""The empirical detector as the package uses it: readings and closed forms by its curves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.detector.analysis.built_detector import BuiltDetector
from rso_lidar.detector.analysis.closed_form import Prediction
from rso_lidar.detector.analysis.pixel_reports import combine_clusters
from rso_lidar.detector.chain.curves import detect_by_curves
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.detector.settings.empirical import Empirical
from rso_lidar.records import Photons, Reading


@dataclass(frozen=True)
class BuiltEmpirical(BuiltDetector):
    """The empirical detector."""

    part: Empirical

    def detect(self, photons: Photons, rng: np.random.Generator, threads: int | None) -> tuple[Reading, None]:
        """Read the curves."""
        return detect_by_curves(self.part, photons, rng), None

    def describe(self, n_pixels: int) -> list[str]:
        """Describe the detector in one line."""
        empirical = self.part
        return [
            f"detector    empirical, 95 % at {empirical.reference_photons:g} photons, "
            f"armed {empirical.armed_from_m:g} to {empirical.armed_to_m:g} m"
        ]

    def false_alarm_probability(self, range_m: np.ndarray) -> np.ndarray:
        """Return the probability (range) of a false alarm before light from there comes."""
        empirical = self.part
        armed_m = np.clip(range_m, empirical.armed_from_m, empirical.armed_to_m) - empirical.armed_from_m
        before: np.ndarray = -np.expm1(-empirical.false_alarms_per_s * (armed_m / units.RANGE_PER_DELAY_M_S))
        return before

    def detection_probability(self, photons: np.ndarray) -> np.ndarray:
        """Return the probability (return) of detection."""
        return self.part.detection_probability(photons)

    def predict_closed_form(
        self, pulse: LaserPulse, photons: np.ndarray, depth_s: np.ndarray, only_probability: bool
    ) -> Prediction:
        """Predict by the curves, on which depth has no effect."""
        empirical = self.part
        jitter_m = pulse.timing_jitter_ns * (units.NS * units.RANGE_PER_DELAY_M_S)
        precision_m = np.hypot(empirical.range_noise_m(photons, pulse.fwhm_s), jitter_m)
        return Prediction(
            np.where(photons > 0.0, empirical.detection_probability(photons), 0.0),
            np.where(photons > 0.0, precision_m, np.inf),
            photons / empirical.noise_photons(photons),
            empirical.counts(photons) >= empirical.full_scale_counts,
        )

    def report_probability(self, photons: Photons, mine: np.ndarray) -> np.ndarray | None:
        """Return the probability (pixel) that a pixel reports one of some returns."""
        empirical = self.part
        signal = np.bincount(photons.cluster, photons.photons, len(photons.cluster_pixel))
        rate = np.full(signal.shape, empirical.false_alarms_per_s)
        window_m, detected = (empirical.armed_from_m, empirical.armed_to_m), empirical.detection_probability(signal)
        return combine_clusters(photons, mine, detected, rate, window_m, lists_several=False)
