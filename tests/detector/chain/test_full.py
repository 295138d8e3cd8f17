"""The range gate: a threshold of constant false-alarm rate, averaging of pulses, and nothing seen outside."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rso_lidar.detector import Gate, Gsfl, detect, detect_with_taps, make_plate, run_trial
from rso_lidar.detector.bench.calibration import make_reference_pulse
from rso_lidar.detector.settings.apd import noise_rms
from rso_lidar.errors import ScenarioError
from tests.detector.returns_for_tests import nothing, returns

C = 299_792_458.0
QUIET = Gsfl(timing={"pixel_jitter_ns": 0.0})


def gated(part=QUIET, **gate):
    return part.replace(gate={"delay_ns": 19_990.0, **gate})


def false_alarms(part, frames, seed=1):
    """Return how many pixels of empty frames report something, and of how many."""
    rng = np.random.default_rng(seed)
    seen = sum(np.isfinite(detect(nothing((128, 128)), part, rng)[0].range_m).sum() for _ in range(frames))
    return int(seen), frames * 16_384


def test_false_alarms_are_as_many_as_asked_for():
    """A gate of 200 ns, whose ends matter little: 4 sigma of the binomial, and 10 % for the fit's best place."""
    seen, n = false_alarms(gated(width_ns=200.0, false_alarm_probability=1e-2), 4)
    assert abs(seen - 1e-2 * n) < 4.0 * math.sqrt(1e-2 * 0.99 * n) + 1e-3 * n


@pytest.mark.parametrize("pulses", [1, 4])
def test_a_short_gate_keeps_below_the_false_alarms_asked_for(pulses):
    """20 samples: at the two ends the filter sees less noise. 4 sigma above what is asked for, and no less than half."""
    seen, n = false_alarms(gated(pulses=pulses, false_alarm_probability=1e-2), 4)
    assert 0.5 * 1e-2 * n < seen < 1e-2 * n + 4.0 * math.sqrt(1e-2 * n)


def test_the_amplitude_of_a_frame_is_the_mean_over_its_pulses_as_its_samples_are():
    part = gated(QUIET.replace(readout=QUIET.readout.replace(quantised=False)), width_ns=60.0, pulses=3)
    light = returns(np.full(2, 3000.0), [500.0, 2000.0])
    _, waveforms, taps = detect_with_taps(light, part, np.random.default_rng(4))
    at_samples = taps.amplitude_electrons[:, :: round(waveforms.sample_s / taps.step_s)]
    above = waveforms.samples_counts - waveforms.baseline_counts
    assert above.max() > 10.0
    np.testing.assert_allclose(above, at_samples / part.readout.electrons_per_count, rtol=1e-4, atol=1e-2)


@pytest.mark.parametrize("shape", [(1, 1), (4, 4)])
def test_few_pixels_do_not_mistake_the_noise(shape):
    """One pixel's twenty samples tell little of the noise; at 1e-6 false alarms 200 frames of 16 pixels see none."""
    part = gated(false_alarm_probability=1e-6)
    rng = np.random.default_rng(12)
    for _ in range(200):
        assert np.isnan(detect(nothing(shape), part, rng)[0].range_m).all()


def test_a_view_full_of_light_does_not_lower_the_threshold():
    """500 photons in 2,000 pixels, alone or among 2,000 bright ones: as often seen, 4 sigma of two binomials, and 3 %.

    Alone, the noise is measured; among bright ones it is what the dark is known for, and 1 % of it is 2 % of detection here.
    """
    alone, among = np.zeros(4000), np.full(4000, 50_000.0)
    alone[:2000] = among[:2000] = 500.0
    seen = [
        run_trial(
            gated(width_ns=60.0), make_plate(photons, 4000, make_reference_pulse(), 8e-9), np.random.default_rng(13 + k)
        )
        for k, photons in enumerate((alone, among))
    ]
    one, other = (found.detected[:2000].mean() for found in seen)
    assert 0.5 < one < 0.95
    assert abs(one - other) < 4.0 * math.sqrt(2.0 * one * (1.0 - one) / 2000) + 0.03


@pytest.mark.parametrize("pulses", [1, 4, 25])
def test_averaging_narrows_the_noise_by_the_root_of_the_pulses(pulses):
    """rms of the samples σ/√M, rounding's 1/12 count² included: each row's mean square is independent, 4 standard errors."""
    part = gated(pulses=pulses)
    _, waveforms = detect(nothing((32, 64)), part, np.random.default_rng(3))
    square = (waveforms.samples_counts.astype(float) - waveforms.baseline_counts) ** 2
    sigma2 = ((part.noise_electrons / part.readout.electrons_per_count) ** 2 + 1.0 / 12.0) / pulses
    rows = square.mean(axis=1)
    assert abs(rows.mean() - sigma2) < 4.0 * rows.std() / math.sqrt(len(rows))


