"""The axis of time of a detector, and the shape of its pulses on it."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from rso_lidar.detector.ranging.pulse import Pulse
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.stages.time_axis import SamplingPlan, make_plan
from rso_lidar.records import Photons


def plan_time(gsfl: Gsfl, pulse_fwhm_s: float, earliest_s: float = 0.0) -> SamplingPlan:
    """Return the layout of a detector's axis of time.

    Parameters
    ----------
    gsfl : the detector.
    pulse_fwhm_s : length of the pulse [s].
    earliest_s : how long before its delay a return can latch [s], where that is longer than for moderate light.
    """
    steps = gsfl.steps_per_sample
    if gsfl.zero_crossing is not None:  # noise between steps half a pole apart is known from the steps to 2 % rms
        steps = max(steps, math.ceil(2.0 * gsfl.readout.sample_s / gsfl.amplifier.pole_s))
    return make_plan(gsfl.readout, gsfl.amplifier, pulse_fwhm_s, steps_per_sample=steps, earliest_s=earliest_s)


def shape_pulse(gsfl: Gsfl, photons: Photons) -> Pulse:
    """Return the shape of one return after the amplifier."""
    amplifier = gsfl.amplifier
    power = photons.pulse_power_per_s.tobytes()
    return _shape_pulse(photons.pulse_step_s, power, amplifier.pole_s, amplifier.integration_s)


@lru_cache(maxsize=8)
def _shape_pulse(step_s: float, power_per_s: bytes, pole_s: float, integration_s: float) -> Pulse:
    """Return the pulse behind the amplifier, cached.

    Parameters
    ----------
    step_s, power_per_s : taps of the optical pulse, the second as bytes.
    pole_s, integration_s : time constants of the amplifier [s].
    """
    return Pulse.after(step_s, np.frombuffer(power_per_s), pole_s, integration_s)
