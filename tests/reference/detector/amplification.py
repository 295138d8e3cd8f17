"""The amplifier by Fourier transform: the oracle of `rso_lidar.detector.stages.amplification`."""

from rso_lidar.detector.stages.alias_tables import NORMAL_PER_SIGMA, NORMAL_ZERO, build_normal_table
from tests.reference.detector.alias_tables import look_up


def amplify(filters, quiet, excess, gain, words, amplitude):
    """Write the amplitude (row, step) [electrons] with noise from the same random words, under the gain of each row."""
    from scipy.fft import irfft, rfft

    white = (
        (look_up(build_normal_table(), words[:, : filters.n]) - NORMAL_ZERO)
        / NORMAL_PER_SIGMA
        * filters.noise_electrons
    )
    white += excess * gain[:, None]
    amplitude[:] = irfft(rfft(white, axis=1, overwrite_x=True) * filters.shot, filters.n, axis=1, overwrite_x=True)
    amplitude += quiet * gain[:, None]
