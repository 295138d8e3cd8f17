"""The Geiger-mode array as the package uses it: readings, texts and closed forms."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rso_lidar import units
from rso_lidar.detector.analysis.built_detector import BuiltDetector, describe_gate
from rso_lidar.detector.analysis.closed_form import Prediction
from rso_lidar.detector.analysis.reported_light import bound_reports
from rso_lidar.detector.geiger.array import GeigerArray
from rso_lidar.detector.geiger.counting import first_photon_moments, live_fraction, peak_probability
from rso_lidar.detector.geiger.histogram import count_photons
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.records import Photons, Reading

_TRIALS, _FEWEST_TRIALS, _MOST_TRIALS = 32, 8, 4000  # of a lit pixel, and of all together
_BINS_PER_PULSE = 16  # closer returns are merged for these trials
_MOST_BLOCKED = 0.5  # share of pulses that dark counts take from the middle of the gate


@dataclass(frozen=True)
class BuiltGeigerArray(BuiltDetector):
    """The Geiger-mode array."""

    part: GeigerArray

    def detect(self, photons: Photons, rng: np.random.Generator, threads: int | None) -> tuple[Reading, None]:
        """Count the photons of the pulses of one frame, and report the peaks that have counts enough.

        Returns
        -------
        reading of the frame; a detector that counts has no waveforms.
        """
        array = self.part
        peaks = count_photons(array, photons, rng, threads)
        sunlight = photons.background_photons_per_s
        least = array.find_least_counts(np.zeros(len(peaks.counts)) if sunlight is None else sunlight.ravel())
        reported = peaks.counts >= least
        range_m = np.where(reported, np.maximum(peaks.delay_s, 0.0) * units.RANGE_PER_DELAY_M_S, np.nan)
        counts = np.where(reported, np.minimum(peaks.counts, 65_535), 0).astype(np.uint16)
        full = reported & (peaks.counts >= array.pulses)
        return Reading(*(values.reshape(photons.shape) for values in (range_m, counts, full))), None

    def describe(self, n_pixels: int) -> list[str]:
        """Describe the array in two lines."""
        array = self.part
        false = float(array.false_peak_probability(np.zeros(1))[0]) * n_pixels
        words = [] if array.report is None else [array.report.describe()]
        return [
            f"detector    geiger: PDE {array.detection_efficiency:g}, dark {array.dark_count_rate_hz / 1e3:g} kHz, hold-off "
            f"{array.hold_off_ns:g} ns, bins of {array.bin_ns:g} ns, jitter {array.jitter_ns:g} ns",
            *words,
            f"  gate      {array.gate_from_m:g} to {array.gate_to_m:g} m, "
            f"{array.pulses} pulse{'s' * (array.pulses > 1)} a frame, "
            f"peaks of {array.dark_least_counts} counts in {array.peak_bins * array.bin_ns:g} ns, "
            f"{false:.2g} false alarms a frame",
        ]

    def describe_window(self) -> str:
        """Describe in a few words when the array looks."""
        array = self.part
        return describe_gate(array.gate_to_m - array.gate_from_m)

    def advise(self, pulse_fwhm_s: float) -> list[str]:
        """List what is allowed and doubtful about the array with a pulse of this length [s]."""
        array = self.part
        lines = []
        if pulse_fwhm_s > 2.0 * array.peak_s:
            lines.append(
                f"a pulse of {pulse_fwhm_s / units.NS:.3g} ns spreads its counts over more than one peak of "
                f"{array.peak_s / units.NS:.3g} ns; lengthen lidar.detector.peak_ns, or shorten the pulse"
            )
        blocked = 1.0 - _live_fraction(array)
        if blocked > _MOST_BLOCKED:
            lines.append(
                f"dark counts leave {blocked:.0%} of the pulses without a live pixel in the middle of the gate; lower "
                "lidar.detector.dark_count_rate_hz, or narrow the gate"
            )
        false = float(array.false_peak_probability(np.zeros(1))[0])
        if false > max(2.0 * array.false_alarm_probability, 0.005):
            lines.append(
                f"noise alone makes {false:.1%} of the pixels report in every frame; raise lidar.detector.least_counts "
                "or pulses"
            )
        return lines

    def list_neglected_effects(self) -> list[str]:
        """List the settings of the array that its closed form does not count."""
        array = self.part
        return ["afterpulse_probability"] if array.afterpulse_probability > 0.0 else []

    def false_alarm_probability(self, range_m: np.ndarray) -> np.ndarray:
        """Return the probability (range) that noise in the dark forms a peak, the same at any range."""
        array = self.part
        return np.full(np.shape(range_m), array.false_peak_probability(np.zeros(1))[0])

    def noise_growth(self, background_photons_per_s: float) -> float:
        """Return the rms number of noise counts under sunlight [photons/s] over that in the dark."""
        array = self.part
        dark = array.dark_count_rate_hz
        light = float(array.noise_per_s(np.array(background_photons_per_s)))
        if dark > 0.0:
            return math.sqrt(light / dark)
        return math.inf if light > 0.0 else 1.0

    def predict_closed_form(
        self,
        pulse: LaserPulse,
        photons: np.ndarray,
        depth_s: np.ndarray,
        only_probability: bool,
    ) -> Prediction:
        """Predict returns in the middle of the gate, in the dark.

        The first avalanches of a return are taken as normal about their mean. A peak holds those within its window, and the
        dark counts that fall into it in the other pulses.
        """
        from scipy.special import erf

        array = self.part

        n = array.detection_efficiency * photons.ravel()
        _, variance_s2 = first_photon_moments(n, depth_s.ravel(), pulse.step_s, pulse.power_per_s)
        jitter_s = math.hypot(array.jitter_ns, pulse.timing_jitter_ns) * units.NS
        sigma_s = np.sqrt(variance_s2 + jitter_s**2 + array.bin_s**2 / 12.0)
        half = 0.5 * array.peak_s / sigma_s
        share = erf(half / math.sqrt(2.0))
        live = _live_fraction(array)
        fired = -np.expm1(-n) * share * live
        dark = -math.expm1(-array.dark_count_rate_hz * array.peak_s) * live
        counted = 1.0 - (1.0 - fired) * (1.0 - dark)
        probability = np.where(n > 0.0, peak_probability(counted, array.pulses, array.dark_least_counts), 0.0)
        cut = (
            2.0 * half * np.exp(-0.5 * half**2) / math.sqrt(2.0 * math.pi) / share
        )  # variance that the window's ends take
        counts = np.maximum(array.pulses * fired, array.dark_least_counts)
        precision_s = sigma_s * np.sqrt((1.0 - cut) / counts)
        noise = array.pulses * (fired * (1.0 - fired) + array.dark_count_rate_hz * array.peak_s)
        snr = array.pulses * fired / np.sqrt(np.maximum(noise, 1e-12))
        members = (
            probability,
            np.where(n > 0.0, precision_s * units.RANGE_PER_DELAY_M_S, np.inf),
            np.where(n > 0.0, snr, 0.0),
            photons.ravel() >= array.traits.saturation_photons,
        )
        return Prediction(*(values.reshape(photons.shape) for values in members))

    def report_probability(self, photons: Photons, mine: np.ndarray) -> np.ndarray:
        """Estimate the probability (pixel) that a pixel reports one of some returns, by trials of the lit pixels alone.

        The report is the highest peak wherever it lies, which has no closed form for light of any depth. The pixels of the
        array do not affect each other, so that those without light need not be simulated. The random seed is fixed.
        """
        array = self.part
        n_pixels = photons.shape[0] * photons.shape[1]
        probability = np.zeros(n_pixels)
        lit = np.unique(photons.pixel[mine])
        if not lit.size:
            return probability
        low_m, high_m = (bounds[lit] for bounds in bound_reports(photons, mine))
        reported_m = try_lit_pixels(array, photons, lit)
        with np.errstate(invalid="ignore"):
            inside = (reported_m >= low_m) & (reported_m <= high_m)
        probability[lit] = inside.mean(axis=0)
        return probability


def try_lit_pixels(array: GeigerArray, photons: Photons, lit: np.ndarray) -> np.ndarray:
    """Simulate the reports of some pixels over several frames, with a fixed random seed.

    Parameters
    ----------
    lit : (lit) ascending numbers of pixels with light

    Returns
    -------
    (trial, lit) reported ranges [m], NaN where none. The number of trials falls with that of pixels, from 32 to 8.
    """
    trials = max(min(_TRIALS, _MOST_TRIALS // lit.size), _FEWEST_TRIALS)
    n = trials * lit.size
    place, delay_s, light, spread_s = _merge_returns(photons, lit)
    pixel = (np.arange(trials)[:, None] * lit.size + place).ravel()
    number = np.arange(len(pixel))
    sunlight = photons.background_photons_per_s
    row = replace(
        photons,
        shape=(1, n),
        pixel=pixel,
        delay_s=np.tile(delay_s, trials),
        photons=np.tile(light, trials),
        depth_spread_s=np.tile(spread_s, trials),
        coherence_cells=np.full(len(pixel), np.inf),
        hit=number,
        cluster=number,
        cluster_pixel=pixel,
        filled_fraction=None,
        photons_variance=None,
        epoch=None,
        pulse_epoch=None,
        background_photons_per_s=None if sunlight is None else np.tile(sunlight.ravel()[lit], trials)[None],
    )
    reading, _ = BuiltGeigerArray(array).detect(row, np.random.Generator(np.random.Philox(_TRIALS)), 1)
    return np.asarray(reading.range_m, dtype=float).reshape(trials, lit.size)


def _merge_returns(photons: Photons, lit: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Merge the returns of some pixels that are closer than a sixteenth of the pulse.

    Parameters
    ----------
    lit : (lit) ascending numbers of the pixels

    Returns
    -------
    (merged) index of the pixel in `lit`, never falling, delay [s], photons and depth spread [s].
    """
    of = np.flatnonzero(np.isin(photons.pixel, lit) & (photons.photons > 0.0))
    place = np.searchsorted(lit, photons.pixel[of])
    step = np.floor(photons.delay_s[of] * (_BINS_PER_PULSE / photons.pulse_fwhm_s)).astype(np.int64)
    pairs, group = np.unique(np.stack([place, step]), axis=1, return_inverse=True)
    group = group.ravel()
    light = np.bincount(group, photons.photons[of], pairs.shape[1])
    delay_s, spread_s = (
        np.bincount(group, photons.photons[of] * values[of], pairs.shape[1]) / light
        for values in (photons.delay_s, photons.depth_spread_s)
    )
    return pairs[0], delay_s, light, spread_s


def _live_fraction(array: GeigerArray) -> float:
    """Return the share of pulses in which a pixel is alive in the middle of the gate, in the dark."""
    noise = float(array.noise_per_s(np.array(0.0)))
    return live_fraction(noise, array.hold_off_s, 0.5 * array.gate_s)
