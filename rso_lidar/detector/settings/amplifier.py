"""Settings of a pixel's transimpedance amplifier: two poles, its own noise, and the unit of amplitude.

The impulse response is h(t) = (t/τ²) exp(−t/τ), H(f) = 1/(1 + 2πi f τ)². With one pole only, the crossing rate of the noise
would diverge as the time step shrinks; two make it finite (Rice 1944).

Amplitudes are electrons after the APD: the current [electrons/s] times `integration_ns`. That is the equivalent width of a
Gaussian pulse of 8 ns. A pulse of that length and Q electrons has the amplitude Q before the amplifier rounds it.
"""

import math

import numpy as np
from pydantic import Field

from rso_lidar import units
from rso_lidar.detector.settings.presets import DEFAULT
from rso_lidar.part import NotNegative, Part, Positive


class Amplifier(Part):
    """A two-pole amplifier: `bandwidth_mhz` to −3 dB, with its own noise of `noise_electrons` rms at the output.

    `integration_ns` is the time in which a current counts as charge. `noise_electrons` is a constant of the preset,
    solved once through the whole chain; bandwidth and integration time are assumed.
    """

    bandwidth_mhz: Positive = Field(
        default=100.0, description="Combined −3 dB bandwidth of both poles [MHz]. Default: assumed; low confidence."
    )
    noise_electrons: NotNegative = Field(
        default=DEFAULT["noise_electrons"],
        description=(
            "Rms amplifier noise at the output, referred to electrons after the APD [electrons]. Default: solved "
            "through the chain by `make calibrate`, so that threshold / noise = 6."
        ),
    )
    integration_ns: Positive = Field(
        default=8.516,
        description=(
            "Time over which a current counts as charge [ns]: it defines the unit of amplitude (docs/instrument.md). "
            "Default: a choice of unit, the equivalent width of a Gaussian pulse of 8 ns."
        ),
    )

    @property
    def pole_s(self) -> float:
        """Time constant τ of both poles [s]: √(√2 − 1) / (2π B)."""
        return math.sqrt(math.sqrt(2.0) - 1.0) / (2.0 * math.pi * self.bandwidth_mhz * units.MHZ)

    @property
    def integration_s(self) -> float:
        """Time in which a current counts as charge [s]."""
        return self.integration_ns * units.NS

    @property
    def noise_bandwidth_hz(self) -> float:
        """Equivalent noise bandwidth ∫|H|² df [Hz], one-sided: 1/(8τ), 1.22 times the −3 dB bandwidth."""
        return 1.0 / (8.0 * self.pole_s)

    @property
    def noise_a_per_sqrt_hz(self) -> float:
        """Amplifier noise as a white current after the APD [A/√Hz], one-sided; at the output it is `noise_electrons`."""
        rms_a = self.noise_electrons * units.ELEMENTARY_CHARGE_C / self.integration_s
        return rms_a / math.sqrt(self.noise_bandwidth_hz)

    def response(self, frequency_hz: np.ndarray) -> np.ndarray:
        """Return the frequency response H(f), complex: two equal poles.

        Parameters
        ----------
        frequency_hz : frequencies [Hz]
        """
        response: np.ndarray = 1.0 / (1.0 + 2j * math.pi * self.pole_s * frequency_hz) ** 2
        return response

    def correlation(self, lag_s: np.ndarray) -> np.ndarray:
        """Return the autocorrelation of white noise after the amplifier, 1 at lag 0: (1 + |t|/τ) exp(−|t|/τ).

        Parameters
        ----------
        lag_s : lags [s]
        """
        x = np.abs(lag_s) / self.pole_s
        correlation: np.ndarray = (1.0 + x) * np.exp(-x)
        return correlation
