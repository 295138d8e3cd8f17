"""Effects of coherent light, of an overdriven amplifier, and of pixels on each other."""

import numpy as np

from rso_lidar import units
from rso_lidar.detector.settings.focal_plane import Crosstalk, Droop, Saturation, Speckle

_GAIN_WITHIN = 1e-6  # a relative error of the gain far below the noise of any frame
_MOST_ROUNDS = 50


def draw_speckle(speckle: Speckle, coherence_cells: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return random factors (cluster), of mean 1, on the photons of clusters: gamma-distributed, by the number of modes."""
    modes = (1.0 + coherence_cells) * (2.0 if speckle.depolarising else 1.0)
    factors: np.ndarray = rng.standard_gamma(modes) / modes
    return factors


def limit_amplitude(saturation: Saturation, amplitude: np.ndarray, step_s: float) -> np.ndarray:
    """Return amplitudes (row, step) [electrons] as a clipping amplifier passes them on."""
    fade = np.float32(np.exp(-step_s / (saturation.recovery_ns * units.NS)))
    rail = np.float32(saturation.rail_electrons)
    limited: np.ndarray = np.minimum(amplitude, rail)
    over = np.flatnonzero(amplitude.max(axis=1, initial=0.0) > rail)
    memory = np.zeros(len(over), np.float32)  # charge that an overdriven stage has still to discharge
    for step in range(amplitude.shape[1]):
        now = amplitude[over, step]
        memory = np.where(now > rail, np.maximum(memory * fade, now), memory * fade)
        limited[over, step] = np.minimum(np.maximum(limited[over, step], memory), rail)
    return limited


def solve_gain(droop: Droop, electrons: np.ndarray, step_s: float, steady_per_s: float = 0.0) -> np.ndarray:
    """Return the gain (step) relative to rest under the current that pixels draw from the bias supply.

    A lower gain draws less, so sag and gain are solved together. What a step draws is felt from the next one on.

    Parameters
    ----------
    electrons : (step) electrons that all pixels draw in each step at the gain of rest
    steady_per_s : electrons that have flowed for long before, at the gain of rest [1/s]
    """
    from scipy.signal import lfilter

    slope, capacitance_f = droop.gain_slope_per_v, droop.capacitance_nf * units.NF
    keep = np.exp(-step_s / (droop.resistance_ohm * capacitance_f))
    drawn_v = electrons * units.ELEMENTARY_CHARGE_C / capacitance_f
    # v (1 + slope v) = I R under a steady current.
    loaded_v = steady_per_s * units.ELEMENTARY_CHARGE_C * droop.resistance_ohm
    steady_v = 2.0 * loaded_v / (1.0 + np.sqrt(1.0 + 4.0 * slope * loaded_v))
    sag_v = np.full(np.shape(electrons), steady_v)
    for _ in range(_MOST_ROUNDS):
        gain = 1.0 / (1.0 + slope * sag_v)
        missed_v = steady_v + lfilter([0.0, 1.0], [1.0, -keep], drawn_v * gain) - sag_v
        sag_v += missed_v / (
            1.0 + slope * sag_v * gain
        )  # Newton's step for the case that all current flows in one instant
        if slope * np.abs(missed_v).max(initial=0.0) < _GAIN_WITHIN:
            break
    settled_gain: np.ndarray = 1.0 / (1.0 + slope * sag_v)
    return settled_gain


def latch_share(at_s: np.ndarray, latch_s: np.ndarray, clock_s: float, n_pixels: int) -> np.ndarray:
    """Return the share of the array that latches within one clock of each instant.

    Parameters
    ----------
    at_s : (pixel) instants, such as those at which these pixels latch themselves [s]
    latch_s : (latch) when pixels of the array latched [s]
    clock_s : time between samples [s]
    """
    order = np.sort(latch_s)
    together = np.searchsorted(order, at_s + clock_s, "right") - np.searchsorted(order, at_s - clock_s)
    share: np.ndarray = together / n_pixels
    return share


def draw_shift_m(crosstalk: Crosstalk, share: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return random range errors (pixel) [m] from crosstalk, by the share (pixel) of the array that latches with each."""
    shift: np.ndarray = crosstalk.offset_m * (share - crosstalk.calibrated_fraction)
    shift += crosstalk.noise_m * share * rng.standard_normal(np.shape(share))
    return shift
