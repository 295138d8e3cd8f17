"""The amplifier by Fourier transform: the oracle of `rso_lidar.detector.stages.amplification`."""

import numpy as np


def amplify(filters, quiet, excess, gain, rng, overlap=None):
    """Return the amplitude (row, step) [electrons] with noise, under the gain of each row."""
    from scipy.fft import irfft, rfft

    noise = rng.standard_normal(excess.shape, dtype=np.float32)
    if overlap is not None:
        overlap.carry(noise)
    noise *= filters.noise_electrons
    noise += excess * gain[:, None]
    amplitude = irfft(rfft(noise, axis=1, overwrite_x=True) * filters.shot, filters.n, axis=1, overwrite_x=True)
    amplitude += quiet * gain[:, None]
    return amplitude
