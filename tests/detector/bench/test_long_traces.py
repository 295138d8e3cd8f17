"""Waveforms of a bench have the noise before the light, the pulse and the clip level that the settings say."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.detector import Gsfl, LaserPulse, Readout, ZeroCrossing, simulate_long_traces
from rso_lidar.errors import ScenarioError


def pulse(fwhm_ns):
    laser = rl.Laser(pulse_fwhm_ns=fwhm_ns)
    return LaserPulse(*laser.pulse, laser.pulse_fwhm_s)


def test_noise_comes_before_the_light_and_half_of_the_pulses_clip():
    gsfl = Gsfl(readout=Readout(sample_ns=1.0, samples=64), zero_crossing=ZeroCrossing())
    waveforms, dark_samples = simulate_long_traces(gsfl, pulse(6.0), 640, 100)
    dark = waveforms.samples_counts[:, :dark_samples].astype(float)
    assert dark_samples == 100 and waveforms.sample_s == pytest.approx(1e-9)
    # 640 traces of some 25 independent samples: 0.6 % for the rms, and 0.05 counts for a mean.
    assert dark.mean(axis=0) == pytest.approx(
        np.full(100, gsfl.readout.baseline_counts), abs=6 * gsfl.noise_counts / 640**0.5
    )
    assert dark.std() == pytest.approx(np.hypot(gsfl.noise_counts, 12**-0.5), rel=0.03)
    top = waveforms.samples_counts.max(axis=1)
    assert (top == gsfl.readout.full_scale_counts).sum() == 320
    assert top.min() > gsfl.readout.baseline_counts + 20.0 * gsfl.noise_counts
    back = waveforms.samples_counts[:, -5:].mean()
    assert back == pytest.approx(gsfl.readout.baseline_counts, abs=1.0)  # all of the pulse is stored


def test_dark_samples_of_more_than_two_microseconds_have_no_light():
    """2,500 samples of 1 ns reach 375 m: a plate at 300 m would shine into the last 500 of them."""
    gsfl = Gsfl(readout=Readout(sample_ns=1.0, samples=64), zero_crossing=ZeroCrossing())
    waveforms, dark_samples = simulate_long_traces(gsfl, pulse(6.0), 64, 2500)
    assert dark_samples == 2500
    dark, light = np.split(waveforms.samples_counts.astype(float), [dark_samples], axis=1)
    # 64 traces: 6 standard errors of a mean
    assert dark.mean(axis=0) == pytest.approx(gsfl.readout.baseline_counts, abs=6 * gsfl.noise_counts / 64**0.5)
    assert light.max(axis=1).min() > gsfl.readout.baseline_counts + 20.0 * gsfl.noise_counts
    assert light[:, -5:].mean() == pytest.approx(gsfl.readout.baseline_counts, abs=1.0)


def test_detectors_without_an_amplifier_are_refused():
    with pytest.raises(ScenarioError, match="has no waveforms of an amplifier; give a camera with one of type 'gsfl'"):
        simulate_long_traces(rl.Empirical(), pulse(6.0), 64)
