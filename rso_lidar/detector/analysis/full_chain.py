"""Size, false alarms, noise growth and crosstalk of the full chain, from its settings."""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.detector.chain.camera import mean_false_alarms_per_s
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.settings.empirical import Empirical
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.stages.array_effects import draw_shift_m
from rso_lidar.errors import ScenarioError

_MOST_STEPS = 2**14  # of time in one trace, and ...
_MOST_GATED = 2**27  # ... in all pixels under a gate: half a gigabyte


def check_size_gsfl(gsfl: Gsfl, pulse_fwhm_s: float, n_pixels: int) -> None:
    """Refuse a full chain whose simulation would not fit into memory.

    Parameters
    ----------
    gsfl : the detector.
    pulse_fwhm_s : length of the laser's pulse [s].
    n_pixels : pixels of the array.

    Raises
    ------
    ScenarioError : where the axis of time is too long.
    """
    plan = plan_time(gsfl, pulse_fwhm_s)
    steps = plan.before + plan.watched + plan.after
    if steps > _MOST_STEPS:
        raise ScenarioError(
            f"a pulse of {pulse_fwhm_s / units.NS:.3g} ns, samples of {gsfl.readout.sample_ns:.3g} "
            f"ns and {gsfl.amplifier.bandwidth_mhz:.3g} MHz need {steps:.3g} steps of time for each pixel, "
            f"over {_MOST_STEPS:,}; bring laser.pulse_fwhm_ns, detector.readout and detector.amplifier nearer"
        )
    if gsfl.gate is not None:
        stored = gsfl.gate.n_samples(gsfl.readout.sample_s) * plan.steps_per_sample
        if stored * n_pixels > _MOST_GATED:
            most_ns = _MOST_GATED / n_pixels * plan.step_s / units.NS
            raise ScenarioError(
                f"detector.gate.width_ns: {gsfl.gate.width_ns:g} in {n_pixels:,} pixels is more than can be "
                f"stored; take up to {most_ns:.0f}, or fewer pixels"
            )


def false_alarms_of_gsfl(gsfl: Gsfl, range_m: np.ndarray) -> np.ndarray:
    """Return the probability (range) of a false alarm of the full chain before light from there comes."""
    if gsfl.gate is not None:
        return np.full(np.shape(range_m), gsfl.gate.false_alarm_probability)
    return _wait(gsfl, mean_false_alarms_per_s(gsfl), range_m)


def false_alarms_of_empirical(empirical: Empirical, range_m: np.ndarray) -> np.ndarray:
    """Return the probability (range) of a false alarm of the empirical detector before light from there comes."""
    return _wait(empirical, empirical.false_alarms_per_s, range_m)


def _wait(detector: Gsfl | Empirical, rate: float, range_m: np.ndarray) -> np.ndarray:
    armed_m = np.clip(range_m, detector.armed_from_m, detector.armed_to_m) - detector.armed_from_m
    before: np.ndarray = -np.expm1(-rate * armed_m / units.RANGE_PER_DELAY_M_S)
    return before


def noise_growth_gsfl(gsfl: Gsfl, background_photons_per_s: float) -> float:
    """Return the rms noise of the full chain under sunlight [photons/s] over that in the dark."""
    dark = gsfl.noise_electrons
    return gsfl.noise_in_light(background_photons_per_s) / dark if dark > 0.0 else float("inf")


def draw_crosstalk_gsfl_m(gsfl: Gsfl, together_fraction: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw the range error [m] of the full chain's pixels from others that latch with them.

    Parameters
    ----------
    gsfl : the detector.
    together_fraction : (pixel) share of the array that latches with each.
    rng : generator of the errors.
    """
    if gsfl.crosstalk is None or gsfl.gate is not None:
        return np.zeros(np.shape(together_fraction))
    return draw_shift_m(gsfl.crosstalk, together_fraction, rng)
