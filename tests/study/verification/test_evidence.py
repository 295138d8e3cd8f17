"""Confidence bounds of runs: as wide as their probability says, and none where the sample is too small."""

import math

import numpy as np
import pytest

from rso_lidar.study.trades.merits import MERITS, Run
from rso_lidar.study.trades.run_sums import FrameSums, RunSums, combine_sums
from rso_lidar.study.verification.evidence import (
    bound_count,
    bound_merit,
    bound_proportion,
    bound_series,
    integrated_time,
)
from rso_lidar.study.verification.quantities import STATISTICS

RUN = Run(None, 0, RunSums(0, 1.0), np.empty(0), np.empty(0))


@pytest.fixture
def few_draws(monkeypatch):
    """Draw less often, for a tenth of the time; bounds scatter by some percent of their distance more."""
    monkeypatch.setattr("rso_lidar.study.verification.evidence._REPLICATES", 250)


def frame(found, pixels=100.0, error_m=0.05, **more):
    bin_ = int(math.log(error_m / 1e-4) / 0.01)
    sums = {"frames": 1.0, "pixels": pixels, "found": found, "false": 0.0, "hits": float(found > 0)}
    sums |= {"squared_m2": found * error_m**2, "photons": 0.0, "first": bin_, "counts": np.array([float(found)])}
    return FrameSums(**sums | more)


def covered(bounds, truth):
    """Return how often one-sided lower and upper bounds hold."""
    low, high = np.array(bounds).T
    return np.mean(low <= truth), np.mean(high >= truth)


def test_pixels_of_a_frame_that_share_its_pulse_are_no_independent_trials():
    rng, n = np.random.default_rng(3), 400
    clustered, alone = [], []
    for _ in range(n):
        hits = rng.binomial(50, rng.beta(8.0, 2.0, 30)).astype(float)  # mean 0.8; 30 frames of 50 pixels
        trials = np.full(30, 50.0)
        clustered.append(bound_proportion(hits, trials, 0.95))
        alone.append(bound_proportion(np.repeat(hits / 50, 50), np.ones(1500), 0.95))
    for share in covered(clustered, 0.8):
        assert 0.917 < share < 0.995  # 0.95 less three standard deviations; exact bounds may be wider
    assert min(covered(alone, 0.8)) < 0.85


def test_a_proportion_of_one_is_bounded_by_the_number_of_frames():
    low, high = bound_proportion(np.full(60, 80.0), np.full(60, 80.0), 0.95)
    assert (low, high) == (pytest.approx(0.05 ** (1 / 60)), 1.0)
    assert np.isnan(bound_proportion(np.zeros(4), np.zeros(4), 0.95)).all()


def test_no_event_is_bounded_by_the_rule_of_three():
    assert bound_count(np.zeros(20), 0.95) == (0.0, pytest.approx(-math.log(0.05) / 20))


def test_bursts_of_events_count_for_less():
    steady, bursts = np.full(40, 4.0), np.tile([0.0, 16.0, 0.0, 0.0], 10)
    assert bound_count(steady, 0.95)[1] < 4.6 < 6.0 < bound_count(bursts, 0.95)[1]
    rng = np.random.default_rng(5)
    for share in covered([bound_count(rng.poisson(6.0, 25).astype(float), 0.95) for _ in range(400)], 6.0):
        assert 0.917 < share < 0.995


def test_the_bootstrap_of_frames_covers(few_draws):
    rng, bounds = np.random.default_rng(7), []
    for _ in range(200):
        frames = [frame(found=float(k)) for k in rng.gamma(4.0, 10.0, 20).round()]
        got = bound_merit(MERITS["returns_on_target"], RUN, frames, 0.9)
        bounds.append((got.low, got.high))
        assert got.low < got.value < got.high and got.note == ""
    assert min(covered(bounds, 40.0)) > 0.9 - 3 * math.sqrt(0.09 / 200)


def test_frames_of_which_most_show_nothing_have_no_bound():
    """Some draws of them have no pixel at all."""
    frames = [frame(50.0)] + [frame(0.0)] * 19
    got = bound_merit(MERITS["range_rms_m"], RUN, frames, 0.95)
    assert math.isnan(got.low) and got.note == "some draws of frames have no value"


def test_the_quantile_of_errors_is_that_of_all_pixels():
    frames = [frame(60.0, error_m=0.02 if k % 5 else 0.2) for k in range(20)]
    got = bound_merit(MERITS["range_error_m"], RUN, frames, 0.95)
    assert got.value == pytest.approx(0.02, rel=0.01)  # 80 % of the pixels are within it
    assert got.low == pytest.approx(0.02, rel=0.01) and got.high == pytest.approx(0.2, rel=0.01)


def test_weighted_sums_are_sums_of_copies():
    frames = [frame(10.0, error_m=0.03), frame(20.0, error_m=0.4, false=2.0), frame(0.0)]
    copies = RunSums(0, 1.0)
    for k in (0, 1, 1, 1):
        copies.include(frames[k])
    (got,) = combine_sums(frames, np.array([[1.0, 3.0, 0.0]]))
    for name in ("frames", "pixels", "found", "false", "hits", "squared_m2"):
        assert getattr(got, name) == pytest.approx(getattr(copies, name))
    assert got.error_within_m(0.5) == copies.error_within_m(0.5)


def test_too_few_frames_show_nothing():
    got = bound_merit(MERITS["range_rms_m"], RUN, [frame(10.0)] * 7, 0.95)
    assert got.value == pytest.approx(0.05) and math.isnan(got.low) and "8 frames" in got.note
    nothing = bound_merit(MERITS["range_rms_m"], RUN, [frame(0.0)] * 20, 0.95)
    assert math.isnan(nothing.value) and "no value" in nothing.note


def test_a_tracker_that_errs_slowly_is_few_samples(few_draws):
    rng = np.random.default_rng(11)

    def series(n, memory):
        drawn, state = rng.normal(size=n), 0.0
        made = np.empty(n)
        for k in range(n):
            state = memory * state + math.sqrt(1 - memory**2) * drawn[k]
            made[k] = state
        return made

    assert integrated_time(series(20_000, 0.0)) == pytest.approx(1.0, abs=0.15)
    assert integrated_time(series(20_000, 0.9)) == pytest.approx(19.0, rel=0.3)  # (1 + 0.9) / (1 - 0.9)
    bounds = []
    for _ in range(80):
        got = bound_series([series(400, 0.7)], STATISTICS["rms"], 0.9, 9)
        bounds.append((got.low, got.high))
    assert min(covered(bounds, 1.0)) > 0.9 - 4 * math.sqrt(0.09 / 80)  # blocks are short of it by a little
    slow = bound_series([np.sin(np.linspace(0.2, 1.4, 30))], STATISTICS["rms"], 0.9, 9)
    assert math.isnan(slow.low) and "set seeds" in slow.note and math.isfinite(slow.value)


def test_frames_before_the_first_fix_do_not_count():
    values = np.random.default_rng(2).normal(size=60)
    with_gap = np.concatenate([np.full(5, np.nan), values])
    got, whole = (bound_series([one], STATISTICS["rms"], 0.9, 9) for one in (with_gap, values))
    assert (got.value, got.low, got.high) == (whole.value, whole.low, whole.high)
    assert got.sample.startswith("60 of 65 frames")
    assert math.isnan(bound_series([np.full(9, np.nan)], STATISTICS["rms"], 0.9, 9).value)
