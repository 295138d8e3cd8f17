"""The laser's pulse as a detector meets it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rso_lidar.records import Photons


class LaserPulse(NamedTuple):
    """The laser's pulse as a detector meets it; equal pulses have equal taps, so that what follows from one is kept by it.

    Parameters
    ----------
    step_s : time between the taps of `power_per_s` [s].
    power_per_s : (tap) power over energy [1/s].
    fwhm_s : full width at half maximum [s].
    timing_jitter_ns : jitter of emission, 1 sigma.
    """

    step_s: float
    power_per_s: np.ndarray
    fwhm_s: float
    timing_jitter_ns: float = 0.0

    @staticmethod
    def of(photons: Photons) -> LaserPulse:
        """Return the pulse of the light of a flash; its jitter is in the light already.

        Parameters
        ----------
        photons : the light.
        """
        return LaserPulse(photons.pulse_step_s, photons.pulse_power_per_s, photons.pulse_fwhm_s)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, LaserPulse):
            return NotImplemented
        same = (self.step_s, self.fwhm_s, self.timing_jitter_ns) == (other.step_s, other.fwhm_s, other.timing_jitter_ns)
        return same and np.array_equal(self.power_per_s, other.power_per_s)

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __hash__(self) -> int:
        return hash((self.step_s, self.fwhm_s, self.timing_jitter_ns, len(self.power_per_s)))
