"""The waveforms of a real flash lidar, Leddar PixSet, beside the simulated chain; skipped where no recording is at hand."""

import os
from pathlib import Path

import pytest

from rso_lidar.evaluation import compare_waveforms
from rso_lidar.scenario import Lidar

# Free: the length of the pulse and the bandwidth. Not free: that noise and pulse come from two poles and a Gaussian.
_LARGEST_SHAPE = 0.1  # of the peak: the difference at which the chain's pulse is said not to be this camera's
_LARGEST_CORRELATION = 0.15


@pytest.fixture(scope="module")
def recording():
    folder = Path(os.environ.get("RSO_LIDAR_SHARED", "."), "pixset")
    if not any(folder.glob("*_ftrr.zip")):
        pytest.skip("needs a recording of Leddar PixSet in pixset/ of the folder that RSO_LIDAR_SHARED names")
    return folder


def compare(recording, fwhm_ns, bandwidth_mhz):
    lidar = Lidar(
        preset="gsfl_1064",
        laser={"pulse_fwhm_ns": fwhm_ns},
        detector={"readout": {"sample_ns": 1.25}, "amplifier": {"bandwidth_mhz": bandwidth_mhz}},
    )
    return compare_waveforms(recording, lidar, flashes=10)


@pytest.fixture(scope="module")
def compared(recording):
    """Return the comparison with the length of pulse and the bandwidth that come nearest in the high gain."""
    cases = [compare(recording, fwhm_ns, mhz) for fwhm_ns in (8.0, 12.0, 16.0, 20.0) for mhz in (25.0, 50.0, 100.0)]
    return min(cases, key=lambda case: abs(case.simulated.fwhm_s - case.measured[1].fwhm_s))


def test_the_pulse_has_the_shape_of_the_chain(compared, validation):
    validation(
        case="PixSet, high gain: rms difference of the mean pulse from the simulated, over the peak",
        source="waveforms of a Leddar Pixell; width and bandwidth are free",
        expected=0.0,
        got=compared.shape_difference(compared.measured[1]),
        tolerance=_LARGEST_SHAPE,
        unit="",
    )


def test_the_noise_is_correlated_as_behind_two_poles(recording, compared, validation):
    measured = compared.measured[1].noise_correlation[:8]
    own = [compare(recording, 12.0, mhz).simulated.noise_correlation[:8] for mhz in (15.0, 25.0, 50.0, 100.0, 200.0)]
    validation(
        case="PixSet, high gain: largest difference of correlations of samples 1 to 8 apart, nearest of five bandwidths",
        source="waveforms of a Leddar Pixell",
        expected=0.0,
        got=min(float(abs(measured - simulated).max()) for simulated in own),
        tolerance=_LARGEST_CORRELATION,
        unit="",
    )


def test_strong_returns_clip_in_the_high_gain_at_one_level(compared):
    low, high = compared.measured
    assert high.clipped > 10 and high.clip_over_noise > 50.0
    assert compared.gain_ratio > 1.0
    assert low.clipped < high.clipped
