"""Closed form of the reports of a whole flash: the probability of each pixel, from its returns of any depth.

The light of a cluster is summed as the amplifier sums it. The highest sum, in photons of a return without depth, decides
whether the cluster triggers. A pixel reports the cluster that triggers first, unless a false alarm comes before it. Clusters
are farther apart than a pulse, so that their noise is taken as independent. Each pixel has its own threshold, that of its
camera.
"""

from __future__ import annotations

import threading
from functools import lru_cache

import numpy as np

from rso_lidar import units
from rso_lidar.detector.analysis.closed_form import predict_gsfl
from rso_lidar.detector.chain.camera import FlashCamera, build_camera
from rso_lidar.detector.ranging.pulse import LaserPulse, Pulse
from rso_lidar.detector.settings.apd import noise_rms
from rso_lidar.detector.settings.focal_plane import Timing
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.stages.false_triggers import rates_per_s
from rso_lidar.errors import ScenarioError
from rso_lidar.records import Photons

# Of a pulse's length: light that is closer is summed without its delay, which changes the peak by 0.3 % at most.
_BINS = 16
_REACH = 32  # bins to each side of the pulse's peak
_LEVELS = np.array([0.25, 0.4, 0.55, 0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.4, 1.6, 2.0, 2.5])  # photons over the threshold's
_SURE_PHOTONS = 8.0  # times the threshold: a cluster this bright is detected, wherever its light is within it
_DEPTHS = np.array([0.0, 0.5, 1.0, 2.0, 4.0])  # of light, in pulse lengths
_LEAST = 1e-9  # probability at which a curve ends

_tables = threading.Lock()  # of several threads one computes a table, and the others wait for it
_GROWTH_STEP = 0.113_328_685_307_003_3  # log 1.12 of noise in sunlight over that in the dark, between levels
_NO_GROWTH = 0.019_802_627_296_179_73  # log 1.02: less sunlight counts as none


def report_probability_gsfl(gsfl: Gsfl, photons: Photons, mine: np.ndarray, flashes: int = 1) -> np.ndarray | None:
    """Return the probability (pixel) that a pixel of the full chain reports one of some returns.

    Parameters
    ----------
    mine : (return) whether a report of this return counts
    flashes : number of flashes whose pixels `photons` lists one flash after another; the same pixels see each of them

    Returns
    -------
    (pixel) probability, or None where the closed form does not hold for the amplifier or for several returns in a gate.
    """
    n_pixels, pixel = photons.shape[0] * photons.shape[1] // flashes, photons.cluster_pixel
    camera = build_camera(gsfl, LaserPulse.of(photons), n_pixels)
    if flashes > 1:
        camera = camera.select(np.tile(np.arange(n_pixels), flashes))
    sunlight = np.zeros(len(pixel))
    if photons.background_photons_per_s is not None:
        sunlight = photons.background_photons_per_s.ravel()[pixel]
    rate = np.zeros(len(pixel))
    detected = np.zeros(len(pixel))
    try:
        for level, weight in split_sunlight(gsfl, sunlight):
            detected += weight * _detect_clusters(_raise_dark_current(gsfl, level), camera, photons)
        if gsfl.gate is None and sunlight.any():
            pixels = camera.front.pixels
            threshold = gsfl.trigger.threshold_electrons * pixels.threshold[pixel]
            base = pixels.dark_per_s[pixel] + gsfl.quantum_efficiency * sunlight
            rate = rates_per_s(gsfl.apd, gsfl.amplifier, threshold, base)
        elif gsfl.gate is None:
            rate = camera.comparators.rates(None).alive_per_s[pixel]
    except ScenarioError:  # the amplifier is too fast for the closed form
        return None
    lists_several = gsfl.gate is not None and (gsfl.returns != "first" or gsfl.max_returns > 1)
    return combine_clusters(
        photons, mine, detected, rate, (gsfl.sees_from_m, gsfl.sees_to_m), lists_several=lists_several
    )


