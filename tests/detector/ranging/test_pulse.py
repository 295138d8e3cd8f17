import math

import numpy as np
import pytest
from scipy.special import erfcx

from rso_lidar.detector import Pulse
from rso_lidar.detector.ranging.pulse import crlb_s, noise_covariance

FWHM_S = 8e-9
SIGMA_S = FWHM_S / (2 * math.sqrt(2 * math.log(2)))
POLE_S = 1.0243e-9  # two poles, 100 MHz to -3 dB
INTEGRATION_S = 8.516e-9
SAMPLE_S = 2.38e-9
NO_POLE_S = 1e-14


def gaussian(step_s=0.5e-9):
    n = 2 * math.ceil(5.5 * SIGMA_S / step_s) + 1
    time_s = (np.arange(n) - (n - 1) / 2) * step_s
    power = np.exp(-0.5 * (time_s / SIGMA_S) ** 2)
    return step_s, power / (power.sum() * step_s)


def behind_two_poles(time_s):
    """A Gaussian of area 1 convolved with (t/tau^2) exp(-t/tau), in closed form.

    With z = (sigma/tau - t/sigma): integral of u exp(-u/tau) N(t - u) du = sigma/tau^2 N(t/sigma)/sigma (1 - z m(z)),
    m Mills' ratio of the normal distribution, m(z) = sqrt(pi/2) erfcx(z/sqrt 2).
    """
    z = SIGMA_S / POLE_S - time_s / SIGMA_S
    mills = math.sqrt(math.pi / 2) * erfcx(z / math.sqrt(2))
    normal = np.exp(-0.5 * (time_s / SIGMA_S) ** 2) / math.sqrt(2 * math.pi)
    return INTEGRATION_S * SIGMA_S / POLE_S**2 * normal * (1 - z * mills)


@pytest.mark.parametrize("step_s", [0.25e-9, 0.5e-9, 1.0e-9])
def test_without_poles_the_pulse_is_the_light(step_s):
    pulse = Pulse.after(*gaussian(step_s), NO_POLE_S, INTEGRATION_S)
    time_s = np.linspace(-1.5e-8, 1.5e-8, 4001)
    expected = INTEGRATION_S / (SIGMA_S * math.sqrt(2 * math.pi)) * np.exp(-0.5 * (time_s / SIGMA_S) ** 2)
    assert np.abs(pulse.amplitude(time_s) - expected).max() < 1e-5 * expected.max()
    # The preset's integration time is the width of a rectangle as high as the pulse, to its four digits.
    assert pulse.peak == pytest.approx(1.0, abs=1e-4)
    assert pulse.fwhm_s == pytest.approx(FWHM_S, rel=1e-5)
    assert abs(pulse.peak_s) < 1e-13


@pytest.mark.parametrize("step_s", [0.25e-9, 0.5e-9, 1.0e-9])
def test_two_poles_agree_with_the_closed_form(step_s):
    pulse = Pulse.after(*gaussian(step_s), POLE_S, INTEGRATION_S)
    time_s = np.linspace(-1.5e-8, 2.2e-8, 5001)
    expected = behind_two_poles(time_s)
    assert np.abs(pulse.amplitude(time_s) - expected).max() < 1e-5 * expected.max()
    slope = np.gradient(expected, time_s)
    assert np.abs(pulse.slope(time_s) - slope)[1:-1].max() < 2e-5 * np.abs(slope).max()
    fine_s = pulse.peak_s + np.linspace(-5e-10, 5e-10, 10001)
    assert pulse.peak == pytest.approx(behind_two_poles(fine_s).max(), rel=1e-6)
    assert pulse.peak_s == pytest.approx(fine_s[behind_two_poles(fine_s).argmax()], abs=2e-12)


def test_charge_is_kept_and_delayed_by_the_two_poles():
    # H(0) = 1, and the mean delay of h is 2 tau; its variance 2 tau^2 adds to that of the light.
    pulse = Pulse.after(*gaussian(), POLE_S, INTEGRATION_S)
    time_s = np.linspace(pulse.from_s, pulse.to_s, 20001)
    amplitude, step_s = pulse.amplitude(time_s), time_s[1] - time_s[0]
    charge = amplitude.sum() * step_s
    assert charge == pytest.approx(INTEGRATION_S, rel=1e-6)
    mean_s = (time_s * amplitude).sum() * step_s / charge
    assert mean_s == pytest.approx(2 * POLE_S, abs=1e-13)
    variance = ((time_s - mean_s) ** 2 * amplitude).sum() * step_s / charge
    assert variance == pytest.approx(SIGMA_S**2 + 2 * POLE_S**2, rel=1e-4)


