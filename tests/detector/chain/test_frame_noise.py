"""Noise where all that makes pixels differ acts at once, against the closed forms: means, variances, whoever has which.

One factor at a time leaves room for mistakes that two of them show: gain on the amplifier's own noise, sunlight on the wrong
pixel, an offset that scales with gain.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from rso_lidar.detector import Apd, Defects, Gsfl, Maps
from rso_lidar.detector.chain.camera import camera_of, draw_camera_pixels
from rso_lidar.detector.chain.full import store_waveforms
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.stages.nonuniformity import draw_pixels
from rso_lidar.detector.stages.time_axis import place_rows
from tests.detector.returns_for_tests import nothing, returns, simulate_rows
from tests.reference.detector.whole_chain import PATHS, computing

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


@pytest.mark.parametrize("path", PATHS)
def test_a_gate_in_sunlight_has_each_pixels_own_noise_and_offset(path):
    """Mean squares over predictions, 1 in every group of pixels: 4.5 standard errors over independent pixels."""
    sunlight = np.linspace(0.0, 4e11, N).reshape(SHAPE[::-1]).T  # it goes along columns, so that no order is a symmetry
    photons = replace(nothing(SHAPE), background_photons_per_s=sunlight)
    with computing(path):
        waveforms = store_waveforms(camera_of(PART, photons), photons, np.random.default_rng(31))[0]
    camera = draw_camera_pixels(PART, N)
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


def test_a_false_trigger_has_its_own_pixels_threshold_offset_and_noise():
    """Samples every 0.1 ns, a count an electron: each trace passes threshold · factor + offset at its latch.

    A straight line over h = 0.1 τ is off by h²/8 of the bend and by some σ (h/τ)^1.5 / 8 of the rest of the noise, of which
    there are thousands: 60 electrons, where pixels differ by hundreds. Ten τ before the latch it is plain noise about the
    offset: 4.5 standard errors.
    """
    part = Gsfl(
        amplifier={"noise_electrons": 1000.0},
        trigger={"threshold_electrons": 4700.0, "threshold_spread_fraction": 0.05},
        maps=Maps(gain_spread_fraction=0.0, offset_spread_counts=700.0, t0_spread_ns=0.0),
        defects=Defects(dead_fraction=0.1, hot_fraction=0.1, hot_dark_current_na=8.0),
        readout={
            "sample_ns": 0.1,
            "samples": 192,
            "pretrigger_samples": 128,
            "adc_bits": 16,
            "electrons_per_count": 1.0,
            "baseline_counts": 20_000.0,
        },
        armed_from_m=2000.0,
    )
    waveforms = store_waveforms(camera_of(part, nothing((64, 128))), nothing((64, 128)), np.random.default_rng(21))[0]
    pixels = draw_camera_pixels(part, 64 * 128)
    pixel = waveforms.pixel
    assert len(pixel) > 800 and not pixels.dead[pixel].any() and pixels.hot[pixel].sum() > 150
    counts = waveforms.samples_counts.astype(float) - 20_000.0 - pixels.offset_counts[pixel, None]
    place = (waveforms.latch_s - waveforms.start_s) / 0.1e-9
    assert place.min() >= 128.0 - 1e-6 and place.max() <= 129.0 + 1e-6
    share = place - 128.0
    at_latch = counts[:, 128] + share * (counts[:, 129] - counts[:, 128])
    assert np.abs(at_latch - 4700.0 * pixels.threshold[pixel]).max() < 60.0
    tau = part.amplifier.pole_s
    for hot, na in ((True, 8.0), (False, 1.0)):
        of = pixels.hot[pixel] == hot
        sigma2 = 1000.0**2 + 352.0 * na * 1e-9 / ELECTRON_C * (8.516e-9) ** 2 / (4.0 * tau)
        far = counts[of][:, :20]
        means, squares = far.mean(axis=1), (far**2).mean(axis=1)
        assert abs(means.mean()) < 4.5 * means.std() / math.sqrt(of.sum())
        assert abs(squares.mean() - sigma2) < 4.5 * squares.std() / math.sqrt(of.sum())
    latch_m = waveforms.latch_s * 299_792_458.0 / 2.0
    assert latch_m.min() > 2000.0 and latch_m.max() < 5000.0


@pytest.mark.parametrize("path", PATHS)
def test_the_mean_beside_the_noise_has_the_gain_of_the_pixel(path):
    """What is drawn between steps stands on this mean: rounding of the transform, 2e-6 of the peak, and the cut at 1e-4."""
    part = PART.replace(gate=None, defects=None)
    photons = returns(900.0 + 0.21 * np.arange(96), 4000.0)
    plan, pixels = plan_time(part, 8e-9), draw_camera_pixels(part, 96)
    rows = place_rows(photons, plan)
    with computing(path):
        noisy = simulate_rows(part, photons, rows, np.random.default_rng(1))
        quiet = simulate_rows(part, photons, rows, None).amplitude
    some = np.array([3, 80, 41])
    assert np.ptp(pixels.gain[some]) > 0.2
    assert np.abs(noisy.mean(some) - quiet[some]).max() < 1e-5 * quiet.max()
    assert quiet.sum(axis=1) / quiet.sum(axis=1).mean() == pytest.approx(pixels.gain / pixels.gain.mean(), rel=1e-3)


def test_the_maps_of_a_camera_are_independent():
    """Threshold, gain, offset, t0, and who is dead or hot: correlations of 16,384 pixels below 4.5 standard errors."""
    n = 16_384
    one = draw_pixels(n, 9, Apd(), 0.05, Maps(), Defects(dead_fraction=0.3, hot_fraction=0.3))
    maps = np.stack([one.threshold, one.gain, one.offset_counts, one.t0_s, one.dead, one.hot])
    between = np.corrcoef(maps)
    between[4, 5] = between[5, 4] = 0.0  # of these a pixel is one at most
    assert np.abs(between - np.eye(6)).max() < 4.5 / math.sqrt(n)
    assert abs(one.hot.mean() - 0.3) < 4.5 * math.sqrt(0.3 * 0.7 / n) and not (one.dead & one.hot).any()
