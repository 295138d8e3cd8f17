"""Convolution of light with the laser's pulse: expected photoelectrons, and their mean behind the amplifier."""

import math
from typing import NamedTuple

import numpy as np

from rso_lidar.detector.stages.light import sharing_response
from rso_lidar.kernels import kernel


def transform_pulse(pulse_step_s: float, power_per_s: np.ndarray, n: int, step_s: float) -> np.ndarray:
    """Return what convolves light on `n` steps with a laser's pulse: complex factors of its transform."""
    time_s = (np.arange(len(power_per_s)) - (len(power_per_s) - 1) / 2.0) * pulse_step_s
    frequency_hz = np.fft.rfftfreq(n, step_s)
    turn = np.exp(-2j * math.pi * np.multiply.outer(frequency_hz, time_s))
    transfer: np.ndarray = (turn * (power_per_s * pulse_step_s)).sum(axis=1) / sharing_response(n)
    transfer[frequency_hz > 0.5 / pulse_step_s] = 0.0  # finer than the taps nothing is known of the pulse
    return transfer


class PulseFilters(NamedTuple):
    """Two filters, on the circle of a row: factors of its transform, and responses of its steps, twice around."""

    pulse: np.ndarray  # light to primaries
    amplified: np.ndarray  # light to amplitude
    pulse_response: np.ndarray
    amplified_response: np.ndarray

    @staticmethod
    def of(pulse: np.ndarray, amplified: np.ndarray, n: int) -> "PulseFilters":
        """Return the filters with these factors.

        Parameters
        ----------
        pulse, amplified : factors of the transform, from light to primaries and to the amplitude
        n : number of steps
        """
        from scipy.fft import irfft

        responses = (np.tile(irfft(factors, n), 2).astype(np.float32) for factors in (pulse, amplified))
        return PulseFilters(pulse.astype(np.complex64), amplified.astype(np.complex64), *responses)


def convolve_light(
    light: np.ndarray,
    filters: PulseFilters,
    least_primaries: np.float32,
    primaries: np.ndarray,
    amplitude: np.ndarray,
) -> None:
    """Write expected primaries and amplitude (row, step), float32: light behind two filters.

    The cost of a transform does not depend on the number of lit steps. Few are lit, so a response is added for each.

    Parameters
    ----------
    light : (row, step) expected photons, float32
    primaries, amplitude : (row, step) float32, written
    """
    convolve_rows(light, filters.pulse_response, filters.amplified_response, least_primaries, primaries, amplitude)


@kernel
def convolve_rows(
    light: np.ndarray,
    pulse: np.ndarray,
    amplified: np.ndarray,
    least: np.float32,
    primaries: np.ndarray,
    amplitude: np.ndarray,
) -> None:
    """Convolve the light of each row with two responses.

    Parameters
    ----------
    light : (row, step) expected photons
    primaries, amplitude : (row, step) written
    """
    n_rows, n = light.shape
    for row in range(n_rows):
        expected, mean = primaries[row], amplitude[row]
        expected[:] = 0.0
        mean[:] = 0.0
        lit = 0
        while lit < n:
            if light[row, lit] == 0.0:
                lit += 1
                continue
            if lit + 4 > n:
                a = light[row, lit]
                p0, m0 = pulse[n - lit : 2 * n - lit], amplified[n - lit : 2 * n - lit]
                for step in range(n):
                    expected[step] += a * p0[step]
                    mean[step] += a * m0[step]
                lit += 1
                continue
            # A return lights four steps: one pass for them all. Each response begins where the next one has its second step.
            a, b, c, d = light[row, lit], light[row, lit + 1], light[row, lit + 2], light[row, lit + 3]
            from_pulse = pulse[n - lit - 3 : 2 * n - lit]
            for step in range(n):
                sum_of = expected[step] + a * from_pulse[step + 3] + b * from_pulse[step + 2]
                expected[step] = sum_of + c * from_pulse[step + 1] + d * from_pulse[step]
            from_amplified = amplified[n - lit - 3 : 2 * n - lit]
            for step in range(n):
                sum_of = mean[step] + a * from_amplified[step + 3] + b * from_amplified[step + 2]
                mean[step] = sum_of + c * from_amplified[step + 1] + d * from_amplified[step]
            lit += 4
        for step in range(n):
            if expected[step] < least:
                expected[step] = 0.0
