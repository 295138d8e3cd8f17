"""The amplifier on a grid: its noise, its shot noise and its pulse are those of the continuous two-pole amplifier.

h(t) = (t/τ²) exp(−t/τ), so that ∫h² = 1/(4τ) and white noise behind it has the autocorrelation (1 + |t|/τ) exp(−|t|/τ)
(residues of |H|² = 1/(1 + (2πfτ)²)²).
"""

import math

import numpy as np
import pytest
from scipy import fft

from rso_lidar.detector import Amplifier, Gsfl
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.stages.amplification import Filters
from rso_lidar.detector.stages.time_axis import place_rows
from tests.detector.returns_for_tests import returns, simulate_rows

AMPLIFIER = Amplifier(noise_electrons=1000.0)
TAU = AMPLIFIER.pole_s
STEPS_NS = [2.38 / 2, 2.38 / 3, 2.38 / 6, 0.1]


def correlation(lag_s):
    return (1.0 + np.abs(lag_s) / TAU) * np.exp(-np.abs(lag_s) / TAU)


def test_bandwidth_is_where_power_halves():
    # −3 dB of H = 1/(1 + 2πi f τ)²: |H|² = 1/2.
    assert np.abs(AMPLIFIER.response(np.array([100e6]))) ** 2 == pytest.approx(0.5, rel=1e-12)
    assert AMPLIFIER.correlation(np.array([0.0, -TAU, TAU])) == pytest.approx([1.0, 2 / math.e, 2 / math.e])


def test_integration_time_is_the_equivalent_width_of_8_ns():
    # Area over peak of a Gaussian of full width w at half maximum: w √(π / (4 ln 2)).
    assert AMPLIFIER.integration_ns == pytest.approx(8.0 * math.sqrt(math.pi / (4.0 * math.log(2.0))), rel=1e-4)


@pytest.mark.parametrize("step_ns", STEPS_NS)
@pytest.mark.parametrize("n", [96, 105], ids=["even", "odd"])
def test_noise_has_the_variance_and_the_autocorrelation_of_two_poles(step_ns, n):
    """Means over rows, which are independent, within 4.5 standard errors of them: 0.01 % false alarm over all 64 figures."""
    n = max(n, n * round(0.4 / step_ns))  # the grid is a circle: as long as 30 τ or more
    filters = Filters(AMPLIFIER, n, step_ns * 1e-9)
    white = np.random.default_rng(n).standard_normal((3000, n)) * filters.noise_electrons
    noise = fft.irfft(fft.rfft(white, axis=1) * filters.shot, n, axis=1)
    for lag in [0, 1, 2, 3, 5, 8, 13, n // 2]:
        products = (noise * np.roll(noise, lag, axis=1)).mean(axis=1) / 1000.0**2
        error = products.std() / math.sqrt(len(products))
        assert abs(products.mean() - correlation(lag * step_ns * 1e-9)) < 4.5 * error
    assert abs(noise.mean()) < 4.5 * noise.mean(axis=1).std() / math.sqrt(len(noise))


@pytest.mark.parametrize("step_ns", STEPS_NS)
def test_shot_noise_is_campbells_whatever_the_step(step_ns):
    """White excess of variance rate · step in each step becomes rate · integration² ∫h²; Campbell's theorem."""
    step_s, rate = step_ns * 1e-9, 1e10
    filters = Filters(AMPLIFIER, 1025, step_s)
    response = fft.irfft(filters.shot, 1025)
    power = fft.irfft(np.abs(fft.rfft(response.astype(float))) ** 2, 1025)  # its autocorrelation, around the circle
    variance = rate * AMPLIFIER.integration_s**2 / (4.0 * TAU)
    lags = np.arange(0, 30)
    # Factors are float32: 1e-6 of the variance.
    assert rate * step_s * power[lags] == pytest.approx(variance * correlation(lags * step_s), abs=3e-6 * variance)
    # It is as late as the amplifier, ∫ t h = 2τ, to a quarter of a step.
    late = (filters.taps * np.arange(len(filters.taps))).sum() / filters.taps.sum()
    assert late == pytest.approx(2.0 * TAU / step_s, abs=0.25)


@pytest.mark.parametrize("bandwidth_mhz", [20.0, 100.0, 400.0])
@pytest.mark.parametrize("sample_ns", [0.5, 2.38, 7.0, 20.0, 60.0])
@pytest.mark.parametrize("fwhm_ns", [3.0, 8.0, 40.0, 200.0])
def test_noise_is_as_late_as_the_pulse_at_all_steps_that_are_planned(bandwidth_mhz, sample_ns, fwhm_ns):
    """To a quarter of a step up to 2.4 τ, and less than a step later beyond; taps are float32: 1e-5 of all is lost."""
    gsfl = Gsfl(amplifier={"bandwidth_mhz": bandwidth_mhz}, readout={"sample_ns": sample_ns})
    plan = plan_time(gsfl, fwhm_ns * 1e-9)
    filters, steps = Filters(gsfl.amplifier, plan.length, plan.step_s), plan.step_s / gsfl.amplifier.pole_s
    taps = filters.taps.astype(float)
    late = (taps * np.arange(len(taps))).sum() / taps.sum() - 2.0 / steps
    assert -0.25 < late < (0.25 if steps <= 2.4 else 1.0)
    # However long the step, all of the noise comes out.
    assert (taps**2).sum() * filters.noise_electrons**2 == pytest.approx(gsfl.amplifier.noise_electrons**2, rel=1e-5)


@pytest.mark.parametrize("steps_per_sample", [2, 3, 6])
@pytest.mark.parametrize("fwhm_ns", [5.0, 8.0, 12.0])
def test_the_mean_on_the_grid_is_the_pulse(steps_per_sample, fwhm_ns):
    """1e-3 of the peak: the sharing of a return among four steps leaves an error of fourth order in the step."""
    gsfl = Gsfl(steps_per_sample=steps_per_sample)
    photons = returns(3000.0 + 0.037 * np.arange(20), 1000.0, pulse_fwhm_s=fwhm_ns * 1e-9)
    plan = plan_time(gsfl, photons.pulse_fwhm_s)
    rows = place_rows(photons, plan)
    mean = simulate_rows(gsfl, photons, rows, None).amplitude
    time_s = (rows.start[:, None] + np.arange(rows.length)) * plan.step_s - photons.delay_s[:, None]
    pulse = camera_of(gsfl, photons).pulse
    assert np.abs(mean - 8000.0 * pulse.amplitude(time_s)).max() < 1e-3 * 8000.0 * pulse.peak
    assert mean.max() > 0.9 * 8000.0 * pulse.peak  # the rows hold the peak
