"""Noise where all that makes pixels differ acts at once, against the closed forms: means, variances, whoever has which.

One factor at a time leaves room for mistakes that two of them show: gain on the amplifier's own noise, sunlight on the wrong
pixel, an offset that scales with gain.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from rso_lidar import arithmetic
from rso_lidar.detector import Defects, Gsfl, Maps
from tests.detector.returns_for_tests import nothing

ELECTRON_C = 1.602_176_634e-19
SHAPE = (48, 96)
N = SHAPE[0] * SHAPE[1]
PART = Gsfl(
    preset="offset_limited",
    quantum_efficiency=0.6,
    camera_seed=5,
    amplifier={"noise_electrons": 700.0},
    apd={"gain": 8.0, "ionisation_ratio": 0.3, "dark_current_na": 20.0},
    maps=Maps(gain_spread_fraction=0.3, offset_spread_counts=6.0),
    defects=Defects(dead_fraction=0.05, hot_fraction=0.2, hot_dark_current_na=150.0),
    gate={"delay_ns": 1000.0, "width_ns": 95.2, "pulses": 3},
    readout={"electrons_per_count": 90.0},
)


def variance_counts2(part, gain, hot, sunlight_per_s):
    """Return the variance [counts²] of a pixel's samples, by Campbell's theorem and McIntyre's factor, from the settings."""
    m, k = part.apd.gain, part.apd.ionisation_ratio
    excess = k * m + (1.0 - k) * (2.0 - 1.0 / m)
    tau = math.sqrt(math.sqrt(2.0) - 1.0) / (2.0 * math.pi * 100e6)
    dark = np.where(hot, part.defects.hot_dark_current_na, part.apd.dark_current_na) * 1e-9 / ELECTRON_C
    rate = dark + part.quantum_efficiency * sunlight_per_s
    shot = m**2 * excess * rate * (8.516e-9) ** 2 / (4.0 * tau)
    own = part.amplifier.noise_electrons**2
    return ((own + gain**2 * shot) / part.readout.electrons_per_count**2 + 1.0 / 12.0) / part.gate.pulses


@pytest.mark.parametrize("path", arithmetic.CHOICES)
def test_a_gate_in_sunlight_has_each_pixels_own_noise_and_offset(path):
    """Mean squares over predictions, 1 in every group of pixels: 4.5 standard errors over independent pixels."""
    sunlight = np.linspace(0.0, 4e11, N).reshape(SHAPE[::-1]).T  # it goes along columns, so that no order is a symmetry
    photons = replace(nothing(SHAPE), background_photons_per_s=sunlight)
    with arithmetic.using(path):
        waveforms = PART.waveforms(photons, np.random.default_rng(31))
    camera = PART.camera(N)
    pixel = waveforms.pixel
    assert np.array_equal(pixel, np.flatnonzero(~camera.dead))
    gain, hot, light = camera.gain[pixel], camera.hot[pixel], sunlight.ravel()[pixel]
    rest = waveforms.samples_counts.astype(float) - waveforms.baseline_counts - camera.offset_counts[pixel, None]
    variance = variance_counts2(PART, gain, hot, light)
    groups = {
        "all": np.ones(len(pixel), bool),
        "hot": hot,
        "dim": light < 1e11,
        "bright": light > 3e11,
        "weak": gain < 0.75,
        "strong": gain > 1.25,
        "low": camera.offset_counts[pixel] < -6.0,
        "high": camera.offset_counts[pixel] > 6.0,
    }
    for name, of in groups.items():
        assert of.sum() > 400, name
        squares = (rest[of] ** 2).mean(axis=1) / variance[of]
        assert abs(squares.mean() - 1.0) < 4.5 * squares.std() / math.sqrt(of.sum()), name
        means = rest[of].mean(axis=1) / np.sqrt(variance[of])
        assert abs(means.mean()) < 4.5 * means.std() / math.sqrt(of.sum()), name
    told = np.where(hot, 150.0, 20.0) * 1e-9 / ELECTRON_C + 0.6 * light
    np.testing.assert_allclose(waveforms.base_per_s, told, rtol=1e-12)