def _raise_dark_current(gsfl: Gsfl, background_photons_per_s: float) -> Gsfl:
    """Return a detector whose noise in the dark is that of this one under sunlight, without what the closed form ignores.

    Photoelectrons of sunlight and of the dark current are multiplied alike, and the baseline takes the mean of both. What
    differs from frame to frame without an effect on a pixel that looks at light is set to one value, so that tables made
    for one frame serve the others.
    """
    extra_na = gsfl.quantum_efficiency * background_photons_per_s * units.ELEMENTARY_CHARGE_C / units.NA
    gate = None if gsfl.gate is None else gsfl.gate.replace(delay_ns=0.0)
    apd = gsfl.apd.replace(dark_current_na=gsfl.apd.dark_current_na + extra_na)
    window = {"armed_from_m": 0.0, "armed_to_m": 1.0}
    return gsfl.replace(apd=apd, gate=gate, camera_seed=0, timing=Timing(), returns="first", max_returns=1, **window)


def _detect_clusters(dark: Gsfl, camera: FlashCamera, photons: Photons) -> np.ndarray:
    """Return the probability (cluster) that each cluster triggers, or is found in the gate, if it is alone in its pixel.

    Parameters
    ----------
    dark : the detector with the noise in force, in the dark
    """
    pulse, shape = LaserPulse.of(photons), camera.pulse
    threshold_photons = dark.traits.threshold_photons / shape.peak
    signal = _sum_clusters(photons, shape, _SURE_PHOTONS * threshold_photons)
    if dark.gate is not None:
        predicted = predict_gsfl(dark, pulse, signal, np.zeros(signal.shape), only_probability=True)
        return predicted.probability * (1.0 - dark.gate.false_alarm_probability)
    with _tables:
        curve = _tabulate_curve(dark, threshold_photons, pulse)
        levels, gains = _tabulate_depths(dark, threshold_photons, pulse)
    total = np.bincount(photons.cluster, photons.photons, len(photons.cluster_pixel))
    level = signal / np.where(total > 0.0, total, 1.0)
    return curve.read(
        signal * np.interp(level, levels[::-1], gains[::-1]), camera.front.pixels.threshold[photons.cluster_pixel]
    )


def combine_clusters(
    photons: Photons,
    mine: np.ndarray,
    detected: np.ndarray,
    false_rate_per_s: np.ndarray,
    window_m: tuple[float, float],
    *,
    lists_several: bool,
) -> np.ndarray | None:
    """Combine the clusters of each pixel to the probability that it reports one that counts.

    Parameters
    ----------
    mine : (return) whether a report of this return counts. A cluster counts where most of its light does
    detected : (cluster) probability that it triggers
    false_rate_per_s : (cluster) rate of false alarms of its pixel [1/s]
    window_m : nearest and farthest range at which the pixels are armed [m]
    lists_several : whether a pixel can report a farther cluster than the first that triggers. The probability of one that
        counts is then not known in the presence of others (None)
    """
    n_pixels, n_clusters = photons.shape[0] * photons.shape[1], len(photons.cluster_pixel)
    pixel = photons.cluster_pixel
    light = np.bincount(photons.cluster, photons.photons, n_clusters)
    own = np.bincount(photons.cluster[mine], photons.photons[mine], n_clusters)
    summed_s = np.bincount(photons.cluster, photons.photons * photons.delay_s, n_clusters)
    range_m = summed_s / np.where(light > 0.0, light, 1.0) * units.RANGE_PER_DELAY_M_S
    counts = own > 0.5 * light
    armed = (range_m >= window_m[0]) & (range_m <= window_m[1]) & (light > 0.0)
    detected = np.where(armed, detected, 0.0)
    quiet = np.exp(-false_rate_per_s * np.maximum(range_m - window_m[0], 0.0) / units.RANGE_PER_DELAY_M_S)
    if lists_several and np.any((detected > _LEAST) & ~counts & np.isin(pixel, pixel[counts])):
        return None
    reported, missed = np.zeros(n_pixels), np.ones(n_pixels)
    first = np.searchsorted(pixel, pixel)  # of the clusters of the same pixel
    rank = np.arange(n_clusters) - first
    for place in range(int(rank.max(initial=-1)) + 1):
        some = np.flatnonzero(rank == place)
        at, chance = pixel[some], detected[some]
        reported[at] += missed[at] * chance * quiet[some] * counts[some]
        missed[at] *= 1.0 - chance
    return np.clip(reported, 0.0, 1.0)


