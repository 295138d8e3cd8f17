"""The amplifier by a loop over its taps is the one by Fourier transform; its noise has the two poles' autocorrelation."""

import math

import numpy as np
import pytest

from rso_lidar.detector import Amplifier
from rso_lidar.detector.stages import amplification
from rso_lidar.detector.stages.amplification import Filters, amplify_rows
from rso_lidar.detector.stages.row_noise import AMPLIFIER
from tests.detector.row_noise_for_tests import amplify, row_noise
from tests.reference.detector import amplification as reference

QUIET, NOISY = Amplifier(noise_electrons=0.0), Amplifier(noise_electrons=1000.0)
STEP_S = 1.19e-9


@pytest.mark.parametrize("amplifier", [QUIET, NOISY])
@pytest.mark.parametrize("n", [13, 64, 105])
def test_both_paths_are_one(n, amplifier):
    """Rounding of float32 sums of some ten terms, 3e-6 of the highest; on a short circle there are fewer taps."""
    rng = np.random.default_rng(1)
    quiet, excess = rng.standard_normal((2, 50, n), dtype=np.float32)
    gain = rng.uniform(0.5, 1.5, 50).astype(np.float32)
    filters = Filters(amplifier, n, STEP_S)
    words = row_noise(np.random.default_rng(2), 50).draw(AMPLIFIER, 1, n)[0]
    made = np.empty((2, 50, n), np.float32)
    for one, amplitude in zip((amplification.amplify, reference.amplify), made, strict=True):
        one(filters, quiet, excess, gain, words, amplitude)
    assert np.abs(made[0] - made[1]).max() < 3e-6 * np.abs(made[0]).max()
    assert len(amplify_rows.dispatcher.signatures) == 1


@pytest.mark.parametrize("by", [amplification.amplify, reference.amplify])
def test_noise_has_the_autocorrelation_of_two_poles(by):
    """4.5 standard errors over independent rows; nothing of it is in the mean."""
    none, tau = np.zeros((20_000, 64), np.float32), NOISY.pole_s
    filters = Filters(NOISY, 64, STEP_S)
    noise = amplify(filters, none, none, np.ones(20_000, np.float32), np.random.default_rng(3), by=by)
    for lag in (0, 1, 2, 3, 5, 9, 32):
        products = (noise * np.roll(noise, lag, axis=1)).mean(axis=1, dtype=float) / 1000.0**2
        x = lag * STEP_S / tau
        assert abs(products.mean() - (1.0 + x) * math.exp(-x)) < 4.5 * products.std() / math.sqrt(20_000)
    assert abs(noise.mean(dtype=float)) < 4.5 * noise.mean(axis=1).std() / math.sqrt(20_000)


@pytest.mark.parametrize("by", [amplification.amplify, reference.amplify])
def test_gain_of_a_pixel_takes_the_avalanche_along_and_not_the_amplifiers_own_noise(by):
    """mean g q and variance σ² + g² s² ∫h²-sum: gain acts before the amplifier. 4.5 standard errors over rows.

    White excess of rms s a step is s² rate-free Campbell: s²/Δ · integration²/(4τ). Gains, mean and both noises at once.
    """
    rows, n, s = 12_000, 48, 400.0
    rng = np.random.default_rng(11)
    gain = np.repeat(np.array([0.4, 1.0, 1.8], np.float32), rows // 3)
    quiet = np.broadcast_to(np.linspace(500.0, 3500.0, n, dtype=np.float32), (rows, n))
    excess = (s * rng.standard_normal((rows, n))).astype(np.float32)
    made = amplify(Filters(NOISY, n, STEP_S), quiet.copy(), excess.copy(), gain, np.random.default_rng(12), by=by)
    own2, shot2 = 1000.0**2, s**2 / STEP_S * NOISY.integration_s**2 / (4.0 * NOISY.pole_s)
    for g in (0.4, 1.0, 1.8):
        of = gain == np.float32(g)
        rest = made[of].astype(float) - g * quiet[of]
        means, squares = rest.mean(axis=1), (rest**2).mean(axis=1)
        assert abs(means.mean()) < 4.5 * means.std() / math.sqrt(len(means))
        assert abs(squares.mean() - own2 - g**2 * shot2) < 4.5 * squares.std() / math.sqrt(len(squares))
