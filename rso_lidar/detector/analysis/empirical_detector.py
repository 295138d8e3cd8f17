"""The empirical detector as the package uses it: readings and closed forms by its curves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.detector.analysis.built_detector import BuiltDetector
from rso_lidar.detector.analysis.closed_form import Prediction
from rso_lidar.detector.analysis.pixel_reports import combine_clusters
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.detector.settings.empirical import Empirical
from rso_lidar.records import Photons, Reading


@dataclass(frozen=True)
class BuiltEmpirical(BuiltDetector):
    """The empirical detector."""

    part: Empirical

    def detect(self, photons: Photons, rng: np.random.Generator, threads: int | None) -> tuple[Reading, None]:
        """Return a random reading of one flash by the curves."""
        empirical = self.part
        n_pixels = photons.shape[0] * photons.shape[1]
        n_clusters = len(photons.cluster_pixel)
        signal = np.bincount(photons.cluster, photons.photons, n_clusters)
        share = np.where(signal[photons.cluster] > 0.0, photons.photons, 1.0)
        delay_s = np.bincount(photons.cluster, share * photons.delay_s, n_clusters) / np.bincount(
            photons.cluster, share, n_clusters
        )

        # Every draw is always made, so that a frame's noise depends only on its generator.
        false_delay_s = empirical.armed_from_m / units.RANGE_PER_DELAY_M_S + _draw_first_false_s(
            empirical.false_alarms_per_s, rng, n_pixels
        )
        noise = rng.standard_normal((2, n_clusters))
        false_excess = rng.standard_exponential(n_pixels)

        seen = signal + noise[0] * empirical.noise_photons(signal)
        delay_s = delay_s + photons.late_s
        range_m = delay_s * units.RANGE_PER_DELAY_M_S
        armed = (range_m >= empirical.armed_from_m) & (range_m <= empirical.armed_to_m)
        triggers = np.flatnonzero((seen >= empirical.threshold_photons) & armed)
        pixel, first = np.unique(photons.cluster_pixel[triggers], return_index=True)  # clusters run from near to far
        latched = triggers[first]

        report_m = np.full(n_pixels, np.nan)
        report_photons = np.zeros(n_pixels)
        spread_m = empirical.range_noise_m(signal[latched], photons.pulse_fwhm_s)
        report_m[pixel] = range_m[latched] + noise[1][latched] * spread_m
        report_photons[pixel] = signal[latched] + noise[0][latched] * _intensity_noise_photons(
            empirical, signal[latched]
        )

        true_delay_s = np.full(n_pixels, np.inf)
        true_delay_s[pixel] = delay_s[latched]
        window_end_s = empirical.armed_to_m / units.RANGE_PER_DELAY_M_S
        false = np.flatnonzero(false_delay_s < np.minimum(true_delay_s, window_end_s))
        report_m[false] = false_delay_s[false] * units.RANGE_PER_DELAY_M_S
        report_photons[false] = _false_photons(empirical, false_excess[false])
        return _quantise(empirical, report_m, report_photons, photons.shape), None

    def describe(self, n_pixels: int) -> list[str]:
        """Describe the detector in a line, and its words in another."""
        empirical = self.part
        words = [] if empirical.report is None else [empirical.report.describe()]
        return [
            f"detector    empirical, 95 % at {empirical.reference_photons:g} photons, "
            f"armed {empirical.armed_from_m:g} to {empirical.armed_to_m:g} m",
            *words,
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


def _intensity_noise_photons(empirical: Empirical, photons: np.ndarray) -> np.ndarray:
    """Return the standard deviation [photons] of the reported intensity, by expected photons."""
    shot = empirical.intensity_excess_noise_factor * photons / empirical.quantum_efficiency
    noise_photons: np.ndarray = np.sqrt(empirical.intensity_noise_equivalent_photons**2 + shot)
    return noise_photons


def _draw_first_false_s(false_alarms_per_s: float, rng: np.random.Generator, n_pixels: int) -> np.ndarray:
    """Return when noise first triggers each pixel [s after arming]: exponential waiting, inf at rate 0."""
    waiting = rng.standard_exponential(n_pixels)
    with np.errstate(divide="ignore"):
        return waiting / false_alarms_per_s if false_alarms_per_s > 0.0 else waiting + np.inf


def _false_photons(empirical: Empirical, exponential: np.ndarray) -> np.ndarray:
    """Return the signal of false triggers: noise that just passes the threshold, by its exponential tail."""
    return (
        empirical.threshold_photons + exponential * empirical.noise_equivalent_photons**2 / empirical.threshold_photons
    )


def _quantise(
    empirical: Empirical, report_m: np.ndarray, report_photons: np.ndarray, shape: tuple[int, int]
) -> Reading:
    """Return the reading of the array, with whole counts up to full scale.

    Parameters
    ----------
    report_m : (pixel) reported range [m], NaN without a report
    report_photons : (pixel) photons of the report
    """
    reported = np.isfinite(report_m)
    counts = np.where(reported, np.clip(np.rint(empirical.counts(report_photons)), 1, empirical.full_scale_counts), 0)
    clipped = reported & (counts >= empirical.full_scale_counts)
    return Reading(report_m.reshape(shape), counts.astype(np.uint16).reshape(shape), clipped.reshape(shape))
