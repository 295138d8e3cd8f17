"""The transimpedance amplifier of a pixel: two poles, noise of its own, and the unit in which amplitudes are told.

Its impulse response is h(t) = (t/τ²) exp(−t/τ), H(f) = 1/(1 + 2πi f τ)². With one pole only, the crossing rate of the
noise would diverge as the time step shrinks; two make it finite (Rice 1944). Amplitudes are electrons after the APD: the
current [electrons/s] times `integration_ns`, the equivalent width of a Gaussian pulse of 8 ns, so that a pulse of that
length and Q electrons has the amplitude Q before the amplifier rounds it.
"""

import math
from functools import lru_cache

import numpy as np
from pydantic import Field

from rso_lidar import units
from rso_lidar.arithmetic import compiled
from rso_lidar.detector.alias import normal_table, words
from rso_lidar.detector.overlap import Overlap
from rso_lidar.detector.presets import DEFAULT
from rso_lidar.part import NotNegative, Part, Positive

_MEMORY_POLES = 16.0  # time constants: (1 + 16) exp(-16) is 2e-6


class Amplifier(Part):
    """A two-pole amplifier: `bandwidth_mhz` to −3 dB, `noise_electrons` rms of its own at the output.

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
    """The amplifier on a circle of `n` steps of `step_s`: `mean` and `shot` are factors of the Fourier transform along time.

    `mean` is the response of the continuous amplifier, charge in a step to amplitude. White noise goes through `taps`
    (steps after it), of which `shot` is the transform. Second moments are exact on the grid whatever the step: sampled,
    (1 + |t|/τ) exp(−|t|/τ) is the autocorrelation of y[k] = 2a y[k−1] − a² y[k−2] + early x[k] + late x[k−1] with
    a = exp(−Δ/τ). White noise of `noise_electrons` a step, through the same taps as the shot noise, is the amplifier's own.
    First moments of the taps are not: they are as late as `mean`, 2τ, to a quarter of a step for steps up to 2.4 τ, and of
    longer steps, in which a pulse has no shape, less than a step later.
    """

    def __init__(self, amplifier: Amplifier, n: int, step_s: float) -> None:
        self.n, self.step_s = n, step_s
        self.frequency_hz = np.fft.rfftfreq(n, step_s)
        charge = amplifier.integration_s / step_s
        self.mean: np.ndarray = charge * amplifier.response(self.frequency_hz)
        x = step_s / amplifier.pole_s
        a = math.exp(-x)
        # Variance of early x[k] + late x[k-1], and its covariance from step to step.
        variance, covariance = 1.0 - a**4 - 4.0 * a**2 * x, a * (x * (1.0 + a**2) - (1.0 - a**2))
        total, apart = math.sqrt(variance + 2.0 * covariance), math.sqrt(variance - 2.0 * covariance)
        early, late = 0.5 * (total - apart), 0.5 * (total + apart)  # the other way around, it would run ahead of `mean`
        lag = np.arange(min(n, max(math.ceil(_MEMORY_POLES / x), 2)))  # `late` comes a step later, however long that is
        taps = a**lag * (lag + 1.0) * early + a ** np.maximum(lag - 1.0, 0.0) * lag * late
        taps *= charge * math.sqrt(0.25 * x)  # the integral of h² is 1/(4τ)
        self.taps: np.ndarray = taps.astype(np.float32)
        self.shot: np.ndarray = np.fft.rfft(taps, n).astype(np.complex64)
        # White noise before the taps that comes out with the amplifier's own rms.
        self.noise_electrons = np.float32(
            amplifier.noise_electrons * math.sqrt(4.0 * amplifier.pole_s * step_s) / amplifier.integration_s
        )


@lru_cache(maxsize=16)
def filters(amplifier: Amplifier, n: int, step_s: float) -> Filters:
    """Return the amplifier on a circle of n steps, made once."""
    return Filters(amplifier, n, step_s)


def amplified(
    filters: Filters,
    quiet: np.ndarray,
    excess: np.ndarray,
    gain: np.ndarray,
    rng: np.random.Generator,
    overlap: Overlap | None = None,
) -> np.ndarray:
    """Return the amplitude (row, step) [electrons] with noise, under the gain of each row.

    `quiet` is the mean behind the amplifier, `excess` what the electrons before it are more than their mean; rows that
    overlap in time share the amplifier's own noise.
    """
    if compiled():
        from rso_lidar.detector.amplifier_loops import amplified as amplified_by_loops

        amplitude: np.ndarray = np.empty(quiet.shape, np.float32)
        random = words(rng, quiet.size)
        if overlap is not None:
            overlap.carry(random.reshape(quiet.shape))
        amplified_by_loops(
            quiet, excess, gain, filters.taps, filters.noise_electrons, normal_table(), random, amplitude
        )
        return amplitude
    from scipy.fft import irfft, rfft

    noise = rng.standard_normal(excess.shape, dtype=np.float32)
    if overlap is not None:
        overlap.carry(noise)
    noise *= filters.noise_electrons
    noise += excess * gain[:, None]
    amplitude = irfft(rfft(noise, axis=1, overwrite_x=True) * filters.shot, filters.n, axis=1, overwrite_x=True)
    amplitude += quiet * gain[:, None]
    return amplitude
