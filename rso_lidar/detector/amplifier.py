"""The transimpedance amplifier of a pixel: two poles, noise of its own, and the unit in which amplitudes are told.

Its impulse response is h(t) = (t/τ²) exp(−t/τ), H(f) = 1/(1 + 2πi f τ)². With one pole only, the crossing rate of the
noise would diverge as the time step shrinks; two make it finite (Rice 1944). Amplitudes are electrons after the APD: the
current [electrons/s] times `integration_ns`, the equivalent width of a Gaussian pulse of 8 ns, so that a pulse of that
length and Q electrons has the amplitude Q before the amplifier rounds it.
"""

import math

import numpy as np

from rso_lidar import units
from rso_lidar.detector.presets import DEFAULT
from rso_lidar.part import NotNegative, Part, Positive


class Amplifier(Part):
    """A two-pole amplifier: `bandwidth_mhz` to −3 dB, `noise_electrons` rms of its own at the output.

    `integration_ns` is the time in which a current counts as charge. `noise_electrons` is a constant of the preset,
    solved once through the whole chain; bandwidth and integration time are assumed.
    """

    bandwidth_mhz: Positive = 100.0
    noise_electrons: NotNegative = DEFAULT["noise_electrons"]
    integration_ns: Positive = 8.516

    @property
    def pole_s(self) -> float:
        """Return τ of both poles [s]: √(√2 − 1) / (2π B)."""
        return math.sqrt(math.sqrt(2.0) - 1.0) / (2.0 * math.pi * self.bandwidth_mhz * units.MHZ)

    @property
    def integration_s(self) -> float:
        """Return the time in which a current counts as charge [s]."""
        return self.integration_ns * units.NS

    def response(self, frequency_hz: np.ndarray) -> np.ndarray:
        """Return H(f), complex."""
        response: np.ndarray = 1.0 / (1.0 + 2j * math.pi * self.pole_s * frequency_hz) ** 2
        return response

    def correlation(self, lag_s: np.ndarray) -> np.ndarray:
        """Return the autocorrelation of white noise after the amplifier, 1 at lag 0: (1 + |t|/τ) exp(−|t|/τ)."""
        x = np.abs(lag_s) / self.pole_s
        correlation: np.ndarray = (1.0 + x) * np.exp(-x)
        return correlation


class Filters:
    """The amplifier on a grid of `n` steps of `step_s`, as factors of the real Fourier transform along time.

    Second moments are exact on the grid whatever the step: `shot` has the magnitude that gives filtered white noise its true
    autocorrelation at the steps, while `mean` is the response of the continuous amplifier. White noise of `noise_electrons`
    a step, through the same filter as the shot noise, is the amplifier's own.
    """

    def __init__(self, amplifier: Amplifier, n: int, step_s: float) -> None:
        self.n, self.step_s = n, step_s
        self.frequency_hz = np.fft.rfftfreq(n, step_s)
        response = amplifier.response(self.frequency_hz)
        lag_s = np.minimum(np.arange(n), n - np.arange(n)) * step_s
        power = np.maximum(np.fft.rfft(amplifier.correlation(lag_s)).real, 0.0)
        charge = amplifier.integration_s / step_s
        variance = step_s / (4.0 * amplifier.pole_s)  # ∫h² = 1/(4τ)
        phase = response / np.abs(response)
        self.mean: np.ndarray = (charge * response).astype(np.complex64)
        self.shot: np.ndarray = (charge * math.sqrt(variance) * np.sqrt(power) * phase).astype(np.complex64)
        # White noise before the shot filter that comes out with the amplifier's own rms.
        self.noise_electrons = np.float32(
            amplifier.noise_electrons * math.sqrt(4.0 * amplifier.pole_s * step_s) / amplifier.integration_s
        )