def _sum_clusters(photons: Photons, pulse: Pulse, sure_photons: float) -> np.ndarray:
    """Return the photons (cluster) of a return without depth whose amplitude is as high as that of each cluster.

    Parameters
    ----------
    sure_photons : photons that are detected in any case; brighter clusters are only bounded from below
    """
    n_clusters = len(photons.cluster_pixel)
    signal = np.bincount(photons.cluster, photons.photons, n_clusters)
    early_s, late_s = np.full(n_clusters, np.inf), np.full(n_clusters, -np.inf)
    np.minimum.at(early_s, photons.cluster, photons.delay_s)
    np.maximum.at(late_s, photons.cluster, photons.delay_s)
    bin_s = photons.pulse_fwhm_s / _BINS
    length = np.floor((late_s - early_s) / bin_s).astype(np.int64) + 1
    least = signal / (1.0 + length / _BINS)
    deep = (length > 1) & (least < sure_photons)
    signal = np.where(deep | (length == 1), signal, least)
    if not deep.any():
        return signal
    # All deep clusters in one row of bins, far enough apart that their pulses do not meet.
    begin = np.cumsum(np.where(deep, length + 2 * _REACH, 0)) - np.where(deep, length + _REACH, 0)
    of = deep[photons.cluster]
    cluster = photons.cluster[of]
    place = begin[cluster] + np.floor((photons.delay_s[of] - early_s[cluster]) / bin_s).astype(np.int64)
    light = np.bincount(place, photons.photons[of], int((length[deep] + 2 * _REACH).sum()))
    lag_s = np.arange(-_REACH, _REACH + 1) * bin_s
    summed = np.convolve(light, pulse.amplitude(pulse.peak_s + lag_s) / pulse.peak, "same")
    signal[deep] = np.maximum.reduceat(summed, begin[deep] - _REACH)
    return signal


class _TriggerCurve:
    """Detection of a return without depth in a pixel, by its photons and the factor of its threshold.

    At the peak the amplitude of u times the threshold's photons is normal about u, with the variance a + b u. The table
    holds how far the normal number of the true probability is from that of (u − t) / √(a + b u), t the factor. The rest of
    the pulse and the skewness of the avalanche make that difference, which t hardly changes.
    """

    def __init__(self, threshold_photons: float, still: float, shot: float, beside: np.ndarray) -> None:
        """Keep the curve.

        Parameters
        ----------
        threshold_photons : photons that reach the nominal threshold
        still, shot : a and b
        beside : (level) differences at `_LEVELS`
        """
        self._photons, self._still, self._shot, self._beside = threshold_photons, still, shot, beside

    def read(self, photons: np.ndarray, factor: np.ndarray) -> np.ndarray:
        """Return the probability (return) of detection."""
        from scipy.special import ndtr

        u = photons / self._photons
        normal = (u - factor) / np.sqrt(self._still + self._shot * u) + np.interp(u / factor, _LEVELS, self._beside)
        probability: np.ndarray = np.where(photons > 0.0, ndtr(normal), 0.0)
        return probability


