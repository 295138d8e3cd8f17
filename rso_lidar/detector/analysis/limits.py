"""Limits of the full chain: its axis of time, what a gate stores, and how often noise may trigger a pixel."""

from __future__ import annotations

from rso_lidar import units
from rso_lidar.detector.analysis.false_alarms import nominal_false_alarms_per_s
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.errors import ScenarioError

_MOST_FALSE = 1.0  # triggers by noise while a pixel is armed: most flashes would see nothing else
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


def check_noise_gsfl(gsfl: Gsfl) -> None:
    """Refuse a full chain whose nominal pixel noise alone would trigger more than once while it is armed."""
    if gsfl.gate is not None:
        return
    rate = nominal_false_alarms_per_s(gsfl)
    false = rate * (gsfl.armed_to_m - gsfl.armed_from_m) / units.RANGE_PER_DELAY_M_S
    if false > _MOST_FALSE:
        raise ScenarioError(
            f"detector.trigger.threshold_electrons: {gsfl.trigger.threshold_electrons:g} is "
            f"{gsfl.threshold_over_noise:.2g} times the noise ({gsfl.noise_electrons:.0f} electrons): noise alone would "
            f"trigger a nominal pixel {rate:,.0f} times a second, {false:.3g} times while it is armed; raise the threshold, "
            "lower the noise, the dark current or the gain, or arm a shorter window (detector.armed_to_m)"
        )
