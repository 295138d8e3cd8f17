"""The laser's pulse, the shape of one return behind the amplifier, and the Cramér-Rao bound of its arrival time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rso_lidar.records import Photons

# Between two points of a pulse's table a straight line is off by at most this share of the peak.
_TABLE_WITHIN = 5e-6
# A pulse ends where it has fallen to this share of its peak.
_SUPPORT_FROM = 1e-7
# Length of the amplifier's tail [time constants]: (1 + 40) exp(-40) is negligible.
_TAIL_POLES = 40.0


class LaserPulse(NamedTuple):
    """The laser's pulse as a detector meets it; equal pulses have equal taps, so that what follows from one is kept by it.

    Parameters
    ----------
    step_s : time between the taps of `power_per_s` [s]
    power_per_s : (tap) power over energy [1/s]
    fwhm_s : full width at half maximum [s]
    timing_jitter_ns : jitter of emission, 1 sigma
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
        photons : the light
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


@dataclass(frozen=True, eq=False, repr=False)
class Pulse:
    """The amplitude s(t) of one return behind a two-pole amplifier, for one unit of charge, free of noise.

    Time zero is the return's nominal two-way delay: the middle of the optical pulse's taps. `step_s` is that of the table,
    which reaches from `from_s` to `to_s`; outside, the pulse is zero. `peak` is its maximum, `peak_s` the time of it,
    `fwhm_s` the full width at half maximum behind the amplifier.
    """

    step_s: float
    from_s: float
    to_s: float
    peak: float
    peak_s: float
    fwhm_s: float
    table: np.ndarray
    slope_table: np.ndarray

    @staticmethod
    def after(step_s: float, power_per_s: np.ndarray, pole_s: float, integration_s: float) -> Pulse:
        """Tabulate the pulse behind an amplifier H(f) = 1/(1 + 2πi f τ)².

        Parameters
        ----------
        step_s : time from tap to tap [s]
        power_per_s : (tap) power over energy of the optical pulse [1/s], area 1; the middle tap is time zero
        pole_s : τ of both poles [s]; 0 for an amplifier of unlimited bandwidth
        integration_s : the time in which a current counts as charge [s]

        Returns
        -------
        Pulse
            Tabulated in steps of the taps or finer.
        """
        return _tabulate_pulse(float(step_s), np.array(power_per_s, dtype=float), float(pole_s), float(integration_s))

    def amplitude(self, time_s: np.ndarray) -> np.ndarray:
        """Return s(t), in the amplifier's unit per unit of charge.

        Parameters
        ----------
        time_s : times after the nominal delay [s], of any shape
        """
        return self._read(self.table, time_s)

    def slope(self, time_s: np.ndarray) -> np.ndarray:
        """Return ds/dt [1/s].

        Parameters
        ----------
        time_s : times after the nominal delay [s], of any shape
        """
        return self._read(self.slope_table, time_s)

    def rise_s(self, fraction: float) -> float:
        """Return when the pulse first passes a fraction of its peak [s after the nominal delay].

        Parameters
        ----------
        fraction : of the peak, 0 to 1
        """
        level = fraction * self.peak
        k = max(int(np.argmax(self.table >= level)), 1)
        before, after = float(self.table[k - 1]), float(self.table[k])
        return self.from_s + self.step_s * (k - 1 + (level - before) / (after - before))

    def _read(self, table: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        place = (np.asarray(time_s, dtype=float) - self.from_s) * (1.0 / self.step_s)
        place = np.clip(place, 0.0, len(table) - 2.0)
        k = place.astype(np.intp)
        low = table[k]
        result: np.ndarray = low + (place - k) * (table[k + 1] - low)
        return result


def _tabulate_pulse(step_s: float, taps: np.ndarray, pole_s: float, integration_s: float) -> Pulse:
    """Tabulate a pulse: the taps as a band-limited signal, filtered and refined by their Fourier transform."""
    from scipy import fft

    guard = len(taps) // 2 + 16
    tail = math.ceil(_TAIL_POLES * pole_s / step_s)
    n = int(fft.next_fast_len(guard + len(taps) + guard + tail, real=True))
    padded = np.zeros(n)
    padded[guard : guard + len(taps)] = taps
    frequency_hz = fft.rfftfreq(n, step_s)
    spectrum = integration_s * fft.rfft(padded) / (1.0 + 2j * math.pi * frequency_hz * pole_s) ** 2
    if n % 2 == 0:
        spectrum[-1] *= 0.5  # in the finer grid the last frequency has a separate mirror image
    turn = 2j * math.pi * frequency_hz

    def refine(values: np.ndarray, times: int) -> np.ndarray:
        fine: np.ndarray = fft.irfft(values, n * times) * times
        return fine

    bend = np.abs(refine(spectrum * turn**2, 4)).max() / refine(spectrum, 4).max()
    times = max(4, math.ceil(step_s / math.sqrt(8.0 * _TABLE_WITHIN / bend)))
    table, slope = refine(spectrum, times), refine(spectrum * turn, times)
    fine_s = step_s / times
    first_s = -(guard + 0.5 * (len(taps) - 1)) * step_s
    inside = np.flatnonzero(np.abs(table) > _SUPPORT_FROM * table.max())
    first, last = max(int(inside[0]) - 1, 0), min(int(inside[-1]) + 3, len(table))
    table, slope = table[first:last].copy(), slope[first:last].copy()
    table[[0, -2, -1]] = slope[[0, -2, -1]] = 0.0  # reading beyond an end stops on a zero
    from_s = first_s + first * fine_s
    top = int(np.argmax(table))
    share = (
        slope[top] / (slope[top] - slope[top + 1]) if slope[top] > 0 else -slope[top] / (slope[top - 1] - slope[top])
    )
    place = top + share if slope[top] > 0 else top - share
    peak = float(table[top] + 0.5 * abs(slope[top] * (place - top) * fine_s))
    above = np.flatnonzero(table >= 0.5 * peak)
    low, high = int(above[0]), int(above[-1])
    rise = low - (table[low] - 0.5 * peak) / (table[low] - table[low - 1])
    fall = high + (table[high] - 0.5 * peak) / (table[high] - table[high + 1])
    table.setflags(write=False)
    slope.setflags(write=False)
    return Pulse(
        fine_s,
        from_s,
        from_s + (len(table) - 1) * fine_s,
        peak,
        from_s + float(place) * fine_s,
        float(fall - rise) * fine_s,
        table,
        slope,
    )


def noise_covariance(n: int, sample_s: float, pole_s: float, sigma: float) -> np.ndarray:
    """Return the covariance (n, n) of white noise behind a two-pole amplifier: σ² (1 + |t|/τ) exp(−|t|/τ).

    Parameters
    ----------
    n : number of samples
    sample_s : time between samples [s]
    pole_s : τ [s]. With 0 the noise is white
    sigma : rms of the noise, in any unit
    """
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    if pole_s <= 0.0:
        white: np.ndarray = sigma**2 * (lag == 0).astype(float)
        return white
    x = np.minimum(lag * (sample_s / pole_s), 700.0)
    covariance: np.ndarray = sigma**2 * (1.0 + x) * np.exp(-x)
    return covariance


def crlb_s(
    pulse: Pulse,
    amplitude_counts: float,
    sample_s: float,
    noise: float | np.ndarray,
    phase: float = 0.0,
    *,
    samples: int = 20,
) -> float:
    """Return the Cramér-Rao bound of the arrival time of a pulse of known shape and unknown amplitude [s, 1 sigma].

    Kay (1993), Estimation Theory, eq. 3.31: the inverse of GᵀC⁻¹G, G the slopes by time and by amplitude.

    Parameters
    ----------
    sample_s : time between samples [s]
    noise : rms of white noise [counts], or the covariance (sample, sample) [counts²] of any noise
    samples : number of samples of a trace, if `noise` is a number
    """
    covariance = (
        noise_covariance(samples, sample_s, 0.0, noise) if isinstance(noise, int | float) else np.asarray(noise)
    )
    n = len(covariance)
    time_s = (np.arange(n) - n // 2 - phase) * sample_s + pulse.peak_s
    by_time = -amplitude_counts / pulse.peak * pulse.slope(time_s) * sample_s
    jacobian = np.stack([by_time, pulse.amplitude(time_s) / pulse.peak], axis=1)
    information = jacobian.T @ np.linalg.solve(covariance, jacobian)
    return sample_s * math.sqrt(float(np.linalg.inv(information)[0, 0]))
