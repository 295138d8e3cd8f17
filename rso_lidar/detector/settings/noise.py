"""Noise of a filtered current in closed form."""

import numpy as np

from rso_lidar.detector.settings.apd import Apd, cumulants


def noise_rms(
    apd: Apd, rate_per_s: np.ndarray | float, noise_electrons: float, pole_s: float, integration_s: float
) -> np.ndarray:
    """Return the rms noise [electrons] at the amplifier's output.

    The shot noise has the variance M²F · rate · integration² ∫h², with ∫h² = 1/4τ.

    Parameters
    ----------
    rate_per_s : primary electrons, of any origin [1/s]
    noise_electrons : rms of the amplifier's own noise [electrons]
    pole_s : time constant τ of both poles [s]
    integration_s : time in which a current counts as charge [s]
    """
    shot = cumulants(apd)[1] * np.asarray(rate_per_s, dtype=float) * integration_s**2 / (4.0 * pole_s)
    rms: np.ndarray = np.sqrt(noise_electrons**2 + shot)
    return rms
