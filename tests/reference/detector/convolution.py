"""Pulse and amplifier laid over light by Fourier transform: the oracle of `rso_lidar.detector.stages.convolution`."""


def convolve_light(light, filters, least_primaries, primaries, amplitude):
    """Write expected primaries and amplitude (row, step): light behind two filters; fewer primaries count as none."""
    from scipy.fft import irfft, rfft

    spectrum, n = rfft(light, axis=1), light.shape[1]
    primaries[:], amplitude[:] = (
        irfft(spectrum * factors, n, axis=1) for factors in (filters.pulse, filters.amplified)
    )
    primaries *= primaries >= least_primaries
