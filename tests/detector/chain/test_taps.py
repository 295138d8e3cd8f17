"""Signals between the stages: what is kept of them is what the samples and the latches were made from."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.detector import Empirical, Gate, Gsfl, detect, detect_with_taps
from rso_lidar.detector.chain.camera import draw_camera_pixels
from rso_lidar.detector.chain.taps import tap_stages
from rso_lidar.detector.stages.sampling import convert
from rso_lidar.errors import ScenarioError
from tests.detector.returns_for_tests import nothing, returns

N = 400
# A false trigger in one of ten pixels: noise at 4.4 times its rms.
NOISY = Gsfl(trigger={"threshold_electrons": 4600.0}, maps={}, armed_from_m=900.0, armed_to_m=3000.0)


def lit():
    """Return N pixels, half of them with a return of 3000 photons and the others dark."""
    return returns(np.full(N // 2, 1000.0), 3000.0, np.arange(0, N, 2), (1, N))


def test_the_samples_are_taken_from_the_amplitude():
    reading, waveforms, taps = detect_with_taps(lit(), NOISY, np.random.default_rng(1))
    assert 20 < np.count_nonzero(taps.pixel % 2) < N // 2  # false triggers of dark pixels are among them
    per_sample = round(waveforms.sample_s / taps.step_s)
    offset = draw_camera_pixels(NOISY, N).offset_counts[taps.pixel, None]
    np.testing.assert_array_equal(
        convert(NOISY.readout, taps.amplitude_electrons[:, ::per_sample], offset), waveforms.samples_counts
    )
    np.testing.assert_array_equal(taps.start_s, waveforms.start_s)
    again, same = detect(lit(), NOISY, np.random.default_rng(1))
    np.testing.assert_array_equal(again.range_m, reading.range_m)
    np.testing.assert_array_equal(same.samples_counts, waveforms.samples_counts)


def test_the_comparator_is_high_from_the_latch_on():
    _, waveforms, taps = detect_with_taps(lit(), NOISY, np.random.default_rng(2))
    level = taps.threshold_electrons[:, None]
    known = np.isfinite(taps.amplitude_electrons)
    np.testing.assert_array_equal(taps.comparator[known], (taps.amplitude_electrons >= level)[known])
    assert (taps.comparator[~known] == -1).all()
    after = np.ceil((waveforms.latch_s - taps.start_s) / taps.step_s).astype(int)
    by_light = np.abs(waveforms.latch_s * 149_896_229.0 - 1000.0) < 3.0
    rows = np.flatnonzero((taps.pixel % 2 == 0) & by_light)
    assert len(rows) > 100
    assert known[rows].all()
    # Noise may cross between two steps and be below at both.
    assert (taps.comparator[rows, after[rows]] == 1).mean() > 0.97


def test_a_comparator_is_high_where_the_amplitude_just_reaches_the_threshold():
    amplitude = np.array([[3.0, 4.0, 5.0, np.nan]])
    given = {"pixel": np.zeros(1, int), "start_s": np.zeros(1), "primaries": amplitude, "amplitude": amplitude}
    assert tap_stages((1, 1), 1e-9, threshold=np.array([4.0]), **given).comparator.tolist() == [[0, 1, 1, -1]]


def test_primaries_hold_the_photoelectrons_of_pulse_and_dark_current():
    _, _, taps = detect_with_taps(lit(), NOISY, np.random.default_rng(3))
    real = taps.pixel % 2 == 0
    dark = NOISY.apd.dark_electrons_per_s * taps.step_s
    total = taps.primaries[real].sum(axis=1) - dark * taps.primaries.shape[1]
    # The pulse begins before the first stored step by less than 1e-3 of it.
    near = np.abs(total / (3000.0 * NOISY.quantum_efficiency) - 1.0) < 2e-3
    assert near.mean() > 0.95  # a false trigger may come before the pulse
    assert taps.primaries[~real] == pytest.approx(dark, rel=1e-4)


def test_a_gate_has_no_comparator_and_averages_its_pulses():
    gate = Gate(delay_ns=6600.0, width_ns=140.0, pulses=3)
    part = NOISY.replace(gate=gate, readout={"quantised": False, "baseline_counts": 1000.0})
    _, waveforms, taps = detect_with_taps(lit(), part, np.random.default_rng(4))
    assert np.isnan(taps.threshold_electrons).all()
    assert (taps.comparator == -1).all()
    per_sample = round(waveforms.sample_s / taps.step_s)
    offset = draw_camera_pixels(part, N).offset_counts[taps.pixel, None]
    counts = convert(part.readout, taps.amplitude_electrons[:, ::per_sample], offset)
    assert not waveforms.clipped.any()
    np.testing.assert_allclose(counts, waveforms.samples_counts, atol=2e-2)


def test_a_flash_keeps_them_where_asked_for():
    scenario = rl.Scenario.load("examples/bench_plate.toml")
    scenario = scenario.replace(lidar=scenario.lidar.replace(detector=Gsfl()))
    (frame,) = rl.simulate(scenario, frames=[0], keep=["taps", "waveforms"])
    assert frame.kept["taps"].pixel.tolist() == frame.kept["waveforms"].pixel.tolist()
    with pytest.raises(ScenarioError, match='detector "empirical" has no taps'):
        rl.simulate(scenario.replace(lidar=scenario.lidar.replace(detector=Empirical())), keep="taps")


def test_an_empty_scene_has_none():
    _, _, taps = detect_with_taps(nothing((2, 3)), Gsfl(armed_to_m=2.0), np.random.default_rng(5))
    assert taps.primaries.shape[0] == 0
    assert detect_with_taps(nothing((2, 3)), Empirical(), np.random.default_rng(5))[2] is None
