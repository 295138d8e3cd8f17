"""From samples to range and intensity: which returns are reported, how they are laid out, and what is told of them."""

import numpy as np
import pytest
from scipy import stats

from rso_lidar.detector import Gsfl, detect
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.measurement import measure
from rso_lidar.records import Waveforms
from tests.detector.returns_for_tests import nothing, returns

C = 299_792_458.0
PART = Gsfl(preset="offset_limited", timing={"pixel_jitter_ns": 0.0}, armed_to_m=20_000.0)
PULSE = camera_of(PART, nothing((1, 1))).pulse
BASELINE = PART.readout.baseline_counts


def stored(range_m, counts, shape=None, lead=9.3):
    """Return samples without noise of pulses (trace, pulse) at ranges [m] of peak heights [counts].

    The nominal delay of the first lies `lead` samples after the first sample, its peak most of a sample later.
    """
    range_m, counts = np.atleast_2d(np.asarray(range_m, dtype=float)), np.atleast_2d(np.asarray(counts, dtype=float))
    first_s = 2.0 * range_m[:, 0] / C - lead * 2.38e-9
    time_s = first_s[:, None] + np.arange(20) * 2.38e-9
    samples = np.full(time_s.shape, BASELINE)
    for k in range(range_m.shape[1]):
        samples += counts[:, k, None] * PULSE.amplitude(time_s - 2.0 * range_m[:, k, None] / C) / PULSE.peak
    n = len(samples)
    return Waveforms(
        shape=shape or (1, n),
        sample_s=2.38e-9,
        baseline_counts=BASELINE,
        pixel=np.arange(n),
        start_s=first_s,
        latch_s=first_s + 8.5 * 2.38e-9,
        samples_counts=np.clip(samples, 0.0, 4095.0),
    )


def read(part, waveforms, seed=0):
    return measure(camera_of(part, nothing(waveforms.shape)).processor, waveforms, np.random.default_rng(seed))


def test_a_pulse_is_where_it_is_and_as_high_as_it_is():
    """Without noise, at every phase of the clock: 1 mm, and half a count of rounding with the template's 1e-3."""
    range_m = 1000.0 + np.linspace(0.0, 0.36, 97)[:, None]
    reading = read(PART, stored(range_m, np.full((97, 1), 800.0)))
    assert reading.range_m.ravel() == pytest.approx(range_m.ravel(), abs=1e-3)
    assert reading.intensity_counts.ravel() == pytest.approx(800, abs=1)
    assert not reading.saturated.any()


TWO = stored([[1000.0, 1003.0]], [[500.0, 900.0]])


@pytest.mark.parametrize(
    ("returns_", "range_m", "counts"), [("first", 1000.0, 500), ("strongest", 1003.0, 900), ("last", 1003.0, 900)]
)
def test_which_of_two_surfaces_is_reported(returns_, range_m, counts):
    reading = read(PART.replace(returns=returns_), TWO)
    assert reading.range_m[0, 0] == pytest.approx(range_m, abs=0.02)
    assert reading.intensity_counts[0, 0] == pytest.approx(counts, abs=5)
    assert reading.return_range_m is None and reading.return_intensity_counts is None


def test_the_strongest_may_be_the_first_and_the_last_the_weaker():
    one = stored([[1000.0, 1003.0]], [[900.0, 500.0]])
    assert read(PART.replace(returns="strongest"), one).range_m[0, 0] == pytest.approx(1000.0, abs=0.02)
    assert read(PART.replace(returns="last"), one).range_m[0, 0] == pytest.approx(1003.0, abs=0.02)


def test_returns_are_listed_near_to_far_and_padded():
    both = stored([[1000.0, 1003.0], [1000.0, 1000.0]], [[500.0, 900.0], [400.0, 400.0]], shape=(2, 1))
    reading = read(PART.replace(max_returns=3, returns="strongest"), both)
    assert reading.return_range_m.shape == reading.return_intensity_counts.shape == (2, 1, 3)
    assert reading.return_range_m[0, 0, :2] == pytest.approx([1000.0, 1003.0], abs=0.02)
    assert reading.return_intensity_counts[0, 0, :2] == pytest.approx([500, 900], abs=5)
    assert np.isnan(reading.return_range_m[0, 0, 2]) and reading.return_intensity_counts[0, 0, 2] == 0
    assert np.isfinite(reading.return_range_m[1, 0]).tolist() == [True, False, False]
    assert reading.return_intensity_counts[1, 0].tolist() == [800, 0, 0]
    assert reading.range_m[:, 0] == pytest.approx([1003.0, 1000.0], abs=0.02)


def test_more_returns_than_are_asked_for_are_left_out():
    far = stored([[1000.0, 1002.7, 1005.4]], [[500.0, 600.0, 700.0]], lead=1.5)
    reading = read(PART.replace(max_returns=2, returns="last"), far)
    assert reading.return_range_m[0, 0] == pytest.approx([1000.0, 1002.7], abs=0.03)
    assert reading.range_m[0, 0] == pytest.approx(1005.4, abs=0.05)  # of all that were found