def test_background_raises_the_noise_in_the_gate():
    """Campbell's theorem for sunlight of 1e11 photons/s: QE · 1e11 more primaries a second; the baseline stays."""
    bright = replace(nothing((32, 64)), background_photons_per_s=np.full((32, 64), 1e11))
    part = gated()
    _, waveforms = detect(bright, part, np.random.default_rng(4))
    counts = waveforms.samples_counts.astype(float) - waveforms.baseline_counts
    amplifier = part.amplifier
    rate = part.apd.dark_electrons_per_s + 0.8e11
    sigma = noise_rms(part.apd, rate, amplifier.noise_electrons, amplifier.pole_s, amplifier.integration_s) / 200.0
    rows = (counts**2).mean(axis=1)
    assert abs(rows.mean() - sigma**2 - 1.0 / 12.0) < 4.0 * rows.std() / math.sqrt(len(rows))
    assert sigma > 1.2 * part.noise_electrons / 200.0
    assert abs(counts.mean()) < 4.0 * counts.mean(axis=1).std() / math.sqrt(len(rows))


def test_background_costs_detection():
    photons = make_plate(400.0, 2048, make_reference_pulse(), 8e-9)
    sunlit = replace(photons, background_photons_per_s=np.full((1, 2048), 3e11))
    dark = run_trial(gated(width_ns=60.0), photons, np.random.default_rng(5)).probability
    assert run_trial(gated(width_ns=60.0), sunlit, np.random.default_rng(5)).probability < dark - 0.1


def test_nothing_outside_the_gate_is_seen_and_all_inside():
    """The gate holds 2996.4 m to 3003.5 m; pulses whose peak is three FWHM outside leave nothing in it."""
    part = gated(false_alarm_probability=1e-6)
    assert (part.gate.from_m, part.gate.to_m) == pytest.approx((2996.43, 3003.56), abs=0.01)
    assert (part.sees_from_m, part.sees_to_m) == (part.gate.from_m, part.gate.to_m)
    range_m = np.array([100.0, 2990.0, 2999.0, 3000.3, 3001.6, 3008.0, 4500.0])
    reading, waveforms = detect(returns(range_m, 20_000.0), part, np.random.default_rng(6))
    seen = reading.range_m.ravel()
    assert np.isfinite(seen).tolist() == [False, False, True, True, True, False, False]
    assert seen[2:5] == pytest.approx(range_m[2:5], abs=0.05)
    # Samples outside hold noise alone, which 6 sigma bounds.
    outside = waveforms.samples_counts[[0, 1, 5, 6]] - waveforms.baseline_counts
    assert np.abs(outside).max() < 6.0 * part.noise_electrons / 200.0


def test_every_pixel_stores_the_same_samples_and_none_triggers():
    part = gated(width_ns=100.0)
    _, waveforms = detect(nothing((8, 16)), part, np.random.default_rng(7))
    assert waveforms.samples_counts.shape == (128, round(100.0 / 2.38))
    assert np.array_equal(waveforms.pixel, np.arange(128)) and np.isnan(waveforms.latch_s).all()
    start_s = waveforms.start_s
    assert np.ptp(start_s) == 0.0 and 0.0 <= start_s[0] - 19_990e-9 < 2.38e-9  # the first clock after the gate opens


def test_several_returns_in_the_gate():
    part = gated(QUIET.replace(max_returns=3), width_ns=120.0)
    photons = returns(np.array([3000.0, 3005.0, 3010.0]), 10_000.0, np.zeros(3, int), (1, 1))
    reading, _ = detect(photons, part, np.random.default_rng(8))
    assert reading.return_range_m[0, 0] == pytest.approx([3000.0, 3005.0, 3010.0], abs=0.06)


def test_averaging_pulses_makes_30_photons_visible():
    """A quiet amplifier (300 electrons): one flash shows next to none of them; 40 have a matched signal of 5 sigma."""
    part = Gsfl(preset="offset_limited", timing={"pixel_jitter_ns": 0.0})
    photons = make_plate(30.0, 1024, make_reference_pulse(), 8e-9)
    one = run_trial(gated(part, width_ns=60.0), photons, np.random.default_rng(9)).probability
    many = run_trial(gated(part, width_ns=60.0, pulses=40), photons, np.random.default_rng(9)).probability
    assert one < 0.1 and many > 0.8


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"delay_ns": -1.0}, "delay_ns"),
        ({"delay_ns": 10.0, "width_ns": 0.0}, "width_ns"),
        ({"delay_ns": 10.0, "pulses": 0}, "pulses"),
        ({"delay_ns": 10.0, "false_alarm_probability": 1.0}, "false_alarm_probability"),
        ({}, "delay_ns: is missing"),
    ],
)
def test_what_cannot_be_is_one_line(settings, says):
    with pytest.raises(ScenarioError, match=says) as caught:
        Gate(**settings)
    assert "\n" not in str(caught.value)
