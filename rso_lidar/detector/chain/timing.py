"""The axis of time of a camera, with all filters that act along it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.stages.amplification import Filters
from rso_lidar.detector.stages.comparator import Bridge
from rso_lidar.detector.stages.convolution import PulseFilters, transform_pulse
from rso_lidar.detector.stages.time_axis import SamplingPlan, make_plan


@dataclass(frozen=True, eq=False)
class TimeAxis:
    """Filters over rows of one length."""

    step_s: float
    amplifier: Filters
    light: PulseFilters  # from photons to primaries, and on to the amplitude
    bridge: Bridge  # noise between two steps
    timing: tuple[Filters, Filters] | None = None  # amplifier of a timing channel, without noise and with its own


def plan_time(gsfl: Gsfl, pulse_fwhm_s: float, earliest_s: float = 0.0) -> SamplingPlan:
    """Return the layout of a detector's axis of time.

    Parameters
    ----------
    earliest_s : how long before its delay a return can latch [s], where that is longer than for moderate light
    """
    steps = gsfl.steps_per_sample
    if gsfl.zero_crossing is not None:  # noise between steps half a pole apart is known from the steps to 2 % rms
        steps = max(steps, math.ceil(2.0 * gsfl.readout.sample_s / gsfl.amplifier.pole_s))
    return make_plan(gsfl.readout, gsfl.amplifier, pulse_fwhm_s, steps_per_sample=steps, earliest_s=earliest_s)


def build_axis(gsfl: Gsfl, pulse: LaserPulse, step_s: float, n: int) -> TimeAxis:
    """Build the filters of a detector and a pulse over rows of `n` steps."""
    amplifier = gsfl.amplifier
    filters = Filters(amplifier, n, step_s)
    light = gsfl.quantum_efficiency * transform_pulse(pulse.step_s, pulse.power_per_s, n, step_s)
    timing = None
    if gsfl.zero_crossing is not None:
        noises = 0.0, gsfl.zero_crossing.noise_electrons
        quiet, noisy = (Filters(amplifier.replace(noise_electrons=noise), n, step_s) for noise in noises)
        timing = quiet, noisy
    return TimeAxis(
        step_s,
        filters,
        PulseFilters.of(light, gsfl.apd.gain * light * filters.mean, n),
        Bridge(amplifier.pole_s, step_s),
        timing,
    )
