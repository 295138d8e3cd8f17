"""The signal chain a second time, from its definitions, photoelectron by photoelectron: what the chain is compared with.

Nothing here calls the chain. Time runs in steps of a tenth of the amplifier's pole, gains are drawn one by one.
"""

import math

import numpy as np
from scipy import signal, special

C_M_S = 299_792_458.0
FWHM_PER_SIGMA = 2.0 * math.sqrt(2.0 * math.log(2.0))
CHARGE_C = 1.602_176_634e-19


def excess_noise(gain, k):
    """Return F = k M + (1 - k)(2 - 1/M) (McIntyre 1966)."""
    return k * gain + (1 - k) * (2 - 1 / gain)


def single_gain(gain, k):
    """Return n = 1, 2, ... and the probability that one primary becomes n electrons (McIntyre 1972), P(n|1)."""
    n = np.arange(1.0, 4000.0)
    log_p = (
        special.gammaln(n / (1 - k) + 1)
        - np.log(n)
        - special.gammaln(n)
        - special.gammaln(k * n / (1 - k) + 2)
        + (1 + k * n / (1 - k)) * math.log((1 + k * (gain - 1)) / gain)
        + (n - 1) * math.log((1 - k) * (gain - 1) / gain)
    )
    return n, np.exp(log_p)


def pole_s(bandwidth_hz):
    """Return tau of two equal poles that together lose 3 dB at the bandwidth."""
    return math.sqrt(math.sqrt(2) - 1) / (2 * math.pi * bandwidth_hz)


def amplified(fwhm_s, tau_s, integration_s, step_s=5e-12):
    """Return times [s] and amplitude of one electron's worth of a Gaussian pulse centred on 0, behind two poles."""
    t = np.arange(-4 * fwhm_s, 4 * fwhm_s + 40 * tau_s, step_s)
    bell = np.exp(-4 * math.log(2) * (t / fwhm_s) ** 2)
    a = math.exp(-step_s / tau_s)
    poles = signal.lfilter([0, a * step_s**2 / tau_s**2], [1, -2 * a, a * a], bell / (bell.sum() * step_s))
    return t, integration_s * poles


def noise_covariance(n, sample_s, tau_s):
    """Return the covariance of white noise behind two equal poles, of rms 1."""
    x = np.abs(np.subtract.outer(np.arange(n), np.arange(n))) * sample_s / tau_s
    return (1 + x) * np.exp(-x)


def peaks(part, photons, fwhm_s, n, seed, step_s=1e-10):
    """Return the greatest amplitude [electrons] that each of n comparators sees of a pulse, noise of all kinds included."""
    rng = np.random.default_rng(seed)
    tau, width = pole_s(part.amplifier.bandwidth_mhz * 1e6), part.amplifier.integration_ns * 1e-9
    settle = math.ceil(10 * tau / step_s)
    t = np.arange(-1.5 * fwhm_s - settle * step_s, 1.5 * fwhm_s, step_s)
    bell = np.exp(-4 * math.log(2) * (t / fwhm_s) ** 2)
    signal_primaries = part.quantum_efficiency * photons * bell / np.exp(
        -4 * math.log(2) * (np.arange(-400, 401) * step_s / fwhm_s) ** 2
    ).sum()
    dark = part.apd.dark_current_na * 1e-9 / CHARGE_C * step_s
    number, p = single_gain(part.apd.gain, part.apd.ionisation_ratio)
    gains = number[np.searchsorted(np.cumsum(p), (np.arange(2**20) + 0.5) / 2**20)].astype(np.float32)
    # Every primary is a pulse of its own: x(t) = sum of gain * width * h(t - t_i), h = t/tau^2 exp(-t/tau).
    a = math.exp(-step_s / tau)
    top, low = [0.0, a * step_s / tau**2], [1.0, -2 * a, a * a]
    noise = signal.lfilter(top, low, np.eye(1, 4000)[0])
    white = part.amplifier.noise_electrons / width / math.sqrt(np.sum(noise**2))
    found = []
    for start in range(0, n, 1000):
        rows = min(1000, n - start)
        primaries = rng.poisson(signal_primaries + dark, (rows, len(t)))
        cell = np.repeat(np.arange(primaries.size), primaries.ravel())
        drawn = gains[rng.integers(0, len(gains), len(cell))]
        electrons = np.bincount(cell, drawn, primaries.size).reshape(primaries.shape)
        electrons += rng.standard_normal(electrons.shape) * white - dark * part.apd.gain
        found.append(width * signal.lfilter(top, low, electrons, axis=1)[:, settle:].max(axis=1))
    return np.concatenate(found)


def detected(part, photons, fwhm_s, n, seed):
    """Return the share of n pixels whose comparator fires, thresholds spread from pixel to pixel."""
    spread = part.trigger.threshold_spread_fraction * np.random.default_rng(seed + 1).standard_normal(n)
    threshold = part.trigger.threshold_electrons * (1 + spread)
    return float(np.mean(peaks(part, photons, fwhm_s, n, seed) >= threshold))


def discrete_upcrossings_per_s(sigmas, step_s, tau_s):
    """Return how often Gaussian noise behind two poles, looked at every step, passes from below to above."""
    x = step_s / tau_s
    r = (1 + x) * math.exp(-x)
    z = np.linspace(sigmas, sigmas + 12, 200_001)
    density = np.exp(-(z**2) / 2) / math.sqrt(2 * math.pi)
    # above now, below a step before
    return float(np.trapezoid(density * special.ndtr((sigmas - r * z) / math.sqrt(1 - r * r)), z)) / step_s
