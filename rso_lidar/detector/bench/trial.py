"""Trials of a detector on a bench: the same return in many pixels, and what is reported of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rso_lidar import units
from rso_lidar.detector.detection import AnyDetector, detect, draw_crosstalk_m, frame_jitter_s, isolate
from rso_lidar.records import Photons

COHERENCE_CELLS = (
    885.0  # A_lens A_pixel / (wavelength focal_length)² of a pixel that the default lens fills, at 1064 nm
)
NEAR_M = 5.0  # a report farther from the plate than a pulse reaches is a false trigger


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Effects of whole flashes on the pixels of a trial, each of which represents one pixel of a separate flash.

    Parameters
    ----------
    gain : of the APD under the array's current, relative to rest
    together_fraction : scalar or (pixel), share of the array that latches with a pixel; see `array_load`
    energy_jitter_fraction : of the laser from pulse to pulse, 1 sigma
    timing_jitter_s : of the laser from pulse to pulse, 1 sigma [s]
    """

    gain: float = 1.0
    together_fraction: float | np.ndarray = 0.0
    energy_jitter_fraction: float = 0.0
    timing_jitter_s: float = 0.0


@dataclass(frozen=True, eq=False)
class Trial:
    """Results of a trial.

    Parameters
    ----------
    detected : (pixel) whether the return was reported
    range_error_m : (detected pixel) [m]
    intensity_counts : (detected pixel) [counts]
    """

    detected: np.ndarray
    range_error_m: np.ndarray
    intensity_counts: np.ndarray

    @property
    def probability(self) -> float:
        """Share of pixels that reported the return."""
        return float(self.detected.mean())

    @property
    def range_bias_m(self) -> float:
        """Mean error of range [m], NaN where nothing was reported."""
        return float(self.range_error_m.mean()) if len(self.range_error_m) else float("nan")

    @property
    def range_noise_m(self) -> float:
        """Standard deviation of range [m] by the quartiles, so that single outliers do not decide it."""
        if len(self.range_error_m) < 2:
            return float("nan")
        low, high = np.quantile(self.range_error_m, [0.25, 0.75])
        return float(high - low) / 1.348_979_500_392_163_6


def make_plate(
    photons: float | np.ndarray,
    n: int,
    pulse: tuple[float, np.ndarray],
    pulse_fwhm_s: float,
    range_m: float | np.ndarray = 3000.0,
    flashes: int = 1,
) -> Photons:
    """Make the light of a plate facing the lidar that fills each of `n` pixels: one return each, without depth.

    Ranges are spread evenly over a metre from `range_m` on, nearly three samples of the default. So no phase of the clock is
    favoured.

    Parameters
    ----------
    photons : scalar or (n), mean on the pixel after the optics
    n : number of pixels
    pulse : the laser's step [s] and power (tap) [1/s]
    pulse_fwhm_s : length of the pulse [s]
    range_m : scalar or (n), least range [m]
    flashes : number of flashes whose pixels are listed one flash after another, with the same spread of ranges in each

    Returns
    -------
    light on one row of `n` pixels.
    """
    golden = np.modf(np.arange(n) % (n // flashes) * 0.618_033_988_749_894_9)[0]
    photons = np.broadcast_to(np.asarray(photons, dtype=float), (n,))
    return make_point_returns((1, n), pulse, pulse_fwhm_s, np.arange(n), range_m + golden, photons)


def make_point_returns(
    shape: tuple[int, int],
    pulse: tuple[float, np.ndarray],
    pulse_fwhm_s: float,
    pixel: np.ndarray,
    range_m: np.ndarray,
    photons: np.ndarray,
    coherence_cells: float = COHERENCE_CELLS,
) -> Photons:
    """Make the light of returns without depth, each in a separate cluster.

    Parameters
    ----------
    shape : rows and columns of the array
    pulse : the laser's step [s] and power (tap) [1/s]
    pulse_fwhm_s : length of the pulse [s]
    pixel : (return) number of the pixel, ascending
    range_m : (return) [m]
    photons : (return) mean on the pixel after the optics
    coherence_cells : of each return; infinite for light without speckle

    Returns
    -------
    light on the array.
    """
    number = np.arange(len(pixel))
    return Photons(
        shape=shape,
        pulse_fwhm_s=pulse_fwhm_s,
        pulse_step_s=pulse[0],
        late_s=0.0,
        pulse_power_per_s=pulse[1],
        pixel=pixel,
        delay_s=range_m / units.RANGE_PER_DELAY_M_S,
        photons=photons,
        depth_spread_s=np.zeros(len(pixel)),
        coherence_cells=np.full(len(pixel), coherence_cells),
        hit=number,
        cluster=number,
        cluster_pixel=pixel,
    )


def run_trial(
    detector: AnyDetector,
    photons: Photons,
    rng: np.random.Generator,
    true_m: np.ndarray | None = None,
    around: Surroundings = Surroundings(),
) -> Trial:
    """Simulate a detector's reports of a return in each pixel, such as `make_plate` makes.

    Each pixel represents one pixel of a separate flash. So the pixels of a trial draw no common current, do not latch
    together and share no jitter; `around` holds what their own flashes do to them.

    Parameters
    ----------
    detector : the detector
    photons : light on a row of pixels
    rng : generator of the noise
    true_m : (pixel) true ranges [m] for the range errors (None: of the one return in each pixel)
    around : effects of their own flashes on the pixels

    Returns
    -------
    detections, range errors and counts of all pixels.
    """
    if true_m is None:
        true_m = photons.delay_s * units.RANGE_PER_DELAY_M_S
    averaged = math.sqrt(detector.traits.pulses)  # over the pulses of a frame
    if around.energy_jitter_fraction > 0.0:
        factor = 1.0 + around.energy_jitter_fraction / averaged * rng.standard_normal(
            photons.shape[0] * photons.shape[1]
        )
        photons = replace(photons, photons=photons.photons * np.maximum(factor, 1e-3)[photons.pixel])
    reading, _ = detect(photons, isolate(detector, around.gain), rng)
    error = reading.range_m.ravel().astype(float) - true_m
    common_s = math.hypot(frame_jitter_s(detector), around.timing_jitter_s / averaged)
    if common_s > 0.0:
        error += common_s * units.RANGE_PER_DELAY_M_S * rng.standard_normal(len(error))
    if np.any(around.together_fraction):
        error += draw_crosstalk_m(detector, np.broadcast_to(around.together_fraction, error.shape), rng)
    with np.errstate(invalid="ignore"):
        detected = np.abs(error) < NEAR_M
    return Trial(detected, error[detected], reading.intensity_counts.ravel()[detected])
