"""Noise of a filtered current in closed form: its rms, and how often it crosses a threshold."""

import math

import numpy as np

from rso_lidar.detector.settings.apd import Apd, cumulants


def rice_rate(threshold_electrons: np.ndarray, sigma_electrons: np.ndarray | float, pole_s: float) -> np.ndarray:
    """Return the upcrossings of Gaussian noise [1/s]: ν₀ exp(−T²/2σ²), ν₀ = 1/(2πτ) for two equal poles (Rice 1945).

    ν₀² = ∫f²|H|² df / ∫|H|² df with |H|² = 1/(1 + (2πfτ)²)² is (1/(2πτ))².

    Parameters
    ----------
    threshold_electrons : T above the mean [electrons].
    sigma_electrons : rms σ of the noise [electrons].
    pole_s : time constant τ of both poles [s].
    """
    sigma = np.asarray(sigma_electrons, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        over = np.where(sigma > 0.0, np.maximum(threshold_electrons, 0.0) / sigma, np.inf)
    rate: np.ndarray = np.exp(-0.5 * over**2) / (2.0 * math.pi * pole_s)
    return rate


def noise_rms(
    apd: Apd, rate_per_s: np.ndarray | float, noise_electrons: float, pole_s: float, integration_s: float
) -> np.ndarray:
    """Return the rms noise [electrons] at the amplifier's output.

    The shot noise has the variance M²F · rate · integration² ∫h², with ∫h² = 1/4τ.

    Parameters
    ----------
    apd : the photodiode, with M²F.
    rate_per_s : primary electrons, of any origin [1/s].
    noise_electrons : rms of the amplifier's own noise [electrons].
    pole_s : time constant τ of both poles [s].
    integration_s : time in which a current counts as charge [s].
    """
    shot = cumulants(apd)[1] * np.asarray(rate_per_s, dtype=float) * integration_s**2 / (4.0 * pole_s)
    rms: np.ndarray = np.sqrt(noise_electrons**2 + shot)
    return rms