def edges(apart_m, n=200, photons=10_000.0):
    """Return the photons of n pixels that see two surfaces each."""
    return returns(np.tile([1000.0, 1000.0 + apart_m], n), photons, np.repeat(np.arange(n), 2), (10, n // 10))


def test_two_surfaces_4_m_apart_through_the_whole_chain():
    """Four cells before the latch leave room for both in the 7.1 m stored; 3 cm is the bound here, 6 sigma of it."""
    part = PART.replace(readout={"pretrigger_samples": 4}, max_returns=2)
    reading, _ = detect(edges(4.0), part, np.random.default_rng(1))
    assert np.abs(reading.return_range_m - [1000.0, 1004.0]).max() < 0.18
    assert np.array_equal(reading.range_m, reading.return_range_m[..., 0])
    assert np.array_equal(reading.intensity_counts, reading.return_intensity_counts[..., 0])
    last, _ = detect(edges(4.0), part.replace(max_returns=1, returns="last"), np.random.default_rng(1))
    assert np.array_equal(last.range_m, reading.return_range_m[..., 1])


@pytest.mark.parametrize("apart_m", [3.5, 4.0, 5.0, 12.0])
def test_what_peaks_beyond_the_stored_samples_is_not_reported(apart_m):
    """Eight cells before the latch leave 4.3 m after it: of a second surface there is a flank at most, no range."""
    reading, _ = detect(edges(apart_m), PART.replace(max_returns=4, returns="last"), np.random.default_rng(2))
    assert np.abs(reading.range_m - 1000.0).max() < 0.18
    assert np.array_equal(np.isfinite(reading.return_range_m).sum(axis=-1), np.ones((10, 20)))


def test_two_surfaces_2_m_apart_need_no_other_readout():
    reading, _ = detect(edges(2.0), PART.replace(max_returns=4), np.random.default_rng(3))
    assert np.abs(reading.return_range_m[..., :2] - [1000.0, 1002.0]).max() < 0.25


@pytest.mark.parametrize("several", [1, 4])
def test_what_latched_is_reported_with_at_least_one_count(several):
    """Traces of next to nothing, as noise may leave them: a range near the latch, and a count that says valid."""
    rng = np.random.default_rng(3)
    faint = stored(np.full((50, 1), 1000.0), np.full((50, 1), 0.2))
    samples = np.rint(faint.samples_counts + rng.normal(0.0, 0.6, faint.samples_counts.shape))
    waveforms = Waveforms(**{**vars(faint), "samples_counts": samples})
    reading = read(PART.replace(max_returns=several), waveforms)
    assert np.isfinite(reading.range_m).all() and reading.intensity_counts.min() >= 1
    assert np.abs(reading.range_m - 1000.0).max() < PART.readout.window_m


def test_no_traces_are_no_returns():
    empty = Waveforms(
        shape=(3, 5),
        sample_s=2.38e-9,
        baseline_counts=BASELINE,
        pixel=np.zeros(0),
        start_s=np.zeros(0),
        latch_s=np.zeros(0),
        samples_counts=np.zeros((0, 20)),
    )
    for part in (PART, PART.replace(max_returns=2)):
        reading = read(part, empty)
        assert np.isnan(reading.range_m).all() and not reading.intensity_counts.any() and not reading.saturated.any()
    assert reading.return_range_m.shape == (3, 5, 2) and np.isnan(reading.return_range_m).all()


def test_a_pulse_beyond_full_scale_is_flagged_and_clipped():
    reading = read(PART, stored([[1000.0], [1000.0]], [[20_000.0], [3000.0]]))
    assert reading.saturated.ravel().tolist() == [1, 0]
    assert reading.intensity_counts[0, 0] == PART.full_scale_counts and PART.full_scale_counts == 4095 - 64
    assert reading.range_m[0, 0] == pytest.approx(1000.0, abs=0.05)  # from its flanks


def test_calibration_takes_the_walk_of_a_leading_edge_off():
    """Instrument physics: from 2 to 50 times the threshold a leading edge walks by 0.8 m; corrected, by centimetres."""
    threshold = PART.trigger.threshold_electrons / PART.readout.electrons_per_count
    counts = threshold * np.geomspace(2.0, 50.0, 40)[:, None]
    trace = stored(np.full((40, 1), 1000.0) + 0.009 * np.arange(40)[:, None], counts)
    truth = 1000.0 + 0.009 * np.arange(40)
    raw = read(PART.replace(ranging={"algorithm": "leading_edge"}), trace).range_m.ravel() - truth
    corrected = read(PART.replace(ranging={"algorithm": "leading_edge", "walk_correction": True}), trace)
    assert 0.6 < np.ptp(raw) < 1.1 and np.all(np.diff(raw) < 0.1)
    assert np.abs(corrected.range_m.ravel() - truth).max() < 0.1


def test_jitter_of_a_pixel_depends_on_the_pixel_not_on_who_else_latched():
    part = PART.replace(timing={"pixel_jitter_ns": 0.5})
    all_of_them = stored(np.full((6, 1), 1000.0), np.full((6, 1), 500.0), shape=(2, 3))
    fields = {name: getattr(all_of_them, name)[[1, 4]] for name in ("pixel", "start_s", "latch_s", "samples_counts")}
    some = Waveforms(**{**vars(all_of_them), **fields})
    assert np.array_equal(read(part, some).range_m.ravel()[[1, 4]], read(part, all_of_them).range_m.ravel()[[1, 4]])


def test_jitter_is_normal():
    """Kolmogorov and Smirnov's test of 4000 pixels that would otherwise read the same; 0.1 % would fail by chance."""
    part = PART.replace(timing={"pixel_jitter_ns": 0.5})
    flash = stored(np.full((4000, 1), 1000.0), np.full((4000, 1), 500.0), shape=(40, 100))
    error_s = (read(part, flash).range_m - read(PART, flash).range_m).ravel() * 2.0 / C
    assert stats.kstest(error_s / 0.5e-9, "norm").pvalue > 1e-3