@lru_cache(maxsize=64)
def _tabulate_curve(gsfl: Gsfl, threshold_photons: float, pulse: LaserPulse) -> _TriggerCurve:
    """Return the curve of a self-triggering camera.

    Parameters
    ----------
    threshold_photons : photons whose amplitude reaches the nominal threshold
    """
    from scipy.special import ndtri

    exact = gsfl.replace(trigger=gsfl.trigger.replace(threshold_spread_fraction=0.0))
    known = predict_gsfl(exact, pulse, threshold_photons * _LEVELS, np.zeros(_LEVELS.shape))
    shot, still = np.polyfit(_LEVELS, (_LEVELS / known.snr) ** 2, 1)
    still, shot = max(float(still), 1e-12), max(float(shot), 0.0)
    normal = ndtri(np.clip(known.probability, _LEAST, 1.0 - _LEAST))
    return _TriggerCurve(threshold_photons, still, shot, normal - (_LEVELS - 1.0) / np.sqrt(still + shot * _LEVELS))


@lru_cache(maxsize=64)
def _tabulate_depths(gsfl: Gsfl, threshold_photons: float, pulse: LaserPulse) -> tuple[np.ndarray, np.ndarray]:
    """Return how much easier light of some depth is to detect than its highest sum says, because it lasts longer.

    Returns
    -------
    (depth) falling: highest sum over the photons, for light spread evenly over `_DEPTHS`; and the factor of that sum with
    which a return without depth is detected in half of all flashes too.
    """
    from scipy.special import ndtri

    fwhm_s = pulse.fwhm_s
    shape = Pulse.after(pulse.step_s, pulse.power_per_s, gsfl.amplifier.pole_s, gsfl.amplifier.integration_s)
    exact = gsfl.replace(trigger=gsfl.trigger.replace(threshold_spread_fraction=0.0))
    levels, needed = [], []
    for depth in _DEPTHS.tolist():
        spread_s = depth * fwhm_s * (np.arange(65) / 64.0 - 0.5)
        at_s = shape.peak_s + fwhm_s * np.linspace(-1.0, 1.0, 81)
        highest = float(shape.amplitude(at_s[:, None] - spread_s).mean(axis=1).max()) / shape.peak
        light = threshold_photons / highest * np.array([0.75, 0.9, 1.05])
        depth_s = np.full(light.shape, depth * fwhm_s)
        known = predict_gsfl(exact, pulse, light, depth_s, only_probability=True)
        normal = ndtri(np.clip(known.probability, _LEAST, 1.0 - _LEAST))
        levels.append(highest)
        needed.append(float(np.interp(0.0, normal, light)) * highest)
    return np.array(levels), needed[0] / np.array(needed)


def split_sunlight(gsfl: Gsfl, background_photons_per_s: np.ndarray) -> list[tuple[float, np.ndarray]]:
    """Split sunlight between levels of the noise that it makes, a factor of 1.12 apart, for linear interpolation.

    Parameters
    ----------
    background_photons_per_s : (pixel) sunlight [photons/s]

    Returns
    -------
    levels of sunlight [photons/s], each with the weights (pixel) of what is computed at it. They sum to 1 in each pixel.
    """
    amplifier, apd = gsfl.amplifier, gsfl.apd
    dark_variance = gsfl.noise_electrons**2
    shot = float(noise_rms(apd, gsfl.quantum_efficiency, 0.0, amplifier.pole_s, amplifier.integration_s)) ** 2
    if dark_variance == 0.0:  # no noise that could grow: sunlight is a few steps of its own
        dark_variance = shot * max(float(background_photons_per_s.max(initial=0.0)), 1.0) * 1e-3
    growth = 0.5 * np.log1p(background_photons_per_s * (shot / dark_variance))
    place = np.where(growth < _NO_GROWTH, 0.0, growth / _GROWTH_STEP)
    split = []
    for k in np.unique([np.floor(place), np.ceil(place)]):
        weight = np.maximum(1.0 - np.abs(place - k), 0.0)
        split.append((float(np.expm1(2.0 * k * _GROWTH_STEP) * dark_variance / shot), weight))
    return split
