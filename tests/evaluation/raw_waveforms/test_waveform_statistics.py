"""Noise, pulse shape and saturation of waveforms, against the equations that made them."""

import math

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.evaluation import RawWaveforms, measure_waveforms, read_pixset
from tests.evaluation.raw_waveforms.recordings_for_tests import (
    FWHM_NS,
    NOISE_COUNTS,
    SAMPLE_NS,
    TOP_COUNTS,
    write_recording,
)


@pytest.fixture(scope="module")
def sets(tmp_path_factory):
    return list(read_pixset(write_recording(tmp_path_factory.mktemp("pixset") / "a", 6)))


@pytest.fixture(scope="module")
def high(sets):
    return measure_waveforms("high", [raw for raw in sets if raw.gain == "high"])


@pytest.fixture(scope="module")
def low(sets):
    return measure_waveforms("low", [raw for raw in sets if raw.gain == "low"])


def test_noise_is_that_of_the_equations(high, low):
    """576 channels of some 60 independent samples: 0.4 % for the rms, and 0.01 for a correlation; rounding adds 0.1 %."""
    for measured, gain in ((high, "high"), (low, "low")):
        assert measured.noise_counts == pytest.approx(math.hypot(NOISE_COUNTS[gain], 1 / math.sqrt(12)), rel=0.02)
        assert measured.noise_correlation[:4] == pytest.approx([4 / 6, 1 / 6, 0.0, 0.0], abs=0.03)
        assert abs(measured.noise_kurtosis) < 0.2


def test_pulses_have_the_width_and_the_edges_of_a_gaussian(high, low):
    """From 10 to 90 % of a Gaussian are 0.716 of its width; noise of 1 to 5 % of the peak moves a quartile by 3 %."""
    for measured in (high, low):
        assert measured.pulses > 50
        assert measured.fwhm_s == pytest.approx(FWHM_NS * 1e-9, rel=0.05)
        edge = (math.sqrt(math.log(10.0)) - math.sqrt(-math.log(0.9))) / (2.0 * math.sqrt(math.log(2.0)))
        assert measured.rise_s == pytest.approx(edge * FWHM_NS * 1e-9, rel=0.06)
        assert measured.fall_s == pytest.approx(edge * FWHM_NS * 1e-9, rel=0.06)
        gaussian = np.exp(-4.0 * math.log(2.0) * (measured.shape_s / measured.fwhm_s) ** 2)
        assert np.sqrt(np.mean((measured.shape - gaussian) ** 2)) < 0.02


def test_pulses_that_others_stretch_do_not_set_the_width(sets):
    """Half of the pulses are drawn out to twice their length, as by a tilted wall; the narrowest quarter is not."""
    wide = []
    for raw in sets[:2]:
        samples = raw.samples_counts.copy()
        samples[::2] = 0.5 * (samples[::2] + np.roll(samples[::2], 12, axis=1))
        wide.append(RawWaveforms("low", samples, raw.sample_s, raw.delay_s, raw.dark_samples))
    assert measure_waveforms("low", wide[:1]).fwhm_s == pytest.approx(FWHM_NS * 1e-9, rel=0.06)


def test_the_clip_level_and_the_way_back_from_it(high, low):
    """Behind the plateau a Gaussian of strength A falls from the top to half of it, between these two crossings."""
    assert low.clipped == 0 and math.isnan(low.clip_counts) and math.isnan(low.clip_over_noise)
    assert high.clipped > 100
    assert high.clip_counts == pytest.approx(TOP_COUNTS, abs=3.0 * NOISE_COUNTS["high"])
    assert high.clip_over_noise == pytest.approx(TOP_COUNTS / NOISE_COUNTS["high"], rel=0.02)
    strength = np.geomspace(1500.0, 40_000.0, 96)
    strong = strength[strength > 1.15 * TOP_COUNTS]  # so that four samples are at the top
    crossing_ns = [FWHM_NS / 2.0 * np.sqrt(np.log2(strong / level)) for level in (TOP_COUNTS, 0.5 * TOP_COUNTS)]
    expected_ns = float(np.median(crossing_ns[1] - crossing_ns[0]))
    assert high.recovery_s * 1e9 == pytest.approx(expected_ns + 0.5 * SAMPLE_NS, abs=0.5 * SAMPLE_NS)


def test_waveforms_that_show_too_little_are_refused(sets):
    raw = sets[0]
    short = RawWaveforms("low", raw.samples_counts, raw.sample_s, raw.delay_s, 8)
    with pytest.raises(ScenarioError, match=r"low: 8 samples precede the light, and 32 are needed"):
        measure_waveforms("low", [short])
    flat = RawWaveforms("low", np.zeros((4, 200)), raw.sample_s, raw.delay_s, 64)
    for empty in ([flat], []):
        with pytest.raises(ScenarioError, match="no noise; give raw waveforms"):
            measure_waveforms("low", empty)


def test_dark_waveforms_have_noise_and_no_pulse(sets):
    raw = sets[0]
    dark = RawWaveforms("low", raw.samples_counts[:, :100], raw.sample_s, raw.delay_s, 90)
    measured = measure_waveforms("low", [dark])
    assert measured.noise_counts == pytest.approx(NOISE_COUNTS["low"], rel=0.04)
    assert measured.pulses == 0 and math.isnan(measured.fwhm_s) and np.isnan(measured.shape).all()
