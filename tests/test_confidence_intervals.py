"""Confidence bounds: as scipy has them where it does, and as wide as their probability says."""

import numpy as np
import pytest
from scipy import stats

from rso_lidar.confidence_intervals import (
    bootstrap_bounds,
    clopper_pearson_bounds,
    effective_count,
    percentile_interval,
    poisson_bounds,
    student_bounds,
    wilson_interval,
)


def test_wilson_is_scipys():
    for hits, trials in ((0, 12), (7, 12), (12, 12), (181, 240)):
        expected = stats.binomtest(hits, trials).proportion_ci(0.9, method="wilson")
        assert wilson_interval(hits / trials, trials, 0.9) == pytest.approx((expected.low, expected.high), abs=1e-12)
    assert np.isnan(wilson_interval(np.nan, 0, 0.95)).all()


def test_copies_of_a_frame_add_no_information():
    hits = np.array([1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0])
    alone = effective_count(hits, np.ones(8))
    assert effective_count(5.0 * hits, np.full(8, 5.0)) == pytest.approx(alone)
    assert alone == pytest.approx(7.0)  # n - 1: the variance is the unbiased one


def test_where_nothing_varies_each_encounter_counts_once():
    assert effective_count(np.full(6, 4.0), np.full(6, 4.0)) == 6.0
    assert effective_count(np.zeros(6), np.array([4.0, 4.0, 0.0, 4.0, 4.0, 4.0])) == 5.0
    assert effective_count(np.zeros(0), np.zeros(0)) == 0.0


def test_independent_frames_count_as_they_are():
    rng = np.random.default_rng(3)
    trials = np.full(400, 6.0)
    assert effective_count(rng.binomial(6, 0.7, 400).astype(float), trials) == pytest.approx(2400, rel=0.15)


def test_percentiles_allow_for_failures():
    values = np.concatenate([np.linspace(0.0, 1.0, 96), np.full(4, np.inf)])
    low, high = percentile_interval(values, 0.9)
    assert low == pytest.approx(0.042, abs=0.01) and high == pytest.approx(0.989, abs=0.01)
    assert percentile_interval(values, 0.95)[1] == np.inf
    assert np.isnan(percentile_interval(np.full(10, np.nan), 0.9)).all()


def test_intervals_cover_as_often_as_they_say():
    """Frames of one encounter share its difficulty: an interval over frames would cover far less often."""
    rng, trials, encounters, frames = np.random.default_rng(8), 400, 60, 5
    covered = covered_by_frames = 0
    for _ in range(trials):
        difficulty = rng.beta(2.4, 0.6, encounters)  # mean 0.8
        hits = rng.binomial(frames, difficulty).astype(float)
        share = hits.sum() / (frames * encounters)
        low, high = wilson_interval(share, effective_count(hits, np.full(encounters, float(frames))), 0.95)
        covered += low <= 0.8 <= high
        low, high = wilson_interval(share, frames * encounters, 0.95)
        covered_by_frames += low <= 0.8 <= high
    assert 0.915 < covered / trials < 0.98  # 0.95, and three standard deviations of 400 trials
    assert covered_by_frames / trials < 0.85


def test_encounters_that_all_have_one_share_count_every_trial():
    assert effective_count(np.ones(3), np.full(3, 2.0)) == 6.0


def test_clopper_and_pearson_are_scipys():
    for hits, trials in ((0, 12), (7, 12), (12, 12), (181, 240)):
        for side, k in (("greater", 0), ("less", 1)):
            expected = stats.binomtest(hits, trials, alternative=side).proportion_ci(0.9)[k]
            assert clopper_pearson_bounds(hits / trials, trials, 0.9)[k] == pytest.approx(expected, abs=1e-12)
    assert np.isnan(clopper_pearson_bounds(0.5, 0, 0.95)).all()


def test_poisson_bounds_are_quantiles_of_chi_square():
    for events in (0, 1, 17):
        low, high = poisson_bounds(events, 0.95)
        assert high == pytest.approx(stats.chi2.ppf(0.95, 2 * events + 2) / 2)
        assert low == pytest.approx(stats.chi2.ppf(0.05, 2 * events) / 2 if events else 0.0)


def test_student_is_scipys():
    values = np.array([1.0, 2.5, 2.0, 4.0])
    expected = stats.ttest_1samp(values, 0.0, alternative="two-sided").confidence_interval(0.9)
    assert student_bounds(values, 0.95) == pytest.approx((expected.low, expected.high))
    assert np.isnan(student_bounds(values[:1], 0.95)).all()


def test_the_accelerated_bootstrap_is_scipys():
    values = np.random.default_rng(2).exponential(size=40)
    expected = stats.bootstrap(
        (values,), np.mean, confidence_level=0.9, n_resamples=4000, method="BCa", rng=np.random.default_rng(1)
    )
    left_out = np.array([np.mean(np.delete(values, k)) for k in range(40)])
    drawn = expected.bootstrap_distribution
    got = bootstrap_bounds(drawn, float(values.mean()), 0.95, left_out)
    assert got == pytest.approx(tuple(expected.confidence_interval), rel=2e-3)
    plain = bootstrap_bounds(drawn, float(values.mean()), 0.95)
    assert plain == pytest.approx(tuple(np.quantile(drawn, [0.05, 0.95])))
    assert got[1] > plain[1] * 1.01  # the means of a skewed law
    assert np.isnan(bootstrap_bounds(np.array([1.0, np.nan]), 1.0, 0.9)).all()
