"""Size of the full chain's simulation in memory: limits for the axis of time and for what a gate stores."""

from __future__ import annotations

from rso_lidar import units
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.settings.gsfl import Gsfl
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
