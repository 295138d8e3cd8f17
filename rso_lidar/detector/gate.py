"""A range gate: every pixel stores the same stretch of time, and a filter finds the pulse in it afterwards (seed 3.3, 6)."""

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from rso_lidar import units
from rso_lidar.part import Count, NotNegative, Part, Positive


class Gate(Part):
    """A window of `width_ns` that opens `delay_ns` after emission (two-way: 6.67 ns a metre); nothing triggers.

    The samples of `pulses` flashes are averaged before a matched filter looks for returns above a threshold of constant
    false-alarm rate, `false_alarm_probability` for a pixel and frame. Background and dark counts inside the gate count.
    """

    delay_ns: NotNegative
    width_ns: Positive = 47.6
    pulses: Annotated[Count, Field(le=10_000)] = 1
    false_alarm_probability: Annotated[float, Field(ge=1e-12, lt=0.5)] = 1e-3

    @property
    def from_m(self) -> float:
        """Return the range [m] at which the gate opens."""
        return self.delay_ns * units.NS * units.RANGE_PER_DELAY_M_S

    @property
    def to_m(self) -> float:
        """Return the range [m] at which the gate closes."""
        return (self.delay_ns + self.width_ns) * units.NS * units.RANGE_PER_DELAY_M_S

    def n_samples(self, sample_s: float) -> int:
        """Return how many samples the gate holds; it closes on the last of them."""
        return max(4, round(self.width_ns * units.NS / sample_s))

    def threshold_sigma(self, sample_s: float, crossings_per_s: float) -> float:
        """Return the threshold, in sigmas of the filtered noise, for the false-alarm probability.

        Gaussian noise passes u sigmas upward ν₀ exp(−u²/2) times a second (Rice 1944), `crossings_per_s` is its ν₀ after
        the matched filter, and begins above with probability Q(u); their sum over the gate is set equal to the probability.
        """
        from scipy.optimize import brentq
        from scipy.special import ndtr

        open_s = self.n_samples(sample_s) * sample_s
        wanted = -math.log1p(-self.false_alarm_probability)

        def excess(u: float) -> float:
            return math.log((crossings_per_s * open_s * math.exp(-0.5 * u * u) + float(ndtr(-u))) / wanted)

        return float(brentq(excess, -1.0, 12.0))


def noise_scale(statistic: np.ndarray) -> float:
    """Return sigma of noise about zero from what lies below zero, where no pulse reaches: median of |x| over 0.6745."""
    below = statistic[statistic < 0.0]
    return float(np.median(-below) / 0.674_489_750_196_081_7) if len(below) else 0.0
