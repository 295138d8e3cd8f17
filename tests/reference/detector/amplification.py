"""The amplifier by Fourier transform: the oracle of `rso_lidar.detector.stages.amplification`."""

from rso_lidar.detector.stages.alias_tables import NORMAL_PER_SIGMA, NORMAL_ZERO, build_normal_table
from rso_lidar.detector.stages.row_noise import AMPLIFIER
from tests.reference import philox
from tests.reference.detector.alias_tables import look_up


def amplify(filters, quiet, excess, gain, noise):
    """Return the amplitude (row, step) [electrons] with noise from the same random words, under the gain of each row."""
    from scipy.fft import irfft, rfft

    n_rows, n = quiet.shape
    words = philox.rows(noise.key, noise.start, noise.pixel, AMPLIFIER, (n + 3) // 4 * 4)
    for row in range(n_rows):
        lag, shared = noise.lag[row], noise.shared[row]
        words[row, :shared] = words[row - 1, lag : lag + shared]
    white = (look_up(build_normal_table(), words[:, :n]) - NORMAL_ZERO) / NORMAL_PER_SIGMA * filters.noise_electrons
    white += excess * gain[:, None]
    amplitude = irfft(rfft(white, axis=1, overwrite_x=True) * filters.shot, filters.n, axis=1, overwrite_x=True)
    amplitude += quiet * gain[:, None]
    return amplitude
