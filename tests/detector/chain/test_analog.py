"""The stages of the chain: each hands on what it was handed, with its own gain and noise, and the first crossing latches."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rso_lidar.detector import Gsfl
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.full import store_waveforms
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.chain.traces import arm_rows
from rso_lidar.detector.stages.time_axis import place_rows
from tests.detector.returns_for_tests import nothing, returns, simulate_rows

C = 299_792_458.0
PART = Gsfl(preset="offset_limited", timing={"pixel_jitter_ns": 0.0}, trigger={"threshold_spread_fraction": 0.0})
NA_PER_S = 1e-9 / 1.602_176_634e-19


def made(photons, part=PART, rng=None):
    plan = plan_time(part, photons.pulse_fwhm_s)
    rows = place_rows(photons, plan)
    return simulate_rows(part, photons, rows, rng), plan


def test_photons_become_primaries_by_the_quantum_efficiency():
    """Within 1e-3: the rows hold a pulse's light to its flanks, and steps of less than 1e-4 primaries count as none."""
    photons = returns(1000.0 + 0.11 * np.arange(64), 5000.0)
    stages, _ = made(photons)
    assert stages.light.sum(axis=1) == pytest.approx(5000.0, rel=1e-6)
    assert stages.primaries.sum(axis=1) == pytest.approx(4000.0, rel=1e-3)
    assert stages.electrons.sum(axis=1) == pytest.approx(40_000.0, rel=1e-3)  # gain 10


def test_the_avalanche_has_mcintyres_noise():
    """Electrons of a row: mean M n, variance M² F n for n = QE N + dark primaries, F = 3.52 (McIntyre 1966); 4 sigma."""
    n = 4000
    stages, plan = made(returns(np.full(n, 1000.0), 1000.0), rng=np.random.default_rng(1))
    electrons = stages.electrons.sum(axis=1, dtype=float)
    primaries = stages.primaries.sum(axis=1, dtype=float).mean() + NA_PER_S * stages.rows.length * plan.step_s
    variance = 100.0 * 3.52 * primaries
    assert abs(electrons.mean() - 10.0 * primaries) < 4.0 * math.sqrt(variance / n)
    assert electrons.var() == pytest.approx(variance, rel=4.0 * math.sqrt(2.1 / n))


def test_dark_pixels_stand_on_the_baseline_with_the_noise_that_is_said():
    """Light of next to nothing: the mean is nil and the rms that of `noise_electrons`; rows are independent, 4 sigma."""
    stages, _ = made(returns(np.full(3000, 1000.0), 1e-6), rng=np.random.default_rng(2))
    mean, square = stages.amplitude.mean(axis=1), (stages.amplitude.astype(float) ** 2).mean(axis=1)
    assert abs(mean.mean()) < 4.0 * mean.std() / math.sqrt(3000)
    assert abs(square.mean() - PART.noise_electrons**2) < 4.0 * square.std() / math.sqrt(3000)


def test_the_mean_of_many_noisy_flashes_is_the_one_without_noise():
    n = 3000
    photons = returns(np.full(n, 1000.0), 1000.0)
    stages, _ = made(photons, rng=np.random.default_rng(3))
    quiet, _ = made(photons)
    assert stages.mean([0, 7]) == pytest.approx(quiet.amplitude[[0, 7]], abs=1.0)
    error = stages.amplitude.std(axis=0) / math.sqrt(n)
    # 64 steps, correlated: 4.5 sigma.
    assert np.all(np.abs(stages.amplitude.mean(axis=0) - quiet.amplitude[0]) < 4.5 * error)


def test_noise_grows_where_light_is():
    """Campbell: dark current and 1e10 primaries a second through ∫h² = 1/4τ, in quadrature with the amplifier's own."""
    step_s = 1e-9
    sigma = camera_of(PART, nothing((1, 1))).comparators.noise_sigma(
        np.array([0.0, 10.0]) / step_s + PART.apd.dark_electrons_per_s
    )
    shot = 352.0 * (NA_PER_S + np.array([0.0, 1e10])) * (8.516e-9) ** 2 / (4.0 * PART.amplifier.pole_s)
    assert sigma == pytest.approx(np.sqrt(PART.amplifier.noise_electrons**2 + shot), rel=1e-4)
    assert sigma[0] == pytest.approx(PART.noise_electrons)