def test_time_zero_is_the_middle_of_the_taps_whether_odd_or_even():
    step_s, power = gaussian()
    odd = Pulse.after(step_s, power, POLE_S, INTEGRATION_S)
    later = Pulse.after(step_s, np.append(np.zeros(7), power), POLE_S, INTEGRATION_S)
    assert later.peak_s - odd.peak_s == pytest.approx(3.5 * step_s, abs=1e-13)


def test_outside_its_support_a_pulse_is_nothing():
    pulse = Pulse.after(*gaussian(), POLE_S, INTEGRATION_S)
    assert np.all(pulse.amplitude(np.array([pulse.from_s - 1e-9, pulse.to_s + 1e-9, -1.0, 1.0])) == 0)
    assert pulse.from_s < -4 * SIGMA_S and pulse.to_s > 4 * SIGMA_S
    assert pulse.amplitude(np.float64(pulse.peak_s)).shape == ()


def test_the_rise_is_where_the_pulse_first_passes_a_share_of_its_peak():
    pulse = Pulse.after(*gaussian(), POLE_S, INTEGRATION_S)
    for share in (0.01, 0.3, 0.5, 0.9):
        rise_s = pulse.rise_s(share)
        assert rise_s < pulse.peak_s
        assert pulse.amplitude(np.array(rise_s)) == pytest.approx(share * pulse.peak, abs=1e-5)


def test_noise_covariance_is_that_of_a_two_pole_filter():
    covariance = noise_covariance(5, SAMPLE_S, POLE_S, 3.0)
    x = SAMPLE_S / POLE_S
    assert np.allclose(np.diag(covariance), 9.0)
    assert covariance[1, 2] == pytest.approx(9.0 * (1 + x) * math.exp(-x))
    assert covariance[0, 3] == covariance[3, 0] == pytest.approx(9.0 * (1 + 3 * x) * math.exp(-3 * x))
    assert np.all(np.linalg.eigvalsh(covariance) > 0)
    # The autocorrelation of h, (t/tau^2) exp(-t/tau), over its energy 1/(4 tau).
    time = np.linspace(0.0, 60.0, 600_001)
    h = time * np.exp(-time)
    lag = round(x / 1e-4)
    by_sum = (h[lag:] * h[:-lag]).sum() / (h**2).sum()
    assert covariance[0, 1] / 9.0 == pytest.approx(by_sum, rel=1e-4)


@pytest.mark.parametrize("pole_s", [0.0, 1e-15])
def test_without_poles_the_noise_is_white(pole_s):
    assert np.allclose(noise_covariance(4, SAMPLE_S, pole_s, 2.0), 4.0 * np.eye(4), rtol=0, atol=1e-12)


def test_the_bound_of_a_gaussian_in_white_noise():
    # instrument physics: sigma_t = sqrt(2 s dt / sqrt(pi)) / SNR, 45.3 cm / SNR for 8 ns sampled every 2.38 ns; sums
    # stand for integrals there, good to 1e-3 at this sampling.
    pulse = Pulse.after(*gaussian(), NO_POLE_S, INTEGRATION_S)
    closed_s = math.sqrt(2 * SIGMA_S * SAMPLE_S / math.sqrt(math.pi)) / 10
    for phase in (-0.4, 0.0, 0.25):
        bound_s = crlb_s(pulse, 1000.0, SAMPLE_S, 100.0, phase)
        assert bound_s == pytest.approx(closed_s, rel=1e-3)
        assert bound_s * 0.5 * 299_792_458.0 == pytest.approx(0.0453, abs=5e-5)


def test_the_bound_falls_with_signal_and_knows_white_from_coloured():
    pulse = Pulse.after(*gaussian(), POLE_S, INTEGRATION_S)
    white = crlb_s(pulse, 500.0, SAMPLE_S, 50.0)
    assert crlb_s(pulse, 1000.0, SAMPLE_S, 50.0) == pytest.approx(white / 2)
    assert crlb_s(pulse, 500.0, SAMPLE_S, noise_covariance(20, SAMPLE_S, 0.0, 50.0)) == pytest.approx(white)
    # Noise that holds together from sample to sample hides a slope less well averaged: the bound is worse.
    assert crlb_s(pulse, 500.0, SAMPLE_S, noise_covariance(20, SAMPLE_S, POLE_S, 50.0)) > 1.1 * white
