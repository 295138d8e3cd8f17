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


def amplitudes(part, photons, fwhm_s, n, seed, step_s, span_s, depth_s=0.0):
    """Return times [s] about a pulse's middle and what n amplifiers give [electrons], noise of all kinds included.

    A surface spreads the pulse evenly over `depth_s`. In pieces of 1000 rows (row, step); every primary is a pulse of its
    own: x(t) = sum of gain x width x h(t - t_i) with h(t) = t / tau^2 exp(-t / tau).
    """
    rng = np.random.default_rng(seed)
    tau, width = pole_s(part.amplifier.bandwidth_mhz * 1e6), part.amplifier.integration_ns * 1e-9
    settle = math.ceil(10 * tau / step_s)
    t = np.arange(-settle, math.ceil((span_s[1] - span_s[0]) / step_s)) * step_s + span_s[0]
    # A Gaussian of peak 1 has the area FWHM sqrt(pi / (4 ln 2)).
    area = fwhm_s / step_s * math.sqrt(math.pi / (4 * math.log(2)))
    late_s = depth_s * ((np.arange(200) + 0.5) / 200 - 0.5) if depth_s else np.zeros(1)
    bell = np.exp(-4 * math.log(2) * (np.subtract.outer(t, late_s) / fwhm_s) ** 2).mean(axis=1)
    light = part.quantum_efficiency * photons * bell / area
    dark = part.apd.dark_current_na * 1e-9 / CHARGE_C * step_s
    number, p = single_gain(part.apd.gain, part.apd.ionisation_ratio)
    gains = number[np.searchsorted(np.cumsum(p), (np.arange(2**20) + 0.5) / 2**20)].astype(np.float32)
    a = math.exp(-step_s / tau)
    top, low = [0.0, a * step_s / tau**2], [1.0, -2 * a, a * a]
    ringing = signal.lfilter(top, low, np.eye(1, 4000)[0])
    white = part.amplifier.noise_electrons / width / math.sqrt(np.sum(ringing**2))
    for start in range(0, n, 1000):
        primaries = rng.poisson(light + dark, (min(1000, n - start), len(t)))
        cell = np.repeat(np.arange(primaries.size), primaries.ravel())
        drawn = gains[rng.integers(0, len(gains), len(cell))]
        electrons = np.bincount(cell, drawn, primaries.size).reshape(primaries.shape)
        electrons += rng.standard_normal(electrons.shape) * white - dark * part.apd.gain
        yield t[settle:], width * signal.lfilter(top, low, electrons, axis=1)[:, settle:]


def peaks(part, photons, fwhm_s, n, seed, depth_s=0.0):
    """Return the greatest amplitude [electrons] that each of n comparators sees of a pulse."""
    half_s = 1.5 * fwhm_s + 0.5 * depth_s
    pieces = amplitudes(part, photons, fwhm_s, n, seed, 1e-10, (-half_s, half_s), depth_s)
    return np.concatenate([x.max(axis=1) for _, x in pieces])


def detected(part, photons, fwhm_s, n, seed, depth_s=0.0):
    """Return the share of n pixels whose comparator fires, thresholds spread from pixel to pixel."""
    spread = part.trigger.threshold_spread_fraction * np.random.default_rng(seed + 1).standard_normal(n)
    threshold = part.trigger.threshold_electrons * (1 + spread)
    return float(np.mean(peaks(part, photons, fwhm_s, n, seed, depth_s) >= threshold))


def discrete_upcrossings_per_s(sigmas, step_s, tau_s):
    """Return how often Gaussian noise behind two poles, looked at every step, passes from below to above."""
    x = step_s / tau_s
    r = (1 + x) * math.exp(-x)
    z = np.linspace(sigmas, sigmas + 12, 200_001)
    density = np.exp(-(z**2) / 2) / math.sqrt(2 * math.pi)
    # above now, below a step before
    return float(np.trapezoid(density * special.ndtr((sigmas - r * z) / math.sqrt(1 - r * r)), z)) / step_s


def fit_sigmas(place_s, t, s, covariance, weight=None, reach_s=math.inf):
    """Return the rms errors of time [s] and of height of a pulse of shape s(t) fitted to samples.

    The samples stand `place_s` (sample) after the pulse's nominal delay; `covariance` is that of their noise, for a pulse
    as high as s; `weight` the covariance that the fit believes in (None: the true one, and the errors are the Cramer-Rao
    bounds: Kay 1993, eq. 3.31). Samples farther than `reach_s` from the peak are left out.
    """
    near = np.abs(place_s - t[np.argmax(s)]) <= reach_s
    weight = covariance if weight is None else weight
    jacobian = np.stack([-np.interp(place_s, t, np.gradient(s, t)), np.interp(place_s, t, s)], axis=1)[near]
    part = np.ix_(near, near)
    whitened = np.linalg.solve(weight[part], jacobian)
    gain = np.linalg.solve(jacobian.T @ whitened, whitened.T)
    return np.sqrt(np.diag(gain @ covariance[part] @ gain.T))


def chi_square_spread(sigma, n, sigmas=4.0):
    """Return by how much the standard deviation of n normal draws strays, at so many sigmas."""
    return sigmas * sigma / math.sqrt(2 * n)


def gate_detection(part, photons, fwhm_s, n, seed, pulses, probability):
    """Return the share of n gates of 20 samples, averaged over pulses, whose best fit of a pulse is above noise alone.

    The threshold is the quantile of the best fit to Gaussian noise of the same covariance, for the false-alarm probability.
    """
    sample_s, tau = part.readout.sample_ns * 1e-9, pole_s(part.amplifier.bandwidth_mhz * 1e6)
    step_s, width = sample_s / 24, part.amplifier.integration_ns * 1e-9
    rng = np.random.default_rng(seed)
    t, s = amplified(fwhm_s, tau, width)
    dark = part.apd.dark_current_na * 1e-9 / CHARGE_C * excess_noise(part.apd.gain, part.apd.ionisation_ratio)
    sigma2 = (part.amplifier.noise_electrons**2 + dark * part.apd.gain**2 * width**2 / (4 * tau)) / pulses
    covariance = sigma2 * noise_covariance(20, sample_s, tau)
    places = np.arange(3, 17, 0.25)
    shapes = np.interp((np.arange(20) - places[:, None]) * sample_s + t[np.argmax(s)], t, s, left=0, right=0) / s.max()
    whitened = np.linalg.solve(covariance, shapes.T)
    weights = whitened / np.sum(shapes.T * whitened, axis=0)
    noise = rng.standard_normal((100_000, 20)) @ np.linalg.cholesky(covariance).T
    threshold = np.quantile((noise @ weights).max(axis=1), 1 - probability)
    drawn = amplitudes(part, photons, fwhm_s, n * pulses, seed + 1, step_s, (-10 * sample_s, 11 * sample_s))
    piece = np.concatenate([x[:, int(rng.integers(24)) :: 24][:, :20] for _, x in drawn])
    found = piece.reshape(n, pulses, 20).mean(axis=1)
    return float(np.mean((found @ weights).max(axis=1) > threshold))