def test_what_no_pulse_makes_is_dark_current_hot_pixels_and_sunlight():
    part = PART.replace(
        apd={"dark_current_na": 2.0}, defects={"dead_fraction": 0.0, "hot_fraction": 0.5, "hot_dark_current_na": 50.0}
    )
    photons = replace(nothing((4, 8)), background_photons_per_s=np.arange(32.0).reshape(4, 8) * 1e9)
    front = camera_of(part, photons).front
    camera, rate = front.pixels, front.base_rate_per_s(photons)
    assert camera.hot.any() and not camera.hot.all()
    assert rate == pytest.approx(np.where(camera.hot, 50.0, 2.0) * NA_PER_S + 0.8e9 * np.arange(32.0), rel=1e-9)


def test_a_trace_lies_about_its_latch():
    """Eight of twenty samples lie before the latch; the light is below the threshold there and above it after."""
    photons = returns(1000.0 + 0.137 * np.arange(500), 20_000.0)
    waveforms = store_waveforms(camera_of(PART, photons), photons, np.random.default_rng(4))[0]
    assert waveforms.samples_counts.shape == (500, 20) and np.array_equal(waveforms.pixel, np.arange(500))
    into = (waveforms.latch_s - waveforms.start_s) / 2.38e-9
    assert into.min() > 8.0 - 1e-6 and into.max() < 9.0 - 1e-6
    assert waveforms.start_s / 2.38e-9 == pytest.approx(np.rint(waveforms.start_s / 2.38e-9), abs=1e-6)  # one clock
    height = (waveforms.samples_counts - waveforms.baseline_counts) * 200.0
    assert np.all(height[:, 7] < PART.trigger.threshold_electrons)
    assert np.all(height[:, 10] > PART.trigger.threshold_electrons)
    # The latch comes where the pulse passes the threshold: for all pixels alike, within two steps of time and the noise.
    pulse = camera_of(PART, photons).pulse
    share = PART.trigger.threshold_electrons / (8.0 * 20_000.0 * pulse.peak)
    late_s = waveforms.latch_s - photons.delay_s - pulse.rise_s(share)
    assert -1.2e-9 < late_s.mean() < 1.2e-9 and late_s.std() < 1e-9


def test_the_first_surface_that_crosses_latches():
    """Near and bright, near and too faint, near but not armed yet: pixel by pixel."""
    photons = returns(
        np.array([500.0, 900.0, 500.0, 900.0, 50.0, 900.0]),
        np.array([5000.0, 9000.0, 20.0, 9000.0, 5000.0, 9000.0]),
        np.repeat(np.arange(3), 2),
        (1, 3),
    )
    part = PART.replace(armed_from_m=100.0)
    latch_m = store_waveforms(camera_of(part, photons), photons, np.random.default_rng(5))[0].latch_s * C / 2.0
    assert latch_m == pytest.approx([500.0, 900.0, 900.0], abs=2.0)
    nothing_armed = PART.replace(armed_from_m=950.0, armed_to_m=1000.0)
    assert len(store_waveforms(camera_of(nothing_armed, photons), photons, np.random.default_rng(5))[0].pixel) == 0


def test_rows_are_watched_only_while_armed():
    photons = returns(np.array([400.0, 500.0, 600.0]), 1000.0)
    plan = plan_time(PART, 8e-9)
    rows = place_rows(photons, plan)
    armed = PART.replace(armed_from_m=500.0, armed_to_m=550.0)
    inside, arming = arm_rows(camera_of(armed, photons).comparators, rows, plan.step_s)
    watched = inside.last - inside.first
    assert watched[0] <= 0 and 0 < watched[1] < (rows.last - rows.first)[1] and watched[2] <= 0
    assert arming.tolist() == [True, True, False]
    opens = (inside.start + inside.first)[1] * plan.step_s
    assert 0.0 <= opens - 2.0 * 500.0 / C < plan.step_s * (1.0 + 1e-9)


def test_light_that_stands_when_the_window_opens_does_not_trigger():
    """The window opens at the pulse's peak: it has passed the threshold before, and comes back for good below it."""
    photons = returns(np.full(200, 1000.0), 20_000.0)
    peak_s = photons.delay_s[0] + camera_of(PART, photons).pulse.peak_s
    seen = store_waveforms(
        camera_of(PART.replace(armed_from_m=peak_s * C / 2.0), photons), photons, np.random.default_rng(6)
    )[0]
    assert len(seen.pixel) == 0
    earlier = store_waveforms(camera_of(PART.replace(armed_from_m=990.0), photons), photons, np.random.default_rng(6))[
        0
    ]
    assert len(earlier.pixel) == 200
