"""The empirical detector at work: it detects, ranges and counts clusters of returns by the curves."""

import numpy as np

from rso_lidar import units
from rso_lidar.detector.settings.empirical import Empirical
from rso_lidar.records import Photons, Reading


def detect_by_curves(empirical: Empirical, photons: Photons, rng: np.random.Generator) -> Reading:
    """Return a random reading of the empirical detector for one flash."""
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
    report_photons[pixel] = signal[latched] + noise[0][latched] * _intensity_noise_photons(empirical, signal[latched])

    true_delay_s = np.full(n_pixels, np.inf)
    true_delay_s[pixel] = delay_s[latched]
    window_end_s = empirical.armed_to_m / units.RANGE_PER_DELAY_M_S
    false = np.flatnonzero(false_delay_s < np.minimum(true_delay_s, window_end_s))
    report_m[false] = false_delay_s[false] * units.RANGE_PER_DELAY_M_S
    report_photons[false] = _false_photons(empirical, false_excess[false])
    return _quantise(empirical, report_m, report_photons, photons.shape)


def _intensity_noise_photons(empirical: Empirical, photons: np.ndarray) -> np.ndarray:
    """Return the standard deviation [photons] of the reported intensity, by expected photons."""
    shot = empirical.intensity_excess_noise_factor * photons / empirical.quantum_efficiency
    noise_photons: np.ndarray = np.sqrt(empirical.intensity_noise_equivalent_photons**2 + shot)
    return noise_photons


def _draw_first_false_s(false_alarms_per_s: float, rng: np.random.Generator, n_pixels: int) -> np.ndarray:
    """Return when noise first triggers each pixel [s after arming]: exponential waiting, inf at rate 0.

    Parameters
    ----------
    false_alarms_per_s : rate of triggers by noise in a pixel [1/s]
    n_pixels : pixels of the array
    """
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
    shape : rows and columns
    """
    reported = np.isfinite(report_m)
    counts = np.where(reported, np.clip(np.rint(empirical.counts(report_photons)), 1, empirical.full_scale_counts), 0)
    clipped = reported & (counts >= empirical.full_scale_counts)
    return Reading(report_m.reshape(shape), counts.astype(np.uint16).reshape(shape), clipped.reshape(shape))
